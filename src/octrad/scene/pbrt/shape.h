// Shapes of pbrt as meshes and curves. Internal to pbrt*.cc.
#pragma once

#include <optional>
#include <set>
#include <string>

#include "octrad/scene/curves.h"
#include "octrad/scene/mesh.h"
#include "octrad/scene/pbrt/file.h"
#include "octrad/scene/transform.h"

namespace octrad {

// The shape in object space, its front where pbrt has it, with Mitsuba's v, which runs down: triangles, bilinear
// patches (two triangles each), subdivision surfaces, spheres, disks, cylinders, cones, paraboloids and hyperboloids
// (256 segments around). nullopt for types that are no such mesh. `subdivided`: the triangles that
// subdivision made so far, in the scene. Throws SceneError, MemoryError.
std::optional<RawMesh> pbrt_mesh(const PbrtObject& shape, double& subdivided);

// Shapes that a few numbers describe.
bool is_quadric(const std::string& type);

// The cubic B-splines of a shape "curve", in world space; radii grow with the transform.
Curves pbrt_curves(const PbrtObject& shape, const Transform& to_world, SceneReport& report);

// The content of a PLY file that may be compressed by gzip (its name then ends in .gz): with v turned over.
RawMesh read_pbrt_ply(const std::string& file);
// What a plain PLY file says that its vertices, or other elements, have: "nx", "u" ...
std::set<std::string> ply_properties(const std::string& file);

// Each triangle with vertices of its own, at (0, 0), (1, 0) and (1, 1) of the texture, where pbrt has no others.
RawMesh with_own_uvs(const RawMesh& mesh);

double mesh_area(const RawMesh& mesh, const Transform& to_world);

// Loop, C. 1987, "Smooth Subdivision Surfaces Based on Triangles": `levels` steps, then to the limit. The front is
// where pbrt has it: against the order of the corners.
RawMesh subdivide_loop(RawMesh mesh, int levels);

}  // namespace octrad
