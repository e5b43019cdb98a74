#include <limits>

#include "octrad/base/rng.h"
#include "octrad/base/threads.h"
#include "octrad/device/launch.h"
#include "octrad/transport/checks.h"

namespace octrad {
namespace {

// A ray, and random numbers for everything that is drawn where it ends.
struct Probe {
  Vec3f origin, direction;
  float u[8];
};

struct Writer {
  float* out;
  OCTRAD_HD void add(float x) { *out++ = x; }
  OCTRAD_HD void add(bool x) { *out++ = x ? 1.0f : 0.0f; }
  OCTRAD_HD void add(int x) { *out++ = static_cast<float>(x); }
  OCTRAD_HD void add(Vec2f v) {
    add(v.x);
    add(v.y);
  }
  OCTRAD_HD void add(Vec3f v) {
    add(v.x);
    add(v.y);
    add(v.z);
  }
  OCTRAD_HD void add(const SurfaceInteraction& s) {
    add(s.position);
    add(s.geometric_normal);
    add(s.shading_normal);
    add(s.uv);
    add(s.dp_du);
    add(s.dp_dv);
    add(s.shape);
    add(s.material);
    add(s.emitter);
    add(s.t);
  }
};

constexpr int kNumbers = 160;

// Everything that a World says about a probe that ended at `hit`. `sampled`: a point on its surfaces.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD int describe(const World& world, const SurfaceInteraction& sampled, const Probe& p, const Hit& hit,
                       float* numbers) {
  Writer w{numbers};
  w.add(sampled);
  w.add(world.has_environment());
  w.add(world.has_lights());
  w.add(world.environment(p.direction));
  w.add(world.environment_pdf(p.origin, p.direction));
  float pdf = -1.0f;
  w.add(world.environment(p.origin, p.direction, pdf));
  w.add(pdf);
  if (!hit.valid()) return static_cast<int>(w.out - numbers);
  const SurfaceInteraction surface = world.interact(hit, p.origin, p.direction);
  w.add(surface);
  w.add(world.emitted(surface, -p.direction));
  w.add(world.light_pdf(p.origin, surface));
  const ShadingPoint point = world.shade(surface, -p.direction);
  const Bsdf& b = point.bsdf;
  w.add(point.ns);
  w.add(point.s);
  w.add(point.t);
  w.add(point.front);
  w.add(point.black);
  w.add(static_cast<int>(b.type));
  w.add(static_cast<int>(b.distribution));
  w.add(b.two_sided);
  w.add(b.bumped);
  w.add(b.reflectance);
  w.add(b.specular_reflectance);
  w.add(b.specular_transmittance);
  w.add(b.alpha_u);
  w.add(b.alpha_v);
  w.add(b.opacity);
  w.add(b.eta);
  w.add(b.base_normal);
  w.add(b.internal_reflectance);
  w.add(albedo_bsdf(b));
  w.add(roughness_bsdf(b));
  const LightSample light = world.sample_light(surface.position, p.u[3], {p.u[4], p.u[5]});
  w.add(light.valid);
  w.add(light.direction);
  w.add(light.distance);
  w.add(light.radiance);
  w.add(light.pdf);
  w.add(light.delta);
  if (light.valid) {
    const RayQuery shadow = shadow_ray(surface.position, surface.geometric_normal, light);
    w.add(shadow.origin);
    w.add(shadow.direction);
    w.add(shadow.t_max);
    const BsdfValue f = evaluate_bsdf(b, point.to_local(point.wo), point.to_local(light.direction));
    w.add(f.value);
    w.add(f.pdf);
  }
  const BsdfSample s = sample_bsdf(b, point.to_local(point.wo), p.u[6], {p.u[7], p.u[0]});
  w.add(s.valid);
  w.add(s.wi);
  w.add(s.weight);
  w.add(s.pdf);
  w.add(s.delta);
  w.add(s.transmission);
  return static_cast<int>(w.out - numbers);
}

struct Describe : Kernel {
  DeviceWorld world;
  const Probe* probes;
  const Hit* hits;
  float* numbers;  // [i][kNumbers]
  int* counts;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    const Probe& p = probes[i];
    counts[i] = describe(world, world.sample_surface(p.u[0], {p.u[1], p.u[2]}), p, hits[i],
                         numbers + std::size_t{i} * kNumbers);
  }
};

}  // namespace

CheckResult check_world(Stream& stream, const PreparedScene& scene, std::size_t n, std::uint64_t seed) {
  const TransportContext context = scene.context();
  const std::vector<RayQuery> rays = incoherent_rays(scene, n, false, seed);
  std::vector<Probe> probes(n);
  std::vector<Hit> hits(n);
  std::vector<float> expected(n * kNumbers);
  std::vector<int> expected_counts(n);
  parallel_for(n, [&](std::size_t i) {
    Probe& p = probes[i];
    p = {rays[i].origin, rays[i].direction, {}};
    Rng rng(seed + 1, RngPurpose::test, i);
    for (float& u : p.u) u = rng.uniform();
    hits[i] = bvh8_intersect(scene.bvh8().view(), p.origin, p.direction, 0.0f, rays[i].t_max);
    const SurfaceInteraction sampled = scene.surfaces().sample(p.u[0], {p.u[1], p.u[2]});
    expected_counts[i] = describe(context, sampled, p, hits[i], &expected[i * kNumbers]);
  });
  const DeviceArray<Probe> device_probes(stream, std::span<const Probe>(probes), "check");
  const DeviceArray<Hit> device_hits(stream, std::span<const Hit>(hits), "check");
  const DeviceArray<float> numbers(stream, n * kNumbers, "check");
  const DeviceArray<int> counts(stream, n, "check");
  launch(stream, n,
         Describe{{}, scene.world(stream), device_probes.data(), device_hits.data(), numbers.data(), counts.data()});
  const std::vector<float> found = numbers.download();
  const std::vector<int> found_counts = counts.download();
  CheckErrors errors;
  for (std::size_t i = 0; i < n; ++i) {
    if (found_counts[i] != expected_counts[i]) {
      errors.add(std::numeric_limits<double>::infinity());
      continue;
    }
    const auto count = static_cast<std::size_t>(found_counts[i]);
    errors.compare(std::span(found).subspan(i * kNumbers, count), std::span(expected).subspan(i * kNumbers, count));
  }
  // Kinks and near ties fall to either side.
  return errors.exact_on_host(stream, "relative error of surfaces, materials, lights, samples", 1e-4, 1e-2);
}

}  // namespace octrad
