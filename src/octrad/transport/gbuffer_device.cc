// Kernels and driver of DeviceGBuffer.
#include "octrad/transport/gbuffer_device.h"

#include <algorithm>

#include "octrad/device/launch.h"
#include "octrad/transport/cast.h"
#include "octrad/transport/hide_emitters_device.h"
#include "octrad/transport/trace_offsets_device.h"

namespace octrad {
namespace gbuffer_kernels {

struct Memory {
  const CameraJob* job;
  TraceCounts* counts;
  SamplePlanes samples;
  Hit* hits;                // of samples
  std::uint32_t* chains;    // samples
  std::uint32_t* followed;  // samples
  SurfacePointArray queries;
  FloatPlanes query_weight;
  std::uint32_t* query_owner;  // samples
  FloatPlanes normals;         // geometric, of the queries; only for traced disparity
  LobeStarts lobes;            // of the queries
  OffsetRay offset;            // of the queries
  ShadingPoint* bounce_points;
  unsigned long long* bounce_keys;
  FloatPlanes bounce_weight;
  std::uint32_t* bounce_owner;
  std::uint32_t* chain_count;
  std::uint32_t* followed_count;
  std::uint32_t* query_count;
  std::uint32_t* bounce_count;
};

struct Extend : Kernel {
  DeviceWorld world;
  Memory memory;
  static constexpr bool kAny = false;
  OCTRAD_HD Bvh8View bvh() const { return world.bvh; }
  OCTRAD_HD std::uint32_t size() const { return memory.job->size(); }
  OCTRAD_HD void count() const { memory.counts->rays += size(); }
  OCTRAD_HD RayQuery ray(std::uint32_t k) const {
    const Ray ray = memory.job->sample(k).ray;
    return {ray.origin, ray.direction, ray.t_max};
  }
  OCTRAD_HD void met(std::uint32_t k, const Hit& hit) const { memory.hits[k] = hit; }
};

// In query_owner: this query and the one before it are of the same sample.
constexpr std::uint32_t kSecondLobe = std::uint32_t{1} << 31;

// Stores what is asked for sample `k`.
template <Models kModels>
struct Questions {
  const Memory& memory;
  std::uint32_t k;
  Rng& rng;
  std::uint32_t q = 0, owner = k;

  OCTRAD_HD void begin(int points) {
    if (points > 0)
      q = points > 1 ? atomic_add(memory.query_count, std::uint32_t{2}) : atomic_append(memory.query_count);
  }
  OCTRAD_HD void ask(const ShadingPoint& shading, Vec3f weight, const Segment& segment, const Hit& hit) {
    const SurfacePoint point = surface_point<kModels>(shading);
    memory.queries.store(q, point);
    if (draws_offset_direction(memory.offset, point))
      memory.queries.reflected.set_direction(
          q, draw_offset_direction(memory.offset, point, shading.surface.geometric_normal, rng));
    if (memory.normals.data) memory.normals.set3(0, q, shading.surface.geometric_normal);
    memory.lobes.store(q, segment, hit, shading.bsdf.lobe, rng);
    memory.query_weight.set3(0, q, weight);
    memory.query_owner[q++] = owner;
    owner = k | kSecondLobe;
  }
};

// The ray of sample `k` has ended, by `segment` and `hit`, and no lobe is followed.
template <Models kModels>
OCTRAD_HD inline void finish(const Memory& memory, const FirstHitOptions& options, bool hides_emitters, std::uint32_t k,
                             RayEnd& end, const FirstHit& first, const Segment& segment, const Hit& hit, Rng& rng) {
  const FirstHitQuery query = first_hit_query<kModels>(options, hides_emitters, end, first, rng);
  memory.samples.set_radiance(k, query.known);
  memory.samples.set_first(k, first);
  if (query.next == FirstHitQuery::Next::nothing) return;
  if (query.next == FirstHitQuery::Next::bounce) {
    const std::uint32_t b = atomic_append(memory.bounce_count);
    memory.bounce_points[b] = end.point;
    memory.bounce_keys[b] = query.key;
    memory.bounce_weight.set3(0, b, end.throughput);
    memory.bounce_owner[b] = k;
    return;
  }
  Questions<kModels> questions{memory, k, rng};
  const AskedLobes lobes = asked_lobes(options, end.point.bsdf);
  questions.begin(lobes.last - lobes.first + 1);
  for_each_asked_lobe(options, end.point, [&] { questions.ask(end.point, end.throughput, segment, hit); });
}

// Whether the field is asked for sample `k`, whose lobe is followed: FollowLobes does it.
template <Models kModels>
OCTRAD_HD inline bool takes_lobe(const Memory& memory, const FirstHitOptions& options, bool hides_emitters,
                                 std::uint32_t k, int number, const RayEnd& end, const FirstHit& first,
                                 const Rng& rng) {
  if (!end.surface || !follows_lobe<kModels>(options, end.point.bsdf, number)) return false;
  if (first_hit_query<kModels>(options, hides_emitters, end, first, rng).next != FirstHitQuery::Next::query)
    return false;
  memory.followed[atomic_append(memory.followed_count)] = k;
  return true;
}

// As rhs_kernels::Arrive.
template <bool kChain, typename World>
struct Arrive : Kernel {
  static constexpr unsigned kMinBlocks = kChain ? 2 : 0;  // few rays have a chain: registers for all of it
  World world;
  Memory memory;
  FirstHitOptions options;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    const CameraJob& job = *memory.job;
    if (i >= (kChain ? *memory.chain_count : job.size())) return;
    const std::uint32_t k = kChain ? memory.chains[i] : i;
    CameraSample sample = job.sample(k);
    Segment segment = first_segment(sample.ray.origin, nullptr, sample.ray.direction, sample.ray.t_max);
    RayEnd end;
    FirstHit first;
    Hit hit = memory.hits[k];
    if constexpr (kChain) {
      follow_from(world, sample.ray.origin, hit, sample.rng, options.follow_below, options.max_chain, segment, end,
                  &first);
      atomic_add(&memory.counts->rays, static_cast<unsigned long long>(end.rays - 1));
    } else {
      if (follow_hit(world, sample.ray.origin, hit, sample.rng, options.follow_below, segment, end, &first)) {
        memory.chains[atomic_append(memory.chain_count)] = k;
        return;
      }
    }
    const bool hides = world.hides_emitters();
    if (takes_lobe<World::kModels>(memory, options, hides, k, sample.number, end, first, sample.rng)) return;
    finish<World::kModels>(memory, options, hides, k, end, first, segment, hit, sample.rng);
  }
};

// Samples whose lobes are followed. A kernel of its own: it keeps two surfaces at a time.
template <typename World>
struct FollowLobes : Kernel {
  static constexpr unsigned kMinBlocks = 2;
  World world;
  Memory memory;
  FirstHitOptions options;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    if (i >= *memory.followed_count) return;
    const std::uint32_t k = memory.followed[i];
    CameraSample sample = memory.job->sample(k);
    Segment segment = first_segment(sample.ray.origin, nullptr, sample.ray.direction, sample.ray.t_max);
    RayEnd end;
    FirstHit first;
    Hit hit = memory.hits[k];
    follow_from(world, sample.ray.origin, hit, sample.rng, options.follow_below, options.max_chain, segment, end,
                &first);
    const int before = end.rays;
    Vec3f known = first_hit_query<World::kModels>(options, world.hides_emitters(), end, first, sample.rng).known;
    Questions<World::kModels> questions{memory, k, sample.rng};
    ask_behind_lobe(
        world, options, end, segment, hit, sample.rng, known, [&](int points) { questions.begin(points); },
        [&](const ShadingPoint& point, Vec3f weight, const Segment& last, const Hit& met) {
          questions.ask(point, weight, last, met);
        });
    memory.samples.set_radiance(k, known);
    memory.samples.set_first(k, first);
    atomic_add(&memory.counts->rays, static_cast<unsigned long long>(end.rays - before));
  }
};

// A sample has one query, two queries one after the other, or one bounce point.
struct Add : Kernel {
  SamplePlanes samples;
  FloatPlanes weight;
  const std::uint32_t* owner;
  const std::uint32_t* count;
  const Vec3f* values;
  unsigned long long* total;  // count is added to it; may be null
  OCTRAD_HD void operator()(std::uint32_t q) const {
    if (q >= *count) return;
    if (q == 0 && total) *total += *count;
    const std::uint32_t k = owner[q];
    if (k & kSecondLobe) return;
    Vec3f radiance = samples.radiance(k) + weight.get3(0, q) * values[q];
    if (q + 1 < *count && owner[q + 1] == (k | kSecondLobe)) radiance += weight.get3(0, q + 1) * values[q + 1];
    samples.set_radiance(k, radiance);
  }
};

}  // namespace gbuffer_kernels

DeviceGBuffer::DeviceGBuffer(Stream& stream, const DeviceWorld& world, std::size_t capacity, bool bounces,
                             const QueryRays& rays, bool split_coats)
    : stream_(&stream),
      world_(world),
      capacity_(capacity),
      query_rays_(rays),
      split_(split_coats),
      job_(stream, 1, "the camera"),
      counts_(stream, 1, "counts of rays"),
      sizes_(stream, kSizes, "sizes of queues"),
      chains_(stream, capacity, "camera rays"),
      followed_(stream, split_coats ? capacity : 0, "camera rays"),
      query_owner_(stream, queries_of(capacity), "queries"),
      bounce_owner_(stream, bounces ? capacity : 0, "right-hand-side points"),
      hits_(stream, capacity, "hits of camera rays"),
      bounce_points_(stream, bounces ? capacity : 0, "right-hand-side points"),
      bounce_keys_(stream, bounces ? capacity : 0, "right-hand-side points"),
      samples_(stream, kSampleNumbers, capacity, "samples"),
      queries_(stream, surface_point_numbers(rays.offset), queries_of(capacity), "queries"),
      query_weight_(stream, 3, queries_of(capacity), "queries"),
      bounce_weight_(bounces ? PlaneArray(stream, 3, capacity, "right-hand-side points") : PlaneArray()),
      normals_(rays.offset.traced ? PlaneArray(stream, 3, queries_of(capacity), "queries") : PlaneArray()),
      lobes_(stream, world, queries_of(capacity), rays, true) {
  counts_.fill(0);
}

std::size_t DeviceGBuffer::bytes(std::size_t capacity, bool bounces, const QueryRays& rays, bool split_coats) {
  const std::size_t queries = split_coats ? 2 * capacity : capacity,
                    query_numbers =
                        static_cast<std::size_t>(surface_point_numbers(rays.offset) + 3 + (rays.offset.traced ? 3 : 0)),
                    sample_numbers = static_cast<std::size_t>(kSampleNumbers + (bounces ? 3 : 0));
  return queries * (query_numbers * sizeof(float) + sizeof(std::uint32_t)) +
         capacity * (sample_numbers * sizeof(float) + sizeof(Hit) + (split_coats ? 2 : 1) * sizeof(std::uint32_t) +
                     (bounces ? sizeof(ShadingPoint) + sizeof(unsigned long long) + sizeof(std::uint32_t) : 0)) +
         DeviceLobes::bytes(queries, rays, true);
}

void DeviceGBuffer::set(const CameraJob& job) { job_.upload(std::span<const CameraJob>(&job, 1)); }

void DeviceGBuffer::run(const FirstHitOptions& options, std::size_t samples) {
  using namespace gbuffer_kernels;
  const std::size_t n = samples > 0 ? std::min(samples, capacity_) : capacity_;
  std::uint32_t* sizes = sizes_.data();
  const Memory memory{job_.data(),
                      counts_.data(),
                      {samples_.planes()},
                      hits_.data(),
                      chains_.data(),
                      followed_.data(),
                      queries_.points(query_rays_.offset),
                      query_weight_.planes(),
                      query_owner_.data(),
                      normals_.planes(),
                      lobes_.starts(),
                      query_rays_.offset,
                      bounce_points_.data(),
                      bounce_keys_.data(),
                      bounce_weight_.planes(),
                      bounce_owner_.data(),
                      sizes + kChains,
                      sizes + kFollowed,
                      sizes + kQueries,
                      sizes + kBounces};
  FirstHitOptions checked = options;
  if (bounce_points_.empty()) checked.bounce = FirstHitOptions::Bounce::none;
  checked.split_coats = options.split_coats && split_;
  const bool follows_lobes = checked.split_coats && (checked.coat_samples > 0.0f || checked.metal_samples > 0.0f);
  sizes_.fill(0);
  cast(*stream_, n, Extend{{}, world_, memory}, sizes + kTaken);
  hide_emitters(*stream_, n, world_, job_.data(), hits_.data(), &counts_.data()->rays);
  stream_->mark("first rays");
  with_world(world_, [&](const auto& world) {
    using World = std::decay_t<decltype(world)>;
    launch(*stream_, n, Arrive<false, World>{{}, world, memory, checked});
    launch(*stream_, n, Arrive<true, World>{{}, world, memory, checked});
    if (follows_lobes) launch(*stream_, n, FollowLobes<World>{{}, world, memory, checked});
  });
  trace_offsets(*stream_, queries_of(n), world_, query_rays_.offset, queries_.points(query_rays_.offset),
                normals_.planes(), query_count(), &counts_.data()->rays);
  lobes_.trace(queries_.points(query_rays_.offset), query_count(), queries_of(n), counts_.data());
  stream_->mark("first hits");
}

void DeviceGBuffer::add(const Vec3f* responses, const Vec3f* right_hand_sides, std::size_t samples) {
  using namespace gbuffer_kernels;
  const std::size_t n = samples > 0 ? std::min(samples, capacity_) : capacity_;
  std::uint32_t* sizes = sizes_.data();
  if (responses) {
    launch(*stream_, queries_of(n),
           Add{{},
               {samples_.planes()},
               query_weight_.planes(),
               query_owner_.data(),
               sizes + kQueries,
               responses,
               &counts_.data()->queries});
  }
  if (right_hand_sides) {
    launch(*stream_, n,
           Add{{},
               {samples_.planes()},
               bounce_weight_.planes(),
               bounce_owner_.data(),
               sizes + kBounces,
               right_hand_sides,
               nullptr});
  }
}

TraceCounts DeviceGBuffer::take_counts() { return octrad::take_counts(counts_); }

}  // namespace octrad
