#include "app/selftest/shading_numbers.h"

#include <algorithm>
#include <cmath>

#include "app/selftest/entries.h"
#include "app/selftest/rays.h"
#include "octrad/base/rng.h"
#include "octrad/base/threads.h"
#include "octrad/device/array.h"

namespace octrad::selftest {
namespace {

// The CPU's own classes.
struct CpuWorld {
  const PreparedScene& s;
  SurfaceInteraction interact(const Hit& hit, Vec3f o, Vec3f d) const { return octrad::interact(s.scene(), hit, o, d); }
  ShadingPoint shade(const SurfaceInteraction& surface, Vec3f wo) const {
    return octrad::shade(s.materials(), surface, wo);
  }
  LightSample sample_light(Vec3f x, float u_pick, Vec2f u) const { return s.lights().sample(x, u_pick, u); }
  Vec3f emitted(const SurfaceInteraction& surface, Vec3f wo) const { return s.lights().emitted(surface, wo); }
  Vec3f environment(Vec3f d) const { return s.lights().environment(d); }
};

}  // namespace

CheckResult check_shading(const Context& c) {
  constexpr std::size_t kUniforms = 6;
  const RayFixture rays(c, c.items(1 << 18, 1 << 13));
  const std::size_t n = rays.size();
  std::vector<Hit> hits(n);
  std::vector<float> u(n * kUniforms), expected(n * kShadingNumbers);
  const CpuWorld cpu{*c.loaded};
  parallel_for(n, [&](std::size_t i) {
    const RayQuery& r = rays.host()[i];
    hits[i] = bvh8_intersect(c.bvh.view(), r.origin, r.direction, 0.0f, r.t_max);
    Rng rng(c.seed + 2, RngPurpose::test, i);
    for (std::size_t k = 0; k < kUniforms; ++k) u[i * kUniforms + k] = rng.uniform();
    shading_numbers(cpu, hits[i], r.origin, r.direction, &u[i * kUniforms], &expected[i * kShadingNumbers]);
  });
  const DeviceArray<Hit> device_hits(c.stream, std::span<const Hit>(hits), "selftest");
  const DeviceArray<float> device_u(c.stream, std::span<const float>(u), "selftest"),
      out(c.stream, n * kShadingNumbers, "selftest");
  run_shading(c.stream, n, c.loaded->world(c.stream), rays.data(), device_hits.data(), device_u.data(), out.data());
  const std::vector<float> got = out.download();
  Errors errors;
  for (std::size_t i = 0; i < got.size(); ++i) {
    errors.add(std::fabs(static_cast<double>(got[i]) - expected[i]) /
               std::max(1.0, std::fabs(static_cast<double>(expected[i]))));
  }
  return errors.result("relative error of normals, albedos, lights, samples", 1e-3,
                       2e-3);  // near ties fall to either side
}

}  // namespace octrad::selftest
