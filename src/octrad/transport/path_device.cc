// Kernels and driver of DevicePathTracer. A path is identified by the index of its sample; queues
// hold such indices.
#include "octrad/transport/path_device.h"

#include <algorithm>

#include "octrad/device/launch.h"
#include "octrad/transport/cast.h"
#include "octrad/transport/hide_emitters_device.h"

namespace octrad {
namespace path_kernels {

// PathState but for the depth, which all paths of a bounce share: origin 0..2, direction 3..5, vertex 6..8,
// throughput 9..11, t_max 12, eta 13, previous_pdf 14 (negative after a delta lobe), passed 15.
inline constexpr int kStateNumbers = 16;

struct StatePlanes : FloatPlanes {
  OCTRAD_HD PathState load(std::size_t i, int depth) const {
    PathState s;
    s.origin = get3(0, i);
    s.direction = get3(3, i);
    s.vertex = get3(6, i);
    s.throughput = get3(9, i);
    s.t_max = get(12, i);
    s.eta = get(13, i);
    const float pdf = get(14, i);
    s.previous_pdf = std::fabs(pdf);
    s.previous_delta = std::signbit(pdf);
    s.passed = get(15, i);
    s.depth = depth;
    return s;
  }
  OCTRAD_HD void store(std::size_t i, const PathState& s) const {
    set3(0, i, s.origin);
    set3(3, i, s.direction);
    set3(6, i, s.vertex);
    set3(9, i, s.throughput);
    set(12, i, s.t_max);
    set(13, i, s.eta);
    set(14, i, s.previous_delta ? -s.previous_pdf : s.previous_pdf);
    set(15, i, s.passed);
  }
};

// State of all paths.
struct Memory {
  const CameraJob* job;
  TraceCounts* counts;
  StatePlanes state;
  SamplePlanes samples;
  Rng* generators;
  std::uint32_t* valid;   // FirstHit::valid
  Hit* hits;              // by place in the queue
  RayPlanes shadow_rays;  // by place in the shadow queue
  FloatPlanes shadow_light;
  std::uint32_t* shadow_owner;
};

// The camera's rays.
struct Start : Kernel {
  Memory memory;
  std::uint32_t* queue;
  std::uint32_t* count;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    const CameraJob& job = *memory.job;
    const std::uint32_t n = job.size();
    if (i == 0) *count = n;
    if (i >= n) return;
    const CameraSample sample = job.sample(i);
    PathState state;
    state.origin = sample.ray.origin;
    state.direction = sample.ray.direction;
    state.t_max = sample.ray.t_max;
    memory.state.store(i, state);
    memory.generators[i] = sample.rng;
    memory.valid[i] = 0;
    memory.samples.set_radiance(i, Vec3f(0.0f));
    memory.samples.set_first(i, FirstHit{});
    queue[i] = i;
  }
};

struct Extend : Kernel {
  DeviceWorld world;
  Memory memory;
  const std::uint32_t* queue;
  const std::uint32_t* alive;
  static constexpr bool kAny = false;
  OCTRAD_HD Bvh8View bvh() const { return world.bvh; }
  OCTRAD_HD std::uint32_t size() const { return *alive; }
  OCTRAD_HD void count() const { memory.counts->rays += size(); }
  OCTRAD_HD RayQuery ray(std::uint32_t q) const {
    const std::uint32_t i = queue[q];
    return {memory.state.get3(0, i), memory.state.get3(3, i), memory.state.get(12, i)};
  }
  OCTRAD_HD void met(std::uint32_t q, const Hit& hit) const { memory.hits[q] = hit; }
};

// Puts a connection into the shadow queue.
struct QueueConnection {
  Memory memory;
  std::uint32_t* count;
  std::uint32_t path;
  OCTRAD_HD void operator()(const RayQuery& ray, Vec3f contribution) const {
    const std::uint32_t place = atomic_append(count);
    memory.shadow_rays.store(place, ray);
    memory.shadow_light.set3(0, place, contribution);
    memory.shadow_owner[place] = path;
  }
};

template <typename World>
struct Scatter : Kernel {
  static constexpr unsigned kMinBlocks = 3;  // 168 registers: in a plain world nothing spills
  World world;
  Memory memory;
  PathLimits limits;
  int depth;
  const std::uint32_t* queue;
  const std::uint32_t* count;
  std::uint32_t* next_queue;
  std::uint32_t* next_count;
  std::uint32_t* shadow_count;
  OCTRAD_HD void operator()(std::uint32_t q) const {
    if (q >= *count) return;
    const std::uint32_t i = queue[q];
    const Hit hit = memory.hits[q];
    PathState state = memory.state.load(i, depth);
    Vec3f radiance = memory.samples.radiance(i);
    const bool environment = world.has_environment();
    if (!hit.valid()) {
      if (environment) memory.samples.set_radiance(i, radiance + path_escape(world, state, memory.valid[i] != 0));
      return;
    }
    Rng rng = memory.generators[i];
    LightNumbers numbers{};
    if (environment) numbers = draw_light_numbers(rng);
    FirstHit first;
    const bool known = memory.valid[i] != 0;
    first.valid = known;
    const SurfaceInteraction surface = world.interact(hit, state.origin, state.direction);
    const auto sample_light = [&](Vec3f x, Rng& r) { return sample_light_of_path(world, numbers, x, r); };
    const bool goes_on = path_scatter(world, limits, surface, hit.t, sample_light, state, rng, radiance, first,
                                      QueueConnection{memory, shadow_count, i});
    memory.samples.set_radiance(i, radiance);
    if (!known && first.valid) {
      memory.samples.set_first(i, first);
      memory.valid[i] = 1;
    }
    if (!goes_on) return;
    memory.state.store(i, state);
    memory.generators[i] = rng;
    next_queue[atomic_append(next_count)] = i;
  }
};

struct Connect : Kernel {
  DeviceWorld world;
  Memory memory;
  const std::uint32_t* shadow_count;
  static constexpr bool kAny = true;
  OCTRAD_HD Bvh8View bvh() const { return world.bvh; }
  OCTRAD_HD std::uint32_t size() const { return *shadow_count; }
  OCTRAD_HD void count() const { memory.counts->rays += size(); }
  OCTRAD_HD RayQuery ray(std::uint32_t c) const { return memory.shadow_rays.load(c); }
  OCTRAD_HD void met(std::uint32_t c, bool any) const {
    if (any) return;
    const std::uint32_t i = memory.shadow_owner[c];  // a path has at most one connection in the queue
    memory.samples.set_radiance(i, memory.samples.radiance(i) + memory.shadow_light.get3(0, c));
  }
};

// Keeps the connection in registers.
struct KeepConnection {
  Connection* connection;
  bool* any;
  OCTRAD_HD void operator()(const RayQuery& ray, Vec3f contribution) const {
    connection->ray = ray;
    connection->contribution = contribution;
    *any = true;
  }
};

// The rest of the paths that are longer than the bounces of the wavefront.
template <typename World>
struct Finish : Kernel {
  static constexpr unsigned kMinBlocks = 3;
  World world;
  Memory memory;
  PathLimits limits;
  int depth;
  const std::uint32_t* queue;
  const std::uint32_t* count;
  OCTRAD_HD void operator()(std::uint32_t q) const {
    if (q >= *count) return;
    const std::uint32_t i = queue[q];
    PathState state = memory.state.load(i, depth);
    Rng rng = memory.generators[i];
    Vec3f radiance = memory.samples.radiance(i);
    FirstHit first;
    const bool known = memory.valid[i] != 0;
    first.valid = known;
    const bool environment = world.has_environment();
    unsigned long long rays = 0;
    for (bool goes_on = true; goes_on;) {
      const Hit hit = world.intersect(state.origin, state.direction, 0.0f, state.t_max);
      ++rays;
      if (!hit.valid()) {
        if (environment) radiance += path_escape(world, state, first.valid);
        break;
      }
      LightNumbers numbers{};
      if (environment) numbers = draw_light_numbers(rng);
      const SurfaceInteraction surface = world.interact(hit, state.origin, state.direction);
      Connection connection;
      bool any = false;
      const auto sample_light = [&](Vec3f x, Rng& r) { return sample_light_of_path(world, numbers, x, r); };
      goes_on = path_scatter(world, limits, surface, hit.t, sample_light, state, rng, radiance, first,
                             KeepConnection{&connection, &any});
      if (!any) continue;
      ++rays;
      if (!world.occluded(connection.ray.origin, connection.ray.direction, 0.0f, connection.ray.t_max))
        radiance += connection.contribution;
    }
    memory.samples.set_radiance(i, radiance);
    if (!known && first.valid) memory.samples.set_first(i, first);
    atomic_add(&memory.counts->rays, rays);
  }
};

}  // namespace path_kernels

DevicePathTracer::DevicePathTracer(Stream& stream, const DeviceWorld& world, std::size_t capacity, int wave_bounces)
    : stream_(&stream),
      world_(world),
      capacity_(capacity),
      wave_bounces_(std::max(1, wave_bounces)),
      job_(stream, 1, "the camera"),
      counts_(stream, 1, "counts of rays"),
      sizes_(stream, 4 * static_cast<std::size_t>(wave_bounces_) + 1, "sizes of path queues"),
      queue_{DeviceArray<std::uint32_t>(stream, capacity, "paths"),
             DeviceArray<std::uint32_t>(stream, capacity, "paths")},
      valid_(stream, capacity, "paths"),
      shadow_owner_(stream, capacity, "shadow rays"),
      generators_(stream, capacity, "random numbers of paths"),
      hits_(stream, capacity, "hits of paths"),
      state_(stream, path_kernels::kStateNumbers, capacity, "paths"),
      samples_(stream, kSampleNumbers, capacity, "samples"),
      shadow_rays_(stream, kRayNumbers, capacity, "shadow rays"),
      shadow_light_(stream, 3, capacity, "shadow rays") {
  counts_.fill(0);
}

std::size_t DevicePathTracer::bytes(std::size_t capacity) {
  return capacity *
         (4 * sizeof(std::uint32_t) + sizeof(Rng) + sizeof(Hit) +
          static_cast<std::size_t>(path_kernels::kStateNumbers + kSampleNumbers + kRayNumbers + 3) * sizeof(float));
}

void DevicePathTracer::set(const CameraJob& job) { job_.upload(std::span<const CameraJob>(&job, 1)); }

void DevicePathTracer::run(const PathLimits& limits, std::size_t samples) {
  using namespace path_kernels;
  const std::size_t n = samples > 0 ? std::min(samples, capacity_) : capacity_;
  const Memory memory{job_.data(),   counts_.data(), {state_.planes()},   {samples_.planes()},    generators_.data(),
                      valid_.data(), hits_.data(),   shadow_rays_.rays(), shadow_light_.planes(), shadow_owner_.data()};
  const int bounces = limits.max_depth >= 0 ? std::min(limits.max_depth, wave_bounces_) : wave_bounces_;
  std::uint32_t* paths = sizes_.data();
  std::uint32_t* shadows = paths + wave_bounces_ + 1;
  std::uint32_t* taken = shadows + wave_bounces_;
  sizes_.fill(0);
  launch(*stream_, n, Start{{}, memory, queue_[0].data(), paths});
  for (int b = 0; b < bounces; ++b) {
    const std::uint32_t* queue = queue_[b % 2].data();
    cast(*stream_, n, Extend{{}, world_, memory, queue, paths + b}, taken + 2 * b);
    if (b == 0) hide_emitters(*stream_, n, world_, job_.data(), hits_.data(), &counts_.data()->rays);
    with_world(world_, [&](const auto& world) {
      launch(
          *stream_, n,
          Scatter<std::decay_t<decltype(world)>>{
              {}, world, memory, limits, b, queue, paths + b, queue_[(b + 1) % 2].data(), paths + b + 1, shadows + b});
    });
    cast(*stream_, n, Connect{{}, world_, memory, shadows + b}, taken + 2 * b + 1);
  }
  if (limits.max_depth < 0 || limits.max_depth > bounces) {
    with_world(world_, [&](const auto& world) {
      launch(*stream_, n,
             Finish<std::decay_t<decltype(world)>>{
                 {}, world, memory, limits, bounces, queue_[bounces % 2].data(), paths + bounces});
    });
  }
}

unsigned long long DevicePathTracer::take_rays() { return octrad::take_counts(counts_).rays; }

}  // namespace octrad
