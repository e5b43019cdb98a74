#include <algorithm>
#include <cmath>

#include "octrad/base/random_inputs.h"
#include "octrad/device/launch.h"
#include "octrad/encoding/checks.h"
#include "octrad/encoding/octahedral_math.h"
#include "octrad/encoding/spherical_harmonics_math.h"

namespace octrad {
namespace {

struct OctahedralMap : Kernel {
  const Vec3f* directions;
  Vec2f* out;
  OCTRAD_HD void operator()(std::uint32_t i) const { out[i] = octa_project(directions[i]).u; }
};

struct Harmonics : Kernel {
  const Vec3f* directions;
  float* out;  // [n][16]
  OCTRAD_HD void operator()(std::uint32_t i) const {
    spherical_harmonics(directions[i], out + kSphericalHarmonics * static_cast<std::size_t>(i));
  }
};

}  // namespace

CheckResult check_octahedral_map(Stream& stream, std::size_t n, std::uint64_t seed) {
  const std::vector<Vec3f> directions = testing::random_directions(n, seed);
  const DeviceArray<Vec3f> in(stream, std::span<const Vec3f>(directions), "check");
  const DeviceArray<Vec2f> out(stream, n, "check");
  launch(stream, n, OctahedralMap{{}, in.data(), out.data()});
  const std::vector<Vec2f> found = out.download();
  CheckErrors errors;
  for (std::size_t i = 0; i < n; ++i) {
    const Vec2<double> u = octa_project(Vec3d(directions[i])).u;
    errors.add(std::max(std::fabs(found[i].x - u.x), std::fabs(found[i].y - u.y)));
  }
  return errors.result("distance on the square", 5e-7);
}

CheckResult check_spherical_harmonics(Stream& stream, std::size_t n, std::uint64_t seed) {
  const std::vector<Vec3f> directions = testing::random_directions(n, seed);
  const DeviceArray<Vec3f> in(stream, std::span<const Vec3f>(directions), "check");
  const DeviceArray<float> out(stream, kSphericalHarmonics * n, "check");
  launch(stream, n, Harmonics{{}, in.data(), out.data()});
  const std::vector<float> found = out.download();
  CheckErrors errors;
  for (std::size_t i = 0; i < n; ++i) {
    double expected[kSphericalHarmonics];
    spherical_harmonics(Vec3d(directions[i]), expected);
    for (std::size_t k = 0; k < kSphericalHarmonics; ++k)
      errors.add(std::fabs(found[kSphericalHarmonics * i + k] - expected[k]));
  }
  return errors.result("absolute error", 2e-6);
}

}  // namespace octrad
