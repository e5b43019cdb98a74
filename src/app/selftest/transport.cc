#include <algorithm>
#include <cmath>

#include "app/selftest/entries.h"
#include "app/selftest/ground.h"
#include "octrad/base/rng.h"
#include "octrad/base/threads.h"
#include "octrad/transport/gbuffer_device.h"
#include "octrad/transport/lhs_device.h"
#include "octrad/transport/lhs_sampler.h"
#include "octrad/transport/path.h"
#include "octrad/transport/path_device.h"
#include "octrad/transport/rhs_device.h"
#include "octrad/transport/rhs_estimator.h"

namespace octrad::selftest {
namespace {

// The ground on the stream too.
struct TransportGround : Ground {
  const DeviceWorld& device;
  float size;  // of the scene

  explicit TransportGround(const Context& c)
      : Ground(c, varied_room),
        device(use.world(c.stream)),
        size(std::max(1e-20f, length(use.scene().bounds.upper - use.scene().bounds.lower))) {}
  const DeviceWorld& world() const { return device; }

  // What a cache might say of a point: smooth in all that it is told.
  Vec3f answer(const SurfacePoint& p) const {
    const float d = p.disparity * size;
    return {0.5f + 0.4f * std::sin(6.0f * p.x.x / size + p.wo.y),
            0.5f + 0.4f * std::cos(4.0f * p.x.y / size + p.n.z) * p.albedo.y, 0.2f + p.alpha + d / (1.0f + d)};
  }
  std::vector<Vec3f> answers(Stream& stream, const SurfacePointArray& points, std::uint32_t count) const {
    HostPlanes host(stream, points.data, points.stride, kSurfacePointNumbers);
    std::vector<Vec3f> values(count);
    for (std::uint32_t q = 0; q < count; ++q)
      values[q] = answer(SurfacePointArray{host.planes().data, points.stride}.load(q));
    return values;
  }
};

double distance(Vec3f a, Vec3f b) { return static_cast<double>(length(a - b)); }

LhsOptions lhs_options(const Context& c) {
  LhsOptions options;
  options.walks = 0.6;
  options.view = 0.2;
  options.keep_direction = 0.3;
  options.uniform_glossy = true;
  options.glossy_boost = 2.0;
  options.seed = c.seed;
  return options;
}

// The picture of the scene's first camera, made small.
CameraJob small_picture(const Context& c, const Scene& scene, int count) {
  CameraJob job;
  const bool large = c.items(1, 0) > 0;
  job.width = large ? 256 : 32;
  job.height = large ? 192 : 24;
  job.view = scene.cameras.front().view(job.width, job.height);
  job.seed = c.seed;
  job.first = 3;
  job.count = count;
  return job;
}

void compare_samples(Stream& stream, const SamplePlanes& found, std::span<const Vec3f> radiance,
                     std::span<const FirstHit> first, float size, Estimates& estimates) {
  HostPlanes host(stream, found.data, found.stride, kSampleNumbers);
  const FloatPlanes planes = host.planes();
  for (std::size_t k = 0; k < radiance.size(); ++k) {
    estimates.add(planes.get3(0, k), radiance[k]);
    estimates.add(planes.get3(3, k), first[k].albedo);
    estimates.add(planes.get3(6, k), first[k].normal);
    estimates.add({planes.get(9, k) / size, planes.get(10, k), 0.0f},
                  {first[k].depth / size, first[k].roughness, 0.0f});
  }
}

CheckResult compare_paths(const Context& c, int wave_bounces) {
  const TransportGround ground(c);
  const CameraJob job = small_picture(c, ground.use.scene(), 4);
  const PathLimits limits{12, 5};
  std::vector<PathSample> paths;
  for (std::uint32_t k = 0; k < job.size(); ++k) {
    const CameraSample s = job.sample(k);
    paths.push_back({s.ray, s.rng, {}, {}});
  }
  std::vector<PathCounters> counters((paths.size() + 255) / 256);
  parallel_blocks(paths.size(), 256, [&](std::size_t begin, std::size_t end) {
    trace_paths(ground.context, limits, std::span(paths).subspan(begin, end - begin), counters[begin / 256]);
  });
  DevicePathTracer tracer(c.stream, ground.world(), job.size(), wave_bounces);
  tracer.set(job);
  tracer.run(limits);
  std::vector<Vec3f> radiance;
  std::vector<FirstHit> first;
  for (const PathSample& p : paths) {
    radiance.push_back(p.radiance);
    first.push_back(p.first);
  }
  unsigned long long rays = 0;
  for (const PathCounters& p : counters) rays += static_cast<unsigned long long>(p.rays);
  Estimates estimates;
  compare_samples(c.stream, tracer.samples(), radiance, first, ground.size, estimates);
  estimates.add_counts(tracer.take_rays(), rays);
  return estimates.result(c, "relative error of samples", 2e-3, 0.005);
}

struct RhsCase {
  int directions;
  bool inside, traced, keys, ask;
};

void compare_right_hand_sides(const Context& c, const TransportGround& ground, std::size_t n, const RhsCase& kind,
                              Estimates& estimates) {
  const LhsOptions draw = lhs_options(c);
  const LhsSampler sampler(ground.use, draw);
  const unsigned long long number = c.seed % 1000;
  const DeviceArray<unsigned long long> step(c.stream, std::span<const unsigned long long>(&number, 1), "selftest");
  DeviceLhs lhs(c.stream, ground.world(), draw, sampler.views(), sampler.fresh_poses(), n);
  lhs.run(step.data(), n);
  // The same points for the CPU: tables that they point to are its own.
  std::vector<ShadingPoint> points;
  for (const ShadingPoint& p : fetch(c.stream, lhs.points(), n)) {
    points.push_back(ground.context.shade(p.surface, p.wo));
    points.back().bsdf.opacity = p.bsdf.opacity;
  }
  std::vector<unsigned long long> keys;
  for (std::size_t i = 0; kind.keys && i < n; ++i) keys.push_back(mix64(c.seed + i));

  RhsOptions options;
  options.directions = kind.directions;
  options.max_chain = 6;
  options.emission_inside = kind.inside;
  options.traced_disparity = kind.traced;
  options.seed = c.seed;
  options.stream = number;
  options.keys = keys;
  const RadianceQuery query = [&](std::span<const SurfacePoint> asked, std::span<Vec3f> out) {
    for (std::size_t i = 0; i < asked.size(); ++i) out[i] = ground.answer(asked[i]);
  };
  std::vector<Vec3f> expected(n);
  const RhsStatistics statistics =
      estimate_rhs(ground.context, points, options, kind.ask ? query : RadianceQuery(), expected);
  for (std::size_t i = 0; i < n && kind.inside; ++i) {
    if (points[i].surface.emitter >= 0) expected[i] += ground.context.emitted(points[i].surface, points[i].wo);
  }

  DeviceRhsOptions device_options;
  device_options.directions = kind.directions;
  device_options.max_chain = options.max_chain;
  device_options.emission_inside = device_options.own_emission = kind.inside;
  device_options.ask = kind.ask;
  device_options.seed = c.seed;
  const DeviceArray<unsigned long long> device_keys(c.stream, std::span<const unsigned long long>(keys), "selftest");
  DeviceRhsPoints device_points;
  device_points.points = lhs.points();
  device_points.most = n;
  device_points.stream = step.data();
  device_points.keys = device_keys.data();  // null where there are none
  DeviceRhs rhs(c.stream, ground.world(), n * static_cast<std::size_t>(kind.directions), kind.traced);
  rhs.trace(device_points, device_options);
  const std::vector<Vec3f> values = ground.answers(c.stream, rhs.queries(), fetch(c.stream, rhs.query_count(), 1)[0]);
  DeviceArray<Vec3f> answers(c.stream, rhs.capacity(), "selftest");
  const DeviceArray<Vec3f> targets(c.stream, n, "selftest");
  answers.upload(values);
  rhs.reduce(device_points, device_options, answers.data(), targets.data());
  const std::vector<Vec3f> got = targets.download();
  for (std::size_t i = 0; i < n; ++i) estimates.add(got[i], expected[i]);
  const TraceCounts counts = rhs.take_counts();
  estimates.add_counts(counts.rays, static_cast<unsigned long long>(statistics.rays));
  estimates.add_counts(values.size(), static_cast<unsigned long long>(statistics.queries));
}

void compare_first_hits(const Context& c, const TransportGround& ground, const FirstHitOptions& options, bool traced,
                        Estimates& estimates) {
  using Bounce = FirstHitOptions::Bounce;
  const CameraJob job = small_picture(c, ground.use.scene(), 3);
  const auto right_hand_side = [&](const ShadingPoint& p, unsigned long long key) {
    return Vec3f(p.surface.position.y / ground.size, p.wo.z, static_cast<float>(key % 1000) * 1e-3f);
  };
  std::vector<Vec3f> radiance(job.size());
  std::vector<FirstHit> first(job.size());
  std::vector<TraceCounts> of(job.size());
  parallel_for(job.size(), [&](std::size_t k) {
    CameraSample sample = job.sample(static_cast<std::uint32_t>(k));
    RayEnd end;
    const FirstHitQuery query = trace_first_hit(ground.context, options, sample, end, first[k]);
    of[k].rays = static_cast<unsigned long long>(end.rays);
    radiance[k] = query.known;
    if (query.next == FirstHitQuery::Next::bounce) {
      radiance[k] += end.throughput * right_hand_side(end.point, query.key);
    } else if (query.next == FirstHitQuery::Next::query) {
      of[k].rays += traced;
      radiance[k] += end.throughput * ground.answer(field_query_point(ground.context, end.point, traced));
      of[k].queries = 1;
    }
  });
  unsigned long long rays = 0, queries = 0;
  for (const TraceCounts& t : of) {
    rays += t.rays;
    queries += t.queries;
  }

  DeviceGBuffer buffer(c.stream, ground.world(), job.size(), options.bounce != Bounce::none, traced);
  buffer.set(job);
  buffer.run(options);
  const std::vector<Vec3f> answers =
      ground.answers(c.stream, buffer.queries(), fetch(c.stream, buffer.query_count(), 1)[0]);
  const std::size_t bounced = fetch(c.stream, buffer.bounce_count(), 1)[0];
  const std::vector<ShadingPoint> points = fetch(c.stream, buffer.bounce_points(), bounced);
  const std::vector<unsigned long long> keys = fetch(c.stream, buffer.bounce_keys(), bounced);
  std::vector<Vec3f> right(bounced);
  for (std::size_t b = 0; b < bounced; ++b) right[b] = right_hand_side(points[b], keys[b]);
  const DeviceArray<Vec3f> device_answers(c.stream, std::span<const Vec3f>(answers), "selftest"),
      device_right(c.stream, std::span<const Vec3f>(right), "selftest");
  buffer.add(device_answers.data(), device_right.data());
  compare_samples(c.stream, buffer.samples(), radiance, first, ground.size, estimates);
  const TraceCounts counts = buffer.take_counts();
  estimates.add_counts(counts.rays, rays);
  estimates.add_counts(answers.size(), queries);
}

}  // namespace

CheckResult check_left_hand_sides(const Context& c) {
  constexpr int kSteps = 2;  // drawn together, then taken
  const std::size_t n = c.items(1 << 15, 1 << 10);
  const TransportGround ground(c);
  const LhsOptions options = lhs_options(c);
  const LhsSampler sampler(ground.use, options);
  DeviceLhs lhs(c.stream, ground.world(), options, sampler.views(), sampler.fresh_poses(), n, kSteps * n);
  DeviceArray<unsigned long long> step(c.stream, 1, "selftest");
  Errors errors;
  for (unsigned long long k = 0; k < kSteps; ++k) {
    const unsigned long long number = c.seed % 1000 * kSteps + k;
    std::vector<ShadingPoint> expected(n);
    sampler.sample(number, expected);
    step.upload(std::span<const unsigned long long>(&number, 1));
    if (k == 0) lhs.draw(step.data(), n, kSteps, true);
    lhs.take(step.data(), n, kSteps);
    const std::vector<ShadingPoint> got = fetch(c.stream, lhs.points(), n);
    HostPlanes host(c.stream, lhs.surface_points().data, lhs.surface_points().stride, kSurfacePointNumbers);
    const SurfacePointArray seen{host.planes().data, lhs.surface_points().stride};
    for (std::size_t i = 0; i < n; ++i) {
      const SurfacePoint a = seen.load(i), b = surface_point(expected[i]);
      const auto near = [&](float disparity) { return static_cast<double>(1.0f / (1.0f + disparity * ground.size)); };
      const float disparity = traced_disparity(ground.context, b, expected[i].surface.geometric_normal);
      errors.add(std::max(
          {distance(a.x, b.x) / static_cast<double>(ground.size), distance(a.wo, b.wo), distance(a.n, b.n),
           distance(a.albedo, b.albedo), std::fabs(static_cast<double>(a.alpha - b.alpha)),
           std::fabs(near(a.disparity) - near(disparity)),
           distance(got[i].surface.position, expected[i].surface.position) / static_cast<double>(ground.size),
           distance(got[i].wo, expected[i].wo), distance(got[i].ns, expected[i].ns), distance(got[i].s, expected[i].s),
           distance(got[i].surface.geometric_normal, expected[i].surface.geometric_normal)}));
    }
  }
  // Smooth and curved surfaces on a walk make more of a direction's rounding, vertex by vertex.
  const bool on_device = c.stream.on_device();
  CheckResult r =
      errors.result("error of positions, directions, materials", on_device ? 1e-3 : 1e-6, on_device ? 0.03 : 0.0);
  if (lhs.take_missing() != 0) {
    r.passed = false;
    r.error += "; points are missing";
  }
  return r;
}

CheckResult check_right_hand_sides(const Context& c) {
  const TransportGround ground(c);
  const std::size_t n = c.items(1 << 13, 1 << 8);
  Estimates estimates;
  compare_right_hand_sides(c, ground, n, {16, false, false, false, true}, estimates);
  compare_right_hand_sides(c, ground, n, {5, true, true, true, true}, estimates);
  compare_right_hand_sides(c, ground, n, {4, false, false, false, false}, estimates);
  return estimates.result(c, "relative error of right-hand sides", 2e-3, 0.01);
}

CheckResult check_first_hits(const Context& c) {
  using Bounce = FirstHitOptions::Bounce;
  const TransportGround ground(c);
  Estimates estimates;
  for (const Bounce bounce : {Bounce::none, Bounce::glossy, Bounce::all}) {
    FirstHitOptions options;
    options.follow_delta = bounce != Bounce::none;
    options.bounce = bounce;
    options.emission_inside = bounce == Bounce::glossy;
    options.max_chain = 6;
    compare_first_hits(c, ground, options, bounce == Bounce::glossy, estimates);
  }
  return estimates.result(c, "relative error of samples", 2e-3, 0.003);
}

CheckResult check_paths(const Context& c) { return compare_paths(c, 16); }
// All but the first vertices by one thread each.
CheckResult check_long_paths(const Context& c) { return compare_paths(c, 2); }

}  // namespace octrad::selftest
