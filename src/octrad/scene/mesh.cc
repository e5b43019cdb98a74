#include "octrad/scene/mesh.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "octrad/base/error.h"
#include "octrad/scene/limits.h"

namespace octrad {
double angle_between(Vec3d a, Vec3d b) {
  return dot(a, b) < 0.0 ? std::numbers::pi - 2.0 * std::asin(std::min(1.0, 0.5 * length(a + b)))
                         : 2.0 * std::asin(std::min(1.0, 0.5 * length(b - a)));
}

std::size_t RawMesh::bytes() const {
  std::size_t sum = (positions.size() + normals.size()) * sizeof(Vec3f) + uvs.size() * sizeof(Vec2f) +
                    triangles.size() * sizeof(Vec3i);
  for (const MeshAttribute& a : attributes) sum += a.values.size() * sizeof(float);
  return sum;
}

std::vector<Vec3f> smooth_normals(const std::vector<Vec3f>& positions, const std::vector<Vec3i>& triangles) {
  std::vector<Vec3d> sums(positions.size());
  for (const Vec3i& triangle : triangles) {
    Vec3d p[3];
    for (int i = 0; i < 3; ++i) p[i] = Vec3d(positions[static_cast<std::size_t>(triangle[i])]);
    const Vec3d normal = cross(p[1] - p[0], p[2] - p[0]);
    const double area = length(normal);
    if (!(area > 0.0)) continue;
    const Vec3d edges[3] = {normalize(p[1] - p[0]), normalize(p[2] - p[1]), normalize(p[0] - p[2])};
    for (int i = 0; i < 3; ++i) {
      sums[static_cast<std::size_t>(triangle[i])] += normal * (angle_between(edges[i], -edges[(i + 2) % 3]) / area);
    }
  }
  std::vector<Vec3f> normals(positions.size());
  for (std::size_t i = 0; i < sums.size(); ++i) {
    const double l = length(sums[i]);
    normals[i] = l > 1e-12 ? Vec3f(sums[i] / l) : Vec3f(1, 0, 0);
  }
  return normals;
}

namespace {

// Whether the normals of all vertices are those of the faces around them, up to the rounding of files.
bool has_normals_of_faces(const TriangleMesh& mesh) {
  for (const Vec3i& t : mesh.triangles) {
    const auto x = static_cast<std::size_t>(t.x), y = static_cast<std::size_t>(t.y), z = static_cast<std::size_t>(t.z);
    const Vec3d p(mesh.positions[x]),
        face = normalize(cross(Vec3d(mesh.positions[y]) - p, Vec3d(mesh.positions[z]) - p));  // not finite: no area
    for (const std::size_t vertex : {x, y, z}) {
      if (length(Vec3d(mesh.normals[vertex]) - face) > 1e-5) return false;
    }
  }
  return true;
}

// Whether the vertex normals are behind the triangles, by area.
bool has_normals_behind(const TriangleMesh& mesh) {
  double sum = 0.0;
  for (const Vec3i& t : mesh.triangles) {
    const auto x = static_cast<std::size_t>(t.x), y = static_cast<std::size_t>(t.y), z = static_cast<std::size_t>(t.z);
    const Vec3d p(mesh.positions[x]);
    sum += dot(cross(Vec3d(mesh.positions[y]) - p, Vec3d(mesh.positions[z]) - p),
               Vec3d(mesh.normals[x]) + Vec3d(mesh.normals[y]) + Vec3d(mesh.normals[z]));
  }
  return sum < 0.0;
}

TriangleMesh placed_mesh(RawMesh&& raw, const Transform& to_world, const MeshOptions& options) {
  TriangleMesh mesh;
  mesh.flip_normals = options.flip_normals;
  mesh.one_sided = options.one_sided;
  mesh.positions = std::move(raw.positions);
  for (Vec3f& p : mesh.positions) {
    p = Vec3f(to_world.point(Vec3d(p)));
    if (!within(p, kLargestCoordinate))
      throw InputError("a vertex is too far away: coordinates may be up to 1e9 in the scene");
  }
  mesh.triangles = std::move(raw.triangles);
  mesh.uvs = std::move(raw.uvs);
  if (options.flip_v) {
    for (Vec2f& uv : mesh.uvs) uv.y = 1.0f - uv.y;
  }
  if (options.face_normals) return mesh;
  if (raw.normals.empty()) {
    mesh.normals = smooth_normals(mesh.positions, mesh.triangles);
    return mesh;
  }
  mesh.normals = std::move(raw.normals);
  const std::array<double, 9> m = to_world.normal_matrix();
  std::vector<std::size_t> without;
  for (std::size_t i = 0; i < mesh.normals.size(); ++i) {
    const Vec3d n(mesh.normals[i]);
    const Vec3d world{m[0] * n.x + m[1] * n.y + m[2] * n.z, m[3] * n.x + m[4] * n.y + m[5] * n.z,
                      m[6] * n.x + m[7] * n.y + m[8] * n.z};
    const double l = length(world);
    mesh.normals[i] = l > 0.0 ? Vec3f(world / l) : Vec3f(0.0f);
    if (!(l > 0.0)) without.push_back(i);
  }
  // What mirrors turns the triangles' sides, and the normals with the surface.
  if (to_world.determinant() < 0.0 && has_normals_behind(mesh)) {
    for (Vec3i& triangle : mesh.triangles) std::swap(triangle.y, triangle.z);
  }
  if (!without.empty()) {
    const std::vector<Vec3f> computed = smooth_normals(mesh.positions, mesh.triangles);
    for (const std::size_t i : without) mesh.normals[i] = computed[i];
  }
  return mesh;
}

}  // namespace

TriangleMesh place_mesh(RawMesh&& raw, const Transform& to_world, const MeshOptions& options) {
  TriangleMesh mesh = placed_mesh(std::move(raw), to_world, options);
  mesh.flat = !mesh.normals.empty() && has_normals_of_faces(mesh);
  return mesh;
}

double front_share(const RawMesh& mesh) {
  if (mesh.normals.empty()) return kSideApart;
  double sum = 0.0;
  for (const Vec3i& t : mesh.triangles) {
    Vec3d p[3], normal(0.0);
    for (int k = 0; k < 3; ++k) {
      p[k] = Vec3d(mesh.positions[static_cast<std::size_t>(t[k])]);
      normal += Vec3d(mesh.normals[static_cast<std::size_t>(t[k])]);
    }
    sum += dot(cross(p[1] - p[0], p[2] - p[0]), normal);
  }
  return sum < 0.0 ? -kSideApart : kSideApart;
}

RawMesh moved_along_normals(RawMesh mesh, double share) {
  Bounds3f box;
  for (const Vec3f& p : mesh.positions) box.extend(p);
  const double distance = share * length(Vec3d(box.upper) - Vec3d(box.lower));
  const std::vector<Vec3f> normals = smooth_normals(mesh.positions, mesh.triangles);
  for (std::size_t i = 0; i < normals.size(); ++i)
    mesh.positions[i] = Vec3f(Vec3d(mesh.positions[i]) + Vec3d(normals[i]) * distance);
  return mesh;
}

RawMesh make_rectangle() {
  RawMesh mesh;
  mesh.positions = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
  mesh.normals.assign(4, Vec3f(0, 0, 1));
  mesh.uvs = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  mesh.triangles = {{0, 1, 2}, {2, 3, 0}};
  return mesh;
}

// Each face has four corners with uv (0,1) (1,1) (1,0) (0,0), counter-clockwise seen from outside when walked
// backwards from the last. The face order and the corner where each begins are those of Mitsuba 3.
RawMesh make_cube() {
  static const float corners[24][3] = {{1, -1, -1}, {1, -1, 1},  {-1, -1, 1},  {-1, -1, -1},  // -y
                                       {1, 1, -1},  {-1, 1, -1}, {-1, 1, 1},   {1, 1, 1},     // +y
                                       {1, -1, -1}, {1, 1, -1},  {1, 1, 1},    {1, -1, 1},    // +x
                                       {1, -1, 1},  {1, 1, 1},   {-1, 1, 1},   {-1, -1, 1},   // +z
                                       {-1, -1, 1}, {-1, 1, 1},  {-1, 1, -1},  {-1, -1, -1},  // -x
                                       {1, 1, -1},  {1, -1, -1}, {-1, -1, -1}, {-1, 1, -1}};  // -z
  static const float normals[6][3] = {{0, -1, 0}, {0, 1, 0}, {1, 0, 0}, {0, 0, 1}, {-1, 0, 0}, {0, 0, -1}};
  static const Vec2f uvs[4] = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
  RawMesh mesh;
  for (int i = 0; i < 24; ++i) {
    mesh.positions.push_back({corners[i][0], corners[i][1], corners[i][2]});
    mesh.normals.push_back({normals[i / 4][0], normals[i / 4][1], normals[i / 4][2]});
    mesh.uvs.push_back(uvs[i % 4]);
  }
  for (int face = 0; face < 6; ++face) {
    const int i = 4 * face;
    mesh.triangles.push_back({i, i + 1, i + 2});
    mesh.triangles.push_back({i + 3, i, i + 2});
  }
  return mesh;
}

}  // namespace octrad
