// Disks and cylinders as meshes. Their facets have the area of the round shape, so that lights on them send as much.
#include <cmath>
#include <numbers>

#include "octrad/base/frame.h"
#include "octrad/scene/mesh.h"

namespace octrad {
namespace {

// The normals of a cylinder's facets differ by 1.4 degrees; where a facet lies off the circle, it is by less than a
// ten-thousandth of the radius.
constexpr int kSegments = 256;
constexpr double kTurn = 2.0 * std::numbers::pi;

Vec2f around(int i) {
  const double phi = kTurn * i / kSegments;
  return {static_cast<float>(std::cos(phi)), static_cast<float>(std::sin(phi))};
}

}  // namespace

RawMesh make_disk() {
  constexpr double kStep = kTurn / kSegments;
  const auto radius = static_cast<float>(std::sqrt(kStep / std::sin(kStep)));
  RawMesh mesh;
  for (int i = 0; i <= kSegments; ++i) {
    const Vec2f d = around(i);
    mesh.positions.push_back({radius * d.x, radius * d.y, 0.0f});
    mesh.uvs.push_back({1.0f, static_cast<float>(i) / kSegments});
  }
  for (int i = 0; i < kSegments; ++i) {  // a centre for each, whose azimuth is that of its middle
    mesh.triangles.push_back({static_cast<int>(mesh.positions.size()), i, i + 1});
    mesh.positions.push_back(Vec3f(0.0f));
    mesh.uvs.push_back({0.0f, (static_cast<float>(i) + 0.5f) / kSegments});
  }
  mesh.normals.assign(mesh.positions.size(), Vec3f(0, 0, 1));
  return mesh;
}

RawMesh make_cylinder(Vec3d p0, Vec3d p1, double radius) {
  constexpr double kHalf = 0.5 * kTurn / kSegments;
  const auto r = static_cast<float>(radius * kHalf / std::sin(kHalf));
  const Frame frame = make_frame(Vec3f(normalize(p1 - p0)));
  RawMesh mesh;
  for (int i = 0; i <= kSegments; ++i) {
    const Vec2f d = around(i);
    const Vec3f outward = frame.s * d.x + frame.t * d.y;
    for (int end = 0; end < 2; ++end) {
      mesh.positions.push_back(Vec3f(end == 0 ? p0 : p1) + outward * r);
      mesh.normals.push_back(outward);
      mesh.uvs.push_back({static_cast<float>(i) / kSegments, static_cast<float>(end)});
    }
  }
  for (int i = 0; i < 2 * kSegments; i += 2) {
    mesh.triangles.push_back({i, i + 2, i + 3});
    mesh.triangles.push_back({i, i + 3, i + 1});
  }
  return mesh;
}

}  // namespace octrad
