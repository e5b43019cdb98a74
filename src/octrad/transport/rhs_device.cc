// Kernels and driver of DeviceRhs. Slot i * M + m belongs to direction m of point i.
#include "octrad/transport/rhs_device.h"

#include <algorithm>

#include "octrad/base/error.h"
#include "octrad/device/launch.h"
#include "octrad/transport/cast.h"
#include "octrad/transport/follow_math.h"
#include "octrad/transport/trace_offsets_device.h"

namespace octrad {
namespace rhs_kernels {

// State of a slot: contribution of emitter sampling 0..2, emission met by the BSDF ray 3..5, weight of the BSDF sample,
// later times the chain's throughput 6..8, its density 9 (negative for a delta lobe), emission included in the response
// 10..12, lobe of the query 13.
inline constexpr int kSlotNumbers = 14;
inline constexpr std::uint32_t kNoCell = 0xffffffffu;  // of a point that is not guided

struct Memory {
  TraceCounts* counts;
  FloatPlanes slots;
  std::uint32_t* query_of;  // of a slot: its query, or kNoQuery
  std::uint32_t* cells;     // of slots, where guides learn: GuideSample::cell
  FloatPlanes scales;       // likewise GuideSample::scale and alone
  std::uint32_t* places;    // of a slot with a query: the place of its ray in the ray queue
  RayPlanes rays;           // by place in the ray queue
  std::uint32_t* owners;    // slots
  Hit* hits;
  RayPlanes shadow_rays;  // by place in the shadow queue
  std::uint32_t* shadow_owners;
  std::uint32_t* chains;  // places in the ray queue
  SurfacePointArray queries;
  FloatPlanes normals;  // geometric, of the queries; only for traced disparity
  LobeStarts lobes;     // of the queries
  std::uint32_t* shadow_count;
  std::uint32_t* ray_count;
  std::uint32_t* chain_count;
  std::uint32_t* query_count;
};

// Both samples of a direction.
template <typename World>
struct Sample : Kernel {
  World world;
  Memory memory;
  DeviceRhsPoints points;
  DeviceRhsOptions options;
  OCTRAD_HD void operator()(std::uint32_t slot) const {
    const auto directions = static_cast<std::uint32_t>(options.directions);
    const std::uint32_t i = slot / directions, m = slot - i * directions;
    if (points.count && i >= *points.count) return;
    const ShadingPoint point = points.points[i];
    Rng rng = rhs_generator(options.seed, points.stream ? *points.stream : 0, rhs_key(points.keys, i));
    const Vec3f wo = point.to_local(point.wo);
    const SobolSet light_set(rng), bsdf_set(rng);
    const int table = guide_table<World::kModels>(options.guides, point, viewed_normal(point));
    const Guide guide = guide_of(options.guides, table);
    if (options.guides.rows != nullptr) {
      memory.cells[slot] = table < 0 ? kNoCell : static_cast<std::uint32_t>(table * kGuideParts);
      memory.scales.set(0, slot, 0.0f);
    }
    Vec3f light(0.0f);
    if (!is_delta_bsdf(point.bsdf)) {
      const EmitterSample emitter = sample_emitter(world, point, wo, light_set(m), guide);
      if (emitter.valid) {
        light = emitter.contribution;
        const std::uint32_t place = atomic_append(memory.shadow_count);
        memory.shadow_rays.store(place, emitter.ray);
        memory.shadow_owners[place] = slot;
      }
    }
    memory.slots.set3(0, slot, light);
    memory.slots.set3(3, slot, Vec3f(0.0f));
    memory.query_of[slot] = kNoQuery;
    const BounceSample bounce = sample_bounce<World::kModels>(point, wo, bsdf_set(m), guide);
    if (!bounce.valid) return;
    if (table >= 0 && !bounce.delta) {
      const GuideSample sample = guide_sample(table, bounce.direction, bounce.pdf, bounce.bsdf_pdf);
      memory.cells[slot] = static_cast<std::uint32_t>(sample.cell);
      memory.scales.set(0, slot, sample.scale);
      memory.scales.set(1, slot, sample.bsdf_scale);
    }
    memory.slots.set3(6, slot, bounce.weight);
    memory.slots.set(9, slot, bounce.delta ? -bounce.pdf : bounce.pdf);
    const Segment segment = first_segment(point.surface.position, &point.surface.geometric_normal, bounce.direction);
    const std::uint32_t place = atomic_append(memory.ray_count);
    memory.rays.store(place, {segment.origin, segment.direction, segment.t_max});
    memory.owners[place] = slot;
  }
};

struct Occlude : Kernel {
  DeviceWorld world;
  Memory memory;
  static constexpr bool kAny = true;
  OCTRAD_HD Bvh8View bvh() const { return world.bvh; }
  OCTRAD_HD std::uint32_t size() const { return *memory.shadow_count; }
  OCTRAD_HD void count() const { memory.counts->rays += size(); }
  OCTRAD_HD RayQuery ray(std::uint32_t q) const { return memory.shadow_rays.load(q); }
  OCTRAD_HD void met(std::uint32_t q, bool any) const {
    if (any) memory.slots.set3(0, memory.shadow_owners[q], Vec3f(0.0f));
  }
};

struct Extend : Kernel {
  DeviceWorld world;
  Memory memory;
  static constexpr bool kAny = false;
  OCTRAD_HD Bvh8View bvh() const { return world.bvh; }
  OCTRAD_HD std::uint32_t size() const { return *memory.ray_count; }
  OCTRAD_HD void count() const { memory.counts->rays += size(); }
  OCTRAD_HD RayQuery ray(std::uint32_t q) const { return memory.rays.load(q); }
  OCTRAD_HD void met(std::uint32_t q, const Hit& hit) const { memory.hits[q] = hit; }
};

// The BSDF ray of `slot`, which is at `place` in the ray queue, has ended: with `segment` and `hit`.
template <Models kModels>
OCTRAD_HD inline void finish(const Memory& memory, const DeviceRhsOptions& options, std::uint32_t slot,
                             std::uint32_t place, RayEnd& end, const Segment& segment, const Hit& hit, Rng& rng) {
  const Vec3f weight = memory.slots.get3(6, slot);
  const float pdf = memory.slots.get(9, slot);
  memory.slots.set3(3, slot, bounce_emission(weight, std::fabs(pdf), std::signbit(pdf), end));
  if (!end.surface || !options.ask) return;
  if (options.split_coats) ask_one_lobe(end, rng);
  const std::uint32_t q = atomic_append(memory.query_count);
  memory.queries.store(q, surface_point<kModels>(end.point));
  if (memory.normals.data) memory.normals.set3(0, q, end.point.surface.geometric_normal);
  memory.lobes.store(q, segment, hit, end.point.bsdf.lobe, rng);
  memory.slots.set(13, slot, static_cast<float>(end.point.bsdf.lobe));
  memory.query_of[slot] = q;
  memory.places[slot] = place;
  memory.slots.set3(6, slot, weight * end.throughput);
  if (options.emission_inside) memory.slots.set3(10, slot, end.own_emitted);
}

// The ray at a place of the queue, and its random numbers.
struct Bounce {
  std::uint32_t slot, point;
  Segment segment;
  Rng rng;
  RayEnd end;
  OCTRAD_HD Bounce(const Memory& memory, const DeviceRhsPoints& points, const DeviceRhsOptions& options,
                   std::uint32_t q)
      : slot(memory.owners[q]),
        point(slot / static_cast<std::uint32_t>(options.directions)),
        rng(rhs_chain_generator(options.seed, points.stream ? *points.stream : 0, rhs_key(points.keys, point),
                                slot - point * static_cast<std::uint32_t>(options.directions))) {
    const RayQuery ray = memory.rays.load(q);
    segment = first_segment(ray.origin, nullptr, ray.direction, ray.t_max);
  }
};

// What the bounces' rays hit; those that go on are left to the following kernels.
template <typename World>
struct Arrive : Kernel {
  World world;
  Memory memory;
  DeviceRhsPoints points;
  DeviceRhsOptions options;
  OCTRAD_HD void operator()(std::uint32_t q) const {
    if (q >= *memory.ray_count) return;
    Bounce ray(memory, points, options, q);
    const Vec3f position = points.points[ray.point].surface.position;
    const Hit hit = memory.hits[q];
    if (follow_hit(world, position, hit, ray.rng, options.follow_below, ray.segment, ray.end, nullptr)) {
      memory.chains[atomic_append(memory.chain_count)] = q;
      return;
    }
    finish<World::kModels>(memory, options, ray.slot, q, ray.end, ray.segment, hit, ray.rng);
  }
};

// What is left, each by a thread alone: through masks, over mirrors and glass.
template <typename World>
struct Rest : Kernel {
  static constexpr unsigned kMinBlocks = 2;  // few rays have a chain: registers for all of it
  World world;
  Memory memory;
  DeviceRhsPoints points;
  DeviceRhsOptions options;
  OCTRAD_HD void operator()(std::uint32_t k) const {
    if (k >= *memory.chain_count) return;
    const std::uint32_t q = memory.chains[k];
    Bounce ray(memory, points, options, q);
    const Vec3f position = points.points[ray.point].surface.position;
    Hit hit = memory.hits[q];
    follow_from(world, position, hit, ray.rng, options.follow_below, options.max_chain, ray.segment, ray.end);
    memory.hits[q] = hit;
    memory.rays.store(q, {ray.segment.origin, ray.segment.direction, ray.segment.t_max});
    atomic_add(&memory.counts->rays, static_cast<unsigned long long>(ray.end.rays - 1));
    finish<World::kModels>(memory, options, ray.slot, q, ray.end, ray.segment, hit, ray.rng);
  }
};

struct Reduce : Kernel {
  DeviceWorld world;
  Memory memory;
  DeviceRhsPoints points;
  DeviceRhsOptions options;
  const Vec3f* responses;
  Vec3f* targets;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    if (i == 0 && options.ask) memory.counts->queries += *memory.query_count;
    if (points.count && i >= *points.count) return;
    const float share = 1.0f / static_cast<float>(options.directions);
    const auto directions = static_cast<std::uint32_t>(options.directions);
    Vec3f target(0.0f);
    unsigned long long dropped = 0;
    const std::uint32_t from = i * directions, to = from + directions;
    for (std::uint32_t slot = from; slot < to; ++slot) {
      const Vec3f light = memory.slots.get3(0, slot), emission = memory.slots.get3(3, slot);
      if (is_finite(light)) target += light * share;
      else ++dropped;
      if (is_finite(emission)) target += emission * share;
      else ++dropped;
    }
    const auto most = static_cast<std::uint32_t>(points.most);
    const unsigned long long step = points.stream ? *points.stream : 0;
    const FarEndRange range = far_end_range(step, most, options.far_end_count);
    const std::uint32_t place = range.place(i, most);
    FarEndChoice choice(options.seed, step, i);
    FarEnd chosen;
    Vec3f sum(0.0f);
    for (std::uint32_t slot = from; options.ask && slot < to; ++slot) {
      const std::uint32_t q = memory.query_of[slot];
      if (q == kNoQuery) continue;
      const Vec3f counted = options.emission_inside ? memory.slots.get3(10, slot) : Vec3f(0.0f);
      const Vec3f contribution = cache_contribution(memory.slots.get3(6, slot), responses[q], counted);
      if (is_finite(contribution)) sum += contribution * share;
      else ++dropped;
      if (place < range.count && choice.take(contribution)) {
        const RayQuery ray = memory.rays.load(memory.places[slot]);
        chosen = {ray.origin, ray.direction, memory.hits[memory.places[slot]],
                  static_cast<Lobe>(static_cast<int>(memory.slots.get(13, slot)))};
      }
    }
    if (place < range.count) options.far_ends[place] = chosen;
    target += cache_sum(sum, options.emission_inside);
    if (options.ask && options.guides.rows != nullptr && memory.cells[from] != kNoCell) teach(from, to, target);
    if (options.own_emission && points.points[i].surface.emitter >= 0)
      target += world.emitted(points.points[i].surface, points.points[i].wo);
    targets[i] = target;
    if (dropped > 0) atomic_add(&memory.counts->non_finite, dropped);
  }
  OCTRAD_HD void teach(std::uint32_t from, std::uint32_t to, Vec3f target) const {
    add_to_guide(options.guides, static_cast<int>(memory.cells[from] / kGuideParts), options.directions, target);
    for (std::uint32_t slot = from; slot < to; ++slot) {
      GuideSample sample{static_cast<int>(memory.cells[slot]), memory.scales.get(0, slot), memory.scales.get(1, slot),
                         0.0f};
      if (sample.scale <= 0.0f) continue;
      sample.contribution = luminance(memory.slots.get3(3, slot));
      if (const std::uint32_t q = memory.query_of[slot]; q != kNoQuery) {
        const Vec3f counted = options.emission_inside ? memory.slots.get3(10, slot) : Vec3f(0.0f);
        sample.contribution += luminance(cache_contribution(memory.slots.get3(6, slot), responses[q], counted));
      }
      add_to_guide(options.guides, sample, target, *options.epsilon);
    }
  }
};

inline void check_slots(std::size_t points, int directions, std::size_t capacity) {
  if (directions < 1 || points > capacity / static_cast<std::size_t>(directions)) {
    throw UsageError("right-hand side of " + std::to_string(points) + " points with " + std::to_string(directions) +
                     " directions: memory was taken for " + std::to_string(capacity) + " samples");
  }
}

}  // namespace rhs_kernels

DeviceRhs::DeviceRhs(Stream& stream, const DeviceWorld& world, std::size_t slots, const QueryRays& rays, bool guided)
    : stream_(&stream),
      world_(world),
      capacity_(slots),
      query_rays_(rays),
      counts_(stream, 1, "counts of rays"),
      sizes_(stream, kSizes, "sizes of ray queues"),
      owners_(stream, slots, "rays"),
      shadow_owners_(stream, slots, "shadow rays"),
      chains_(stream, slots, "rays"),
      query_of_(stream, slots, "queries"),
      places_(stream, slots, "queries"),
      cells_(stream, guided ? slots : 0, "right-hand-side samples"),
      hits_(stream, slots, "hits"),
      rays_(stream, kRayNumbers, slots, "rays"),
      shadow_rays_(stream, kRayNumbers, slots, "shadow rays"),
      slots_(stream, rhs_kernels::kSlotNumbers, slots, "right-hand-side samples"),
      queries_(stream, surface_point_numbers(rays.offset), slots, "queries"),
      normals_(rays.offset.traced ? PlaneArray(stream, 3, slots, "queries") : PlaneArray()),
      guide_numbers_(guided ? PlaneArray(stream, 2, slots, "right-hand-side samples") : PlaneArray()),
      lobes_(stream, world, slots, rays, true) {
  counts_.fill(0);
}

std::size_t DeviceRhs::bytes(std::size_t slots, const QueryRays& rays, bool guided) {
  const std::size_t guide = guided ? sizeof(std::uint32_t) + 2 * sizeof(float) : 0;
  return slots * (guide + 5 * sizeof(std::uint32_t) + sizeof(Hit) +
                  static_cast<std::size_t>(2 * kRayNumbers + rhs_kernels::kSlotNumbers +
                                           surface_point_numbers(rays.offset) + (rays.offset.traced ? 3 : 0)) *
                      sizeof(float)) +
         DeviceLobes::bytes(slots, rays, true);
}

rhs_kernels::Memory DeviceRhs::memory() const {
  using namespace rhs_kernels;
  std::uint32_t* sizes = sizes_.data();
  return {counts_.data(),
          slots_.planes(),
          query_of_.data(),
          cells_.data(),
          guide_numbers_.planes(),
          places_.data(),
          rays_.rays(),
          owners_.data(),
          hits_.data(),
          shadow_rays_.rays(),
          shadow_owners_.data(),
          chains_.data(),
          queries_.points(query_rays_.offset),
          normals_.planes(),
          lobes_.starts(),
          sizes + kShadows,
          sizes + kRays,
          sizes + kChains,
          sizes + kQueries};
}

void DeviceRhs::trace(const DeviceRhsPoints& points, const DeviceRhsOptions& options) {
  using namespace rhs_kernels;
  check_slots(points.most, options.directions, capacity_);
  if (options.guides.rows != nullptr && cells_.empty())
    throw UsageError("right-hand side with a guide: no memory was taken for one");
  const std::size_t n = points.most * static_cast<std::size_t>(options.directions);
  const Memory memory = this->memory();
  sizes_.fill(0);
  with_world(world_, [&](const auto& world) {
    launch(*stream_, n, Sample<std::decay_t<decltype(world)>>{{}, world, memory, points, options});
  });
  stream_->mark("samples of directions");
  cast(*stream_, n, Occlude{{}, world_, memory}, sizes_.data() + kShadowsTaken);
  stream_->mark("occlusion rays");
  cast(*stream_, n, Extend{{}, world_, memory}, sizes_.data() + kRaysTaken);
  stream_->mark("closest-hit rays");
  with_world(world_, [&](const auto& world) {
    using World = std::decay_t<decltype(world)>;
    launch(*stream_, n, Arrive<World>{{}, world, memory, points, options});
    stream_->mark("hits");
    launch(*stream_, n, Rest<World>{{}, world, memory, points, options});
  });
  stream_->mark("chains");
  if (!options.ask) return;
  trace_offsets(*stream_, n, world_, query_rays_.offset, queries_.points(query_rays_.offset), normals_.planes(),
                query_count(), &counts_.data()->rays);
  lobes_.trace(queries_.points(query_rays_.offset), query_count(), n, counts_.data());
  stream_->mark("rays of queries");
}

void DeviceRhs::reduce(const DeviceRhsPoints& points, const DeviceRhsOptions& options, const Vec3f* responses,
                       Vec3f* targets) {
  using namespace rhs_kernels;
  check_slots(points.most, options.directions, capacity_);
  const Memory memory = this->memory();
  launch(*stream_, points.most, Reduce{{}, world_, memory, points, options, responses, targets});
  stream_->mark("targets");
}

TraceCounts DeviceRhs::take_counts() { return octrad::take_counts(counts_); }

}  // namespace octrad
