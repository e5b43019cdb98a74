// Triangle meshes before they become part of a Scene: readers of mesh files, transformation to world space, vertex
// normals.
#pragma once

#include <string>
#include <string_view>

#include "octrad/scene/scene.h"
#include "octrad/scene/transform.h"

namespace octrad {

// Values of a mesh's vertices or triangles, of one or three channels.
struct MeshAttribute {
  std::string name;  // vertex_... or face_...
  int channels = 1;
  std::vector<float> values;  // [vertices or triangles][channels]
  bool bytes = false;         // of uchar, from 0 to 255
};

// A mesh as its file holds it, in object space.
struct RawMesh {
  std::vector<Vec3f> positions;
  std::vector<Vec3f> normals;  // empty, or one per vertex of any length; (0, 0, 0) where the file has none
  std::vector<Vec2f> uvs;      // empty, or one per vertex
  std::vector<Vec3i> triangles;
  std::vector<MeshAttribute> attributes;  // those that were asked for

  std::size_t bytes() const;  // that its arrays take
};

// Wavefront OBJ: v, vt, vn and f (any polygon, negative indices); other statements are skipped. Polygons become fans.
// Corners with equal indices share a vertex; vertices are numbered in order of first use. Throws InputError with
// file:line:column, IoError.
RawMesh read_obj(const std::string& file);
RawMesh parse_obj(const std::string& name, const std::string& text);

// Stanford PLY, ascii and binary of either byte order. Vertex properties x y z, nx ny nz, u v (or s t, texture_u
// texture_v); face property vertex_indices (or vertex_index). Others are skipped, but for the attributes that are asked
// for: NAME of the vertices is "vertex_NAME", that of the faces "face_NAME"; its properties are NAME, or NAME_0,
// NAME_1, NAME_2, or r, g, b for the name "color". Those that the file lacks are left out.
RawMesh read_ply(const std::string& file, const std::vector<std::string>& attributes = {});
RawMesh parse_ply(const std::string& name, const std::string& bytes, const std::vector<std::string>& attributes = {});
// Whether a property of vertices is the first texture coordinate.
bool is_ply_coordinate(std::string_view property);

// The content of a binary little-endian PLY file of the mesh; of its attributes those named vertex_color.
std::string ply_bytes(const RawMesh& mesh);

// Mitsuba's serialized meshes of versions 3 and 4: mesh `index` of the file, from 0. Vertex colours are skipped; the
// flag of face normals has no effect, as in Mitsuba 3. Throws InputError, IoError, MemoryError.
RawMesh read_serialized(const std::string& file, int index);
RawMesh parse_serialized(const std::string& name, const std::string& bytes, int index);

// [-1,1]^2 in the xy-plane facing +z, and [-1,1]^3, with Mitsuba's uv.
RawMesh make_rectangle();
RawMesh make_cube();
// The unit disk in the xy-plane facing +z, and the open cylinder about the line from p0 to p1, facing outwards: 256
// segments, uv as in Mitsuba, (distance, azimuth) and (azimuth, height).
RawMesh make_disk();
RawMesh make_cylinder(Vec3d p0, Vec3d p1, double radius);

struct MeshOptions {
  bool face_normals = false;  // drop vertex normals
  bool flip_normals = false;
  bool flip_v = false;  // v := 1 - v
  bool one_sided = false;
};

// World-space mesh. As in Mitsuba 3: vertex normals of the file are carried by the inverse transpose; without any (and
// without face_normals) they are computed in world space, weighted by angle (Thuermer & Wuethrich 1998, "Computing
// Vertex Normals from Polygonal Facets"). Where a mirroring transform would turn the triangles against the file's
// normals, the triangles are turned back, so that geometric and shading normals stay on the same side.
TriangleMesh place_mesh(RawMesh&& raw, const Transform& to_world, const MeshOptions& options);

// Vertices moved along their normals, outwards where `share` of the diagonal of the mesh's box is above 0.
RawMesh moved_along_normals(RawMesh mesh, double share);

// A light has one side; one that shines from both is two, so far apart from the mesh, of the diagonal of its box.
inline constexpr double kSideApart = 1e-4;
// The share by which moved_along_normals() makes the front, which is where the normals look, and without normals where
// the corners run counterclockwise; the back is at the other sign.
double front_share(const RawMesh& mesh);

// Angle between unit vectors, accurate near 0 and pi (Kahan).
double angle_between(Vec3d a, Vec3d b);

// Angle-weighted vertex normals; (1, 0, 0) where a vertex has no triangle with an area.
std::vector<Vec3f> smooth_normals(const std::vector<Vec3f>& positions, const std::vector<Vec3i>& triangles);

}  // namespace octrad
