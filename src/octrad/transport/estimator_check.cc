#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

#include "octrad/base/threads.h"
#include "octrad/transport/checks.h"
#include "octrad/transport/direction_guide_device.h"
#include "octrad/transport/gbuffer_device.h"
#include "octrad/transport/lhs_device.h"
#include "octrad/transport/lhs_sampler.h"
#include "octrad/transport/lobe_math.h"
#include "octrad/transport/lobes_device.h"
#include "octrad/transport/path.h"
#include "octrad/transport/path_device.h"
#include "octrad/transport/query_point.h"
#include "octrad/transport/rhs_device.h"
#include "octrad/transport/rhs_estimator.h"

namespace octrad {
namespace {

// 0 only for the same bits.
double unless_same(Vec3f a, Vec3f b, double error) {
  return std::memcmp(&a, &b, sizeof(a)) == 0 ? 0.0 : std::max(std::numeric_limits<double>::min(), error);
}
double distance(Vec3f a, Vec3f b, float unit = 1.0f) {
  return unless_same(a, b, static_cast<double>(length(a - b) / unit));
}
double distance(float a, float b) { return distance(Vec3f(a, 0.0f, 0.0f), Vec3f(b, 0.0f, 0.0f)); }

float size_of(const PreparedScene& scene) { return std::max(1e-20f, length(scene.scene().bounds.extent())); }

// What a cache might say of a point: smooth in all that it is given.
struct Cache {
  float size;
  Vec3f operator()(const SurfacePoint& p) const {
    const float d = p.disparity * size;
    float far = 0.0f;  // changes little where a ray joins another cluster
    for (const HitCluster& c : p.lobe) far += c.share * (c.distance + c.deviation) / size;
    far += 0.1f * luminance(p.reflected.albedo) * (1.0f + p.reflected.n.x) + 0.1f * p.reflected.w.x;
    return {0.5f + 0.4f * std::sin(6.0f * p.x.x / size + p.wo.y),
            0.5f + 0.4f * std::cos(4.0f * p.x.y / size + p.n.z) * p.albedo.y, 0.2f + p.alpha + d / (1.0f + d) + far};
  }
};

// Four tables in five draw parts by chance, a third of them never.
GuideState guide_of_chance(const LhsSampler& sampler, std::uint64_t seed) {
  GuideState guide = make_guide(guide_box(sampler), 1.0f);
  Rng rng(seed, RngPurpose::test, 1);
  for (int table = 0; table < kGuideTables; ++table) {
    if (rng.below(5) == 0) continue;
    guide.samples[static_cast<std::size_t>(table)] = 1u << 30;
    guide.targets[static_cast<std::size_t>(table)] = rng.below(1u << 30);
    guide.bsdf_squares[static_cast<std::size_t>(table)] = 1ull << 50;
    for (int part = 0; part < kGuideParts; ++part)
      guide.squares[static_cast<std::size_t>(table * kGuideParts + part)] =
          rng.below(3) == 0 ? 0 : rng.below(1u << 30) + 1ull;
  }
  make_guide_tables(guide.view(0.5f));
  return guide;
}

using Sums = std::vector<unsigned long long>;

// What a device that was taught twice has learnt since `before`, against what the CPU was taught once.
void compare_guides(const GuideState& found, const GuideState& taught, const GuideState& before, bool asked,
                    EstimateErrors& errors) {
  const auto learnt = [](const Sums& now, const Sums& then) {
    return std::reduce(now.begin(), now.end()) - std::reduce(then.begin(), then.end());
  };
  errors.add_counts(learnt(found.samples, before.samples), 2 * learnt(taught.samples, before.samples));
  const unsigned long long squares = learnt(taught.squares, before.squares);
  if (asked) errors.add(Vec3f(squares > 0 ? 1.0f : 0.0f), Vec3f(1.0f));
  const auto ratio = [&](Sums GuideState::*sums) {
    const auto wanted = static_cast<float>(learnt(taught.*sums, before.*sums)),
               twice = static_cast<float>(learnt(found.*sums, before.*sums));
    return wanted > 0.0f ? 0.5f * twice / wanted : 1.0f + twice;
  };
  errors.add(Vec3f(ratio(&GuideState::squares), ratio(&GuideState::targets), ratio(&GuideState::bsdf_squares)),
             Vec3f(1.0f));
  const float unit = std::max(1.0f, static_cast<float>(squares));
  for (std::size_t part = 0; part < kGuideParts; ++part) {  // summed over tables
    const auto of_part = [&](const Sums& now) {
      unsigned long long sum = 0;
      for (std::size_t cell = part; cell < now.size(); cell += kGuideParts) sum += now[cell] - before.squares[cell];
      return static_cast<float>(sum) / unit;
    };
    errors.add(Vec3f(0.5f * of_part(found.squares)), Vec3f(of_part(taught.squares)));
  }
}

// Share of points that rounding may lead to another place on their way, where `usual` is that of rooms. Curves magnify
// a ray's rounding at each of them: between 400 fibres it was 14 % of the points, of right-hand sides 10 % (an H200).
double allowed_share(const PreparedScene& scene, double usual) {
  const std::vector<TriangleMesh>& meshes = scene.scene().meshes;
  return std::any_of(meshes.begin(), meshes.end(), [](const TriangleMesh& m) { return m.one_sided; }) ? 0.25 : usual;
}

// `answer` of the queries in a stream's memory.
template <typename Answer>
std::vector<Vec3f> answers_to(Stream& stream, const SurfacePointArray& queries, const std::uint32_t* count,
                              const Answer& answer) {
  std::vector<Vec3f> answers;
  for (const SurfacePoint& p : download_points(stream, queries, fetch(stream, count, 1)[0]))
    answers.push_back(answer(p));
  return answers;
}

// Emission counts relative to its size, where that is above 1.
double difference(const ReflectedSurface& a, const ReflectedSurface& b) {
  const float brightest = std::max(1.0f, max_component(b.emitted));
  return std::max({distance(a.met, b.met), distance(a.alpha, b.alpha), distance(a.n, b.n), distance(a.albedo, b.albedo),
                   distance(a.emitted, b.emitted, brightest), distance(a.w, b.w)});
}

// What is traced from queries in a check.
QueryRays wanted_rays(bool traced_disparity, bool lobes) {
  QueryRays rays;
  rays.offset.traced = rays.offset.reflected = traced_disparity;
  rays.lobe = lobes ? 24 : 0;
  rays.lobe_below = 0.5f;
  rays.iterations = 5;
  return rays;
}

// A point from a device as the CPU shades it: tables that it points to are the CPU's own.
ShadingPoint on_cpu(const TransportContext& context, const ShadingPoint& point) {
  ShadingPoint own = context.shade(point.surface, point.wo);
  own.bsdf.opacity = point.bsdf.opacity;
  own.bsdf.lobe = point.bsdf.lobe;
  return own;
}

void compare_samples(Stream& stream, const SamplePlanes& found, std::span<const Vec3f> radiance,
                     std::span<const FirstHit> first, float size, EstimateErrors& errors) {
  std::vector<float> numbers = fetch(stream, found.data, found.stride * kSampleNumbers);
  const SamplePlanes planes{{numbers.data(), found.stride}};
  for (std::size_t k = 0; k < radiance.size(); ++k) {
    errors.add(planes.radiance(k), radiance[k]);
    errors.add(planes.get3(3, k), first[k].albedo);
    errors.add(planes.get3(6, k), first[k].normal);
    errors.add({planes.get(9, k) / size, planes.get(10, k), 0.0f}, {first[k].depth / size, first[k].roughness, 0.0f});
  }
}

}  // namespace

void EstimateErrors::add(Vec3f found, Vec3f expected) {
  constexpr float kSmall = 5e-3f;  // below which errors count as absolute
  errors_.add(unless_same(found, expected,
                          static_cast<double>(length(found - expected) / (length(found) + length(expected) + kSmall))));
  const double a = static_cast<double>(luminance(found)), b = static_cast<double>(luminance(expected));
  ++items_;
  sum_ += a - b;
  square_ += (a - b) * (a - b);
  size_ += std::fabs(b);
}

CheckResult EstimateErrors::result(const Stream& stream, std::string what, double tolerance, double allowed_share) {
  const double chance = 5.0 * std::sqrt(allowed_share / static_cast<double>(std::max<std::size_t>(items_, 1)));
  CheckResult r = errors_.exact_on_host(stream, std::move(what), tolerance, allowed_share + chance);
  // Items that went their own way differ at random: their mean by 5 of its standard errors, seldom more.
  r.require(std::fabs(sum_) <= 5.0 * std::sqrt(square_) + 1e-3 * size_, "their means differ");
  for (const auto& [found, expected] : counts_) {
    const double off = std::fabs(static_cast<double>(found) - static_cast<double>(expected));
    r.require(off <= (stream.on_device() ? 3.0 + 0.01 * static_cast<double>(expected) : 0.0),
              "counted " + std::to_string(found) + " instead of " + std::to_string(expected));
  }
  return r;
}

CheckResult check_left_hand_sides(Stream& stream, const PreparedScene& scene, const LhsOptions& options, std::size_t n,
                                  unsigned long long first, int group, int rounds) {
  const float size = size_of(scene);
  const TransportContext context = scene.context();
  const LhsSampler sampler(scene, options);
  OffsetRay offset;
  offset.traced = offset.reflected = true;
  DeviceLhs lhs(stream, scene.world(stream), options, sampler.views(), sampler.fresh_poses(), n,
                n * static_cast<std::size_t>(group), rounds, nullptr, offset);
  DeviceArray<unsigned long long> step(stream, std::span<const unsigned long long>(&first, 1), "check");
  const auto steps = static_cast<unsigned long long>(group);
  // Another one for every second group.
  const auto by_area = [&](unsigned long long s) { return s / steps % 2 == 0 ? 1.0 : 0.4; };
  const double share = by_area(first);
  DeviceArray<double> by_area_of_group(stream, std::span<const double>(&share, 1), "check");
  // Once as they are: a device loads kernels when they are first launched, which must not be recorded.
  lhs.draw(step.data(), n, group, 0, by_area_of_group.data());
  lhs.take(step.data(), n, group);
  lhs.take_missing();
  const auto draw = stream.capture([&] { lhs.draw(step.data(), n, group, 0, by_area_of_group.data()); }),
             take = stream.capture([&] { lhs.take(step.data(), n, group); });
  CheckErrors errors;
  for (unsigned long long s = first; s <= first + steps; ++s) {
    std::vector<ShadingPoint> expected(n);
    const double left = by_area(s);
    sampler.sample(s, expected, {}, left);
    step.upload(std::span<const unsigned long long>(&s, 1));
    by_area_of_group.upload(std::span<const double>(&left, 1));
    if (s == first || s % steps == 0) stream.replay(*draw);
    stream.replay(*take);
    const std::vector<ShadingPoint> found = fetch(stream, lhs.points(), n);
    const std::vector<SurfacePoint> surface_points = download_points(stream, lhs.surface_points(), n);
    for (std::size_t i = 0; i < n; ++i) {
      const ShadingPoint &a = found[i], &b = expected[i];
      const SurfacePoint &p = surface_points[i], q = field_query_point(context, b, offset);
      const auto near = [&](float disparity) { return 1.0f / (1.0f + disparity * size); };
      errors.add(
          std::max({distance(p.x, q.x, size), distance(p.wo, q.wo), distance(p.n, q.n), distance(p.albedo, q.albedo),
                    distance(p.alpha, q.alpha), distance(near(p.disparity), near(q.disparity)),
                    difference(p.reflected, q.reflected), distance(a.surface.position, b.surface.position, size),
                    distance(a.surface.geometric_normal, b.surface.geometric_normal), distance(a.wo, b.wo),
                    distance(a.ns, b.ns), distance(a.s, b.s), distance(a.bsdf.reflectance, b.bsdf.reflectance),
                    distance(a.bsdf.alpha_u, b.bsdf.alpha_u), distance(a.bsdf.opacity, b.bsdf.opacity),
                    a.surface.shape == b.surface.shape ? 0.0 : 1.0}));
    }
  }
  // Smooth and curved surfaces on a walk make more of a direction's rounding, vertex by vertex.
  CheckResult r =
      errors.exact_on_host(stream, "error of positions, directions, materials", 1e-3, allowed_share(scene, 0.03));
  r.require(lhs.take_missing() == 0, "points are missing");
  return r;
}

CheckResult check_lobes(Stream& stream, const PreparedScene& scene, std::size_t n, const QueryRays& rays,
                        std::uint64_t seed) {
  const float size = size_of(scene);
  const TransportContext context = scene.context();
  LhsOptions draw;
  draw.glossy_boost = 4.0;
  draw.seed = seed;
  const LhsSampler sampler(scene, draw);
  const unsigned long long number = seed % 1000;
  const DeviceArray<unsigned long long> step(stream, std::span(&number, 1), "check");
  DeviceLhs lhs(stream, scene.world(stream), draw, sampler.views(), sampler.fresh_poses(), n);
  DeviceLobes lobes(stream, scene.world(stream), n, rays, false,
                    n * static_cast<std::size_t>(rays.lobe) / 3);  // in turns
  lhs.run(step.data(), n);
  SurfacePointArray points = lhs.surface_points();
  points.lobe = lobes.clusters();
  lobes.trace(points, lhs.points(), seed, step.data(), n);
  const auto trace = stream.capture([&] { lobes.trace(points, lhs.points(), seed, step.data(), n); });
  EstimateErrors errors;
  std::size_t glossy = 0, met = 0;
  for (int again = 0; again < 2; ++again) {  // nothing is left over from the first time
    stream.replay(*trace);
    const std::vector<ShadingPoint> shading = fetch(stream, lhs.points(), n);
    const std::vector<SurfacePoint> found = download_points(stream, points, n);
    for (std::size_t i = 0; i < n; ++i) {
      const ShadingPoint point = on_cpu(context, shading[i]);
      Rng rng = lobe_generator(seed, number, i);
      const SurfacePoint expected = field_query_point(context, point, rays, rng);
      glossy += rays.lobe_rays(expected.alpha) > 0;
      for (int k = 0; k < kHitClusters; ++k) {
        const HitCluster &a = found[i].lobe[k], &b = expected.lobe[k];
        errors.add({a.distance / size, a.deviation / size, a.share}, {b.distance / size, b.deviation / size, b.share});
        met += b.share > 0.0f;
      }
    }
  }
  // A ray may meet something else, or join another cluster.
  CheckResult r = errors.result(stream, "relative error of clusters", 1e-3, 0.03);
  r.require(glossy > 0 && met > glossy, "no clusters to compare");
  return r;
}

CheckResult check_right_hand_sides(Stream& stream, const PreparedScene& scene, std::span<const RhsCase> cases,
                                   std::size_t n, std::uint64_t seed) {
  const TransportContext context = scene.context();
  LhsOptions draw;
  draw.walks = 0.5;
  draw.seed = seed;
  const LhsSampler sampler(scene, draw);
  const unsigned long long number = seed % 1000;
  const DeviceArray<unsigned long long> step(stream, std::span(&number, 1), "check");
  DeviceLhs lhs(stream, scene.world(stream), draw, sampler.views(), sampler.fresh_poses(), n);
  lhs.run(step.data(), n);
  std::vector<ShadingPoint> points;
  for (const ShadingPoint& p : fetch(stream, lhs.points(), n)) points.push_back(on_cpu(context, p));
  std::vector<unsigned long long> keys;
  for (std::size_t i = 0; i < n; ++i) keys.push_back(mix64(seed + i));
  const DeviceArray<unsigned long long> device_keys(stream, std::span<const unsigned long long>(keys), "check");
  const auto answer = [cache = Cache{size_of(scene)}](const SurfacePoint& p) {
    const float place = 1000.0f * p.x.x / cache.size;
    return place - std::floor(place) < 0.01f ? Vec3f(std::nanf("")) : cache(p);
  };
  const RadianceQuery query = [&](std::span<const SurfacePoint> asked, std::span<Vec3f> out) {
    for (std::size_t i = 0; i < asked.size(); ++i) out[i] = answer(asked[i]);
  };

  const GuideState guide = guide_of_chance(sampler, seed);
  EstimateErrors errors;
  for (const RhsCase& c : cases) {
    RhsOptions options;
    DeviceRhsOptions device_options;
    options.directions = c.directions;
    options.max_chain = 6;
    options.follow_below = device_options.follow_below = c.follow_below;
    options.split_coats = device_options.split_coats = c.split_coats;
    options.emission_inside = c.emission_inside;
    options.rays = wanted_rays(c.traced_disparity, c.lobes);
    options.seed = seed;
    options.stream = number;
    if (c.keys) options.keys = keys;
    GuideState taught = guide;
    const DeviceGuide device_guide(stream, guide, 0.5f);
    const float epsilon = 0.1f;
    const DeviceArray<float> device_epsilon(stream, std::span(&epsilon, 1), "check");
    if (c.guided) {
      options.guides = taught.view(0.5f);
      options.learn_guides = true;
      options.epsilon = epsilon;
      device_options.guides = device_guide.view();
      device_options.epsilon = device_epsilon.data();
    }
    std::vector<Vec3f> expected(n);
    const TraceCounts expected_counts =
        estimate_rhs(context, points, options, c.ask ? query : RadianceQuery(), expected);
    for (std::size_t i = 0; i < n && c.emission_inside; ++i) {
      if (points[i].surface.emitter >= 0) expected[i] += context.emitted(points[i].surface, points[i].wo);
    }

    device_options.directions = c.directions;
    device_options.max_chain = options.max_chain;
    device_options.emission_inside = device_options.own_emission = c.emission_inside;
    device_options.ask = c.ask;
    device_options.seed = seed;
    DeviceRhsPoints device_points;
    device_points.points = lhs.points();
    device_points.most = n;
    device_points.stream = step.data();
    device_points.keys = c.keys ? device_keys.data() : nullptr;
    DeviceRhs rhs(stream, scene.world(stream), n * static_cast<std::size_t>(c.directions), options.rays, c.guided);
    rhs.trace(device_points, device_options);
    rhs.take_counts();
    const auto trace = stream.capture([&] { rhs.trace(device_points, device_options); });
    DeviceArray<Vec3f> answers(stream, rhs.capacity(), "check");
    const DeviceArray<Vec3f> targets(stream, n, "check");
    for (int again = 0; again < 2; ++again) {  // nothing is left over from the first time
      stream.replay(*trace);
      const std::vector<Vec3f> values = answers_to(stream, rhs.queries(), rhs.query_count(), answer);
      answers.upload(values);
      rhs.reduce(device_points, device_options, answers.data(), targets.data());
      const std::vector<Vec3f> found = targets.download();
      for (std::size_t i = 0; i < n; ++i) errors.add(found[i], expected[i]);
      const TraceCounts counts = rhs.take_counts();
      errors.add_counts(counts.rays, expected_counts.rays);
      errors.add_counts(counts.queries, expected_counts.queries);
      errors.add_counts(values.size(), expected_counts.queries);
      errors.add_counts(counts.non_finite, expected_counts.non_finite);
    }
    if (c.guided) compare_guides(device_guide.download(), taught, guide, c.ask, errors);
  }
  return errors.result(stream, "relative error of right-hand sides", 2e-3, allowed_share(scene, 0.01));
}

CheckResult check_first_hits(Stream& stream, const PreparedScene& scene, const CameraJob& job,
                             std::span<const FirstHitCase> cases) {
  const float size = size_of(scene);
  const TransportContext context = scene.context();
  const Cache cache{size};
  const auto right_hand_side = [&](const ShadingPoint& p, unsigned long long key) {
    return Vec3f(p.surface.position.y / size, p.wo.z, static_cast<float>(key % 1000) * 1e-3f);
  };
  EstimateErrors errors;
  long long directions = 0, expect_directions = 0;  // of rays to what is reflected
  long long coats = 0, expect_coats = 0;            // that are followed
  long long metals = 0, expect_metals = 0;          // and other lobes
  for (const FirstHitCase& one : cases) {
    const FirstHitOptions& options = one.options;
    QueryRays rays = wanted_rays(one.traced_disparity, one.lobes);
    rays.offset.spread = 0.6f;
    std::vector<Vec3f> radiance(job.size());
    std::vector<FirstHit> first(job.size());
    std::vector<TraceCounts> of(job.size());
    std::vector<unsigned char> bounces(job.size()), drawn(job.size()), coat(job.size()), metal(job.size());
    parallel_for(job.size(), [&](std::size_t k) {
      CameraSample sample = job.sample(static_cast<std::uint32_t>(k));
      RayEnd end;
      const FirstHitQuery query = trace_first_hit(context, options, sample, end, first[k]);
      radiance[k] = query.known;
      if (query.next == FirstHitQuery::Next::bounce) {
        radiance[k] += end.throughput * right_hand_side(end.point, query.key);
        bounces[k] = 1;
      } else if (query.next == FirstHitQuery::Next::query) {
        const auto ask = [&](const ShadingPoint& point, Vec3f weight, const Segment&, const Hit&) {
          const SurfacePoint asked = field_query_point(context, point, rays, sample.rng);
          radiance[k] += weight * cache(asked);
          drawn[k] += asked.reflected.w != Vec3f(0.0f);
          of[k].rays += static_cast<unsigned long long>(rays.count(asked.alpha));
          ++of[k].queries;
        };
        if (follows_lobe(options, end.point.bsdf, sample.number)) (is_coated(end.point.bsdf) ? coat : metal)[k] = 1;
        for_each_asked_point(
            context, options, sample.number, end, {}, {}, sample.rng, radiance[k], [](int) {}, ask);
      }
      of[k].rays += static_cast<unsigned long long>(end.rays);
    });
    coats += std::accumulate(coat.begin(), coat.end(), 0);
    metals += std::accumulate(metal.begin(), metal.end(), 0);
    expect_coats += options.coat_samples > 0.0f && options.bounce == FirstHitOptions::Bounce::none;
    expect_metals += options.metal_samples > 0.0f && options.bounce == FirstHitOptions::Bounce::none;
    directions += std::accumulate(drawn.begin(), drawn.end(), 0);
    expect_directions += one.traced_disparity && options.bounce == FirstHitOptions::Bounce::none;
    TraceCounts expected;
    for (const TraceCounts& t : of) {
      expected += t;
    }

    DeviceGBuffer buffer(stream, scene.world(stream), job.size() + 100, options.bounce != FirstHitOptions::Bounce::none,
                         rays, options.split_coats);
    buffer.set(job);
    buffer.run(options);
    buffer.take_counts();
    const auto run = stream.capture([&] { buffer.run(options); });
    for (int again = 0; again < 2; ++again) {
      stream.replay(*run);
      const std::vector<Vec3f> answers = answers_to(stream, buffer.queries(), buffer.query_count(), cache);
      std::vector<Vec3f> right(fetch(stream, buffer.bounce_count(), 1)[0]);
      const auto points = fetch(stream, buffer.bounce_points(), right.size());
      const auto keys = fetch(stream, buffer.bounce_keys(), right.size());
      for (std::size_t b = 0; b < right.size(); ++b) right[b] = right_hand_side(points[b], keys[b]);
      const DeviceArray<Vec3f> device_answers(stream, std::span<const Vec3f>(answers), "check"),
          device_right(stream, std::span<const Vec3f>(right), "check");
      buffer.add(device_answers.data(), device_right.data());
      compare_samples(stream, buffer.samples(), radiance, first, size, errors);
      const TraceCounts counts = buffer.take_counts();
      errors.add_counts(counts.rays, expected.rays);
      errors.add_counts(counts.queries, expected.queries);
      errors.add_counts(answers.size(), expected.queries);
      errors.add_counts(right.size(),
                        static_cast<unsigned long long>(std::accumulate(bounces.begin(), bounces.end(), 0)));
    }
  }
  CheckResult r = errors.result(stream, "relative error of samples", 2e-3, 0.003);
  r.require(directions >= 20 * expect_directions, "few directions to what is reflected");
  r.require(coats >= 20 * expect_coats, "few coats that are followed");
  r.require(metals >= 20 * expect_metals, "few metals that are followed");
  return r;
}

CheckResult check_paths(Stream& stream, const PreparedScene& scene, std::span<const CameraJob> jobs,
                        std::span<const PathLimits> limits, int wave_bounces) {
  const TransportContext context = scene.context();
  std::size_t most = 0;
  for (const CameraJob& job : jobs) most = std::max<std::size_t>(most, job.size());
  DevicePathTracer tracer(stream, scene.world(stream), most + 100, wave_bounces);
  EstimateErrors errors;
  for (const PathLimits& l : limits) {
    tracer.set(jobs[0]);
    tracer.run(l, most);
    tracer.take_rays();
    const auto run = stream.capture([&] { tracer.run(l, most); });
    for (const CameraJob& job : jobs) {
      std::vector<PathSample> paths;
      for (std::uint32_t k = 0; k < job.size(); ++k) {
        const CameraSample s = job.sample(k);
        paths.push_back({s.ray, s.rng, {}, {}});
      }
      std::vector<PathCounters> counters((paths.size() + 255) / 256);
      parallel_blocks(paths.size(), 256, [&](std::size_t begin, std::size_t end) {
        trace_paths(context, l, std::span(paths).subspan(begin, end - begin), counters[begin / 256]);
      });
      tracer.set(job);
      stream.replay(*run);
      std::vector<Vec3f> radiance;
      std::vector<FirstHit> first;
      for (const PathSample& p : paths) {
        radiance.push_back(p.radiance);
        first.push_back(p.first);
      }
      unsigned long long rays = 0;
      for (const PathCounters& p : counters) rays += static_cast<unsigned long long>(p.rays);
      compare_samples(stream, tracer.samples(), radiance, first, size_of(scene), errors);
      errors.add_counts(tracer.take_rays(), rays);
    }
  }
  return errors.result(stream, "relative error of samples", 2e-3, 0.005);
}

CameraJob camera_job(const PreparedScene& scene, int width, int height, int count, std::uint64_t seed) {
  CameraJob job;
  job.view = scene.scene().cameras.front().view(width, height);
  job.seed = seed;
  job.width = width;
  job.height = height;
  job.count = count;
  return job;
}

}  // namespace octrad
