// Limits of what a scene may hold.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>

#include "octrad/base/vec.h"
#include "octrad/image/size_limit.h"

namespace octrad {

// Beyond the limits of coordinates single precision and the ray tracer (whose rays must begin within 1.8e18) give no
// picture. This one is of vertices and spheres in world space: products of two areas must stay finite: (1e9)^4 is 1e36
// of 3.4e38.
constexpr float kLargestCoordinate = 1e9f;
// Limit of the positions of cameras and of where their rays begin. They may stand outside of what they look at.
constexpr float kLargestCameraCoordinate = 1e12f;

// Limits of rays in the space of an instance.
constexpr double kLargestRayOrigin = 1e18, kLeastRayDirection = 1e-15;

// Vertices, and triangles, of a mesh: four times their number is an int.
constexpr std::uint64_t kMostMeshElements = static_cast<std::uint64_t>(std::numeric_limits<int>::max()) / 4;

// False also where a component is not a number.
template <typename T>
bool within(const Vec3<T>& p, float limit) {
  return std::fabs(p.x) <= limit && std::fabs(p.y) <= limit && std::fabs(p.z) <= limit;
}

}  // namespace octrad
