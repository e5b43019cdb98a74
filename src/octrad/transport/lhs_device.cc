// Kernels and driver of DeviceLhs. An item is a point that is being drawn: point item % n of
// the group's step item / n.
#include "octrad/transport/lhs_device.h"

#include <algorithm>
#include <cstring>

#include "octrad/base/error.h"
#include "octrad/device/launch.h"
#include "octrad/transport/cast.h"
#include "octrad/transport/first_hit_math.h"
#include "octrad/transport/trace_offsets_device.h"

namespace octrad {
namespace lhs_kernels {

// LhsDraw without its Rng: origin 0..2 and direction 3..5 of the walk, pose 6..11; its integers packed into one word
// (`progress`): 2 bits each for kind and legs, 8 for tries, 8 for the vertex, 12 for masks passed.
inline constexpr int kDrawNumbers = 12;
inline constexpr int kMostWalk = 255;
static_assert(kLhsTries <= 255);

// Items that need a ray are queued from the front, others from the back.
struct Queue {
  std::uint32_t* items;
  std::uint32_t* counts;  // of both
  std::uint32_t size;
  OCTRAD_HD void push(LhsNext next, std::uint32_t item) const {
    if (next == LhsNext::ray) items[atomic_append(counts)] = item;
    else items[size - 1 - atomic_append(counts + 1)] = item;
  }
  OCTRAD_HD bool has_ray(std::uint32_t q) const { return q < counts[0]; }
  OCTRAD_HD bool has(std::uint32_t q) const { return has_ray(q) || q >= size - counts[1]; }
};

// State of all items.
struct Memory {
  FloatPlanes walks;
  Rng* generators;
  std::uint32_t* progress;
  Hit* hits;             // by place in the queue
  ShadingPoint* points;  // results; shape -1 where none was found
  SurfacePointArray surface_points;

  OCTRAD_HD LhsDraw load(std::uint32_t item) const {
    LhsDraw draw(generators[item]);
    const std::uint32_t p = progress[item];
    draw.kind = static_cast<LhsKind>(p & 3u);
    draw.legs = p >> 2 & 3u;
    draw.tries = p >> 4 & 0xffu;
    draw.vertex = p >> 12 & 0xffu;
    draw.passed = p >> 20;
    if (draw.kind == LhsKind::area) return draw;
    draw.walk.origin = walks.get3(0, item);
    draw.walk.direction = walks.get3(3, item);
    if (draw.kind != LhsKind::pose || draw.vertex == 0) return draw;
    draw.walk.pose_origin = walks.get3(6, item);
    draw.walk.pose_direction = walks.get3(9, item);
    return draw;
  }
  OCTRAD_HD void store(std::uint32_t item, const LhsDraw& draw) const {
    generators[item] = draw.rng;
    const auto kind = static_cast<std::uint32_t>(draw.kind);
    progress[item] = kind | draw.legs << 2 | draw.tries << 4 | draw.vertex << 12 | draw.passed << 20;
    if (draw.kind == LhsKind::area) return;
    walks.set3(0, item, draw.walk.origin);
    walks.set3(3, item, draw.walk.direction);
    if (draw.kind != LhsKind::pose || draw.vertex == 0) return;
    walks.set3(6, item, draw.walk.pose_origin);
    walks.set3(9, item, draw.walk.pose_direction);
  }
  template <Models kModels>
  OCTRAD_HD void finish(std::uint32_t item, bool found, const ShadingPoint& point) const {
    points[item] = found ? point : ShadingPoint{};
    surface_points.store(item, surface_point<kModels>(points[item]));
  }
};

// All points' first tries.
struct Start : Kernel {
  Memory memory;
  LhsOptions options;
  LhsPoses poses;
  const unsigned long long* step;
  const double* by_area;
  std::uint32_t points, steps;
  Queue queue;
  OCTRAD_HD void operator()(std::uint32_t item) const {
    const std::uint32_t slice = item / points;
    const double share = by_area != nullptr ? *by_area : 1.0;
    LhsDraw draw(options, *step - *step % steps + slice, item - slice * points, share);
    queue.push(lhs_start_try(poses, draw), item);
    memory.store(item, draw);
  }
};

struct Extend : Kernel {
  DeviceWorld world;
  Memory memory;
  Queue queue;
  static constexpr bool kAny = false;
  OCTRAD_HD Bvh8View bvh() const { return world.bvh; }
  OCTRAD_HD std::uint32_t size() const { return queue.counts[0]; }
  OCTRAD_HD void count() const {}
  OCTRAD_HD RayQuery ray(std::uint32_t q) const {
    const std::uint32_t item = queue.items[q];
    return {memory.walks.get3(0, item), memory.walks.get3(3, item), kRayInfinity};
  }
  OCTRAD_HD void met(std::uint32_t q, const Hit& hit) const { memory.hits[q] = hit; }
};

template <typename World>
struct Arrive : Kernel {
  static constexpr unsigned kMinBlocks = 3;  // 141 registers; with 128 it spills
  World world;
  Memory memory;
  LhsOptions options;
  LhsPoses poses;
  Queue queue, next_queue;
  OCTRAD_HD void operator()(std::uint32_t q) const {
    if (!queue.has(q)) return;
    const std::uint32_t item = queue.items[q];
    Hit hit;
    if (queue.has_ray(q)) hit = memory.hits[q];
    LhsDraw draw = memory.load(item);
    ShadingPoint point;
    const LhsNext next = lhs_advance(world, options, poses, hit, draw, point);
    if (next == LhsNext::ray || next == LhsNext::no_ray) {
      memory.store(item, draw);
      next_queue.push(next, item);
    } else {
      memory.template finish<World::kModels>(item, next == LhsNext::found, point);
    }
  }
};

// Finishes the items that the rounds have left, one thread an item. Where there are few, only some lanes of a warp take
// one, to reduce divergence.
template <typename World>
struct Finish : Kernel {
  static constexpr unsigned kMinBlocks = 2;
  static constexpr std::uint32_t kThreads = 1u << 15;  // about what a large GPU runs at once of this kernel
  World world;
  Memory memory;
  LhsOptions options;
  LhsPoses poses;
  Queue queue;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    const std::uint32_t left = queue.counts[0] + queue.counts[1];
    if (left == 0) return;
    std::uint32_t spread = (queue.size < kThreads ? queue.size : kThreads) / left;
    spread = spread < 1 ? 1 : spread > 32 ? 32 : spread;
    const std::uint32_t place = i / spread;
    if (place * spread != i || place >= left) return;
    const bool ray = place < queue.counts[0];
    const std::uint32_t item = queue.items[ray ? place : queue.size - left + place];
    LhsDraw draw = memory.load(item);
    ShadingPoint point;
    const bool found = lhs_finish(world, options, poses, ray ? LhsNext::ray : LhsNext::no_ray, draw, point);
    memory.template finish<World::kModels>(item, found, point);
  }
};

template <typename World>
struct TracePointOffsets : Kernel {
  static constexpr unsigned kMinBlocks = 5;  // as TraceOffsets
  World world;
  OffsetRay offset;
  const ShadingPoint* points;
  SurfacePointArray surface_points;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    trace_offset_at(world, offset, surface_points, i, points[i].surface.geometric_normal);
  }
};

// Copies the points of one step out of those of the group.
struct Take : Kernel {
  const unsigned long long* step;
  std::uint32_t points, steps;
  const ShadingPoint* drawn;
  SurfacePointArray drawn_surface_points;
  ShadingPoint* taken;
  SurfacePointArray taken_surface_points;
  unsigned long long* missing;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    const std::size_t begin = static_cast<std::size_t>(*step % steps) * points;
    if (drawn[begin + i].surface.shape < 0) atomic_add(missing, 1ull);
    taken_surface_points.store(i, drawn_surface_points.load(begin + i));
    if (taken_surface_points.reflected.data != nullptr)
      taken_surface_points.reflected.set(i, drawn_surface_points.reflected.get(begin + i));
    // Word by word, so that accesses coalesce. Without the alignment the compiler would copy bytes.
    using Word = unsigned long long;
    static_assert(sizeof(ShadingPoint) % sizeof(Word) == 0 && alignof(ShadingPoint) % alignof(Word) == 0);
    const char* from = static_cast<const char*>(__builtin_assume_aligned(drawn + begin, alignof(Word)));
    char* to = static_cast<char*>(__builtin_assume_aligned(taken, alignof(Word)));
    for (std::size_t w = i; w < points * (sizeof(ShadingPoint) / sizeof(Word)); w += points) {
      std::memcpy(to + w * sizeof(Word), from + w * sizeof(Word), sizeof(Word));
    }
  }
};

template <typename World>
struct TakeFarEnds : Kernel {
  World world;
  const FarEnd* far_ends;
  ShadingPoint* taken;
  SurfacePointArray taken_surface_points;
  OffsetRay offset;
  unsigned long long* missing;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    const FarEnd end = far_ends[i];
    if (!end.hit.valid()) return;
    if (taken[i].surface.shape < 0) atomic_add(missing, ~0ull);  // Take has counted it
    taken[i] = shade_far_end(world, end);
    const SurfacePoint point = field_query_point(world, taken[i], offset);
    taken_surface_points.store(i, point);
    if (offset.reflected) taken_surface_points.reflected.set(i, point.reflected);
  }
};

}  // namespace lhs_kernels

DeviceLhs::DeviceLhs(Stream& stream, const DeviceWorld& world, const LhsOptions& options,
                     std::span<const CameraView> views, bool fresh_poses, std::size_t most, std::size_t most_ahead,
                     int rounds, Stream* drawing, const OffsetRay& offset)
    : stream_(&stream),
      drawing_(drawing != nullptr ? drawing : &stream),
      world_(world),
      options_(options),
      offset_(offset),
      most_(most),
      most_ahead_(std::max(most, most_ahead)),
      rounds_(rounds >= 0                     ? rounds
              : stream.tuning.lhs_rounds >= 0 ? stream.tuning.lhs_rounds
              : options.glossy_boost > 1.0    ? 32
                                              : 12),
      fresh_poses_(fresh_poses),
      views_(stream, views, "camera poses"),
      missing_(stream, 1, "counts of points"),
      sizes_(stream, 3 * static_cast<std::size_t>(rounds_) + 2, "sizes of queues"),
      queues_{DeviceArray<std::uint32_t>(stream, most_ahead_, "left-hand-side points"),
              DeviceArray<std::uint32_t>(stream, most_ahead_, "left-hand-side points")},
      progress_(stream, most_ahead_, "left-hand-side points"),
      generators_(stream, most_ahead_, "random numbers of points"),
      hits_(stream, most_ahead_, "hits of left-hand-side points"),
      walks_(stream, lhs_kernels::kDrawNumbers, most_ahead_, "left-hand-side points"),
      points_(stream, most, "left-hand-side points"),
      surface_points_(stream, surface_point_numbers(offset), most, "left-hand-side points") {
  if (views.empty()) throw UsageError("left-hand-side points need a camera to start from");
  if (options.max_walk < 0 || options.max_walk > lhs_kernels::kMostWalk) {
    throw UsageError("walks of up to " + std::to_string(options.max_walk) +
                     " vertices: a device draws walks of up to " + std::to_string(lhs_kernels::kMostWalk));
  }
  missing_.fill(0);
  for (int buffer = 0; buffer < (drawing != nullptr ? 2 : 1); ++buffer) {
    drawn_[buffer] = DeviceArray<ShadingPoint>(stream, most_ahead_, "left-hand-side points");
    drawn_[buffer].fill(0);  // points are copied as whole words, padding included
    drawn_surface_points_[buffer] =
        PlaneArray(stream, surface_point_numbers(offset), most_ahead_, "left-hand-side points");
  }
  stream.synchronize();  // before another stream draws
}

std::size_t DeviceLhs::bytes(std::size_t most, std::size_t most_ahead, int buffers, const OffsetRay& offset) {
  const std::size_t point =
      sizeof(ShadingPoint) + static_cast<std::size_t>(surface_point_numbers(offset)) * sizeof(float);
  const std::size_t draw = 3 * sizeof(std::uint32_t) + sizeof(Rng) + sizeof(Hit) +
                           static_cast<std::size_t>(lhs_kernels::kDrawNumbers) * sizeof(float);
  return most * point + std::max(most, most_ahead) * (static_cast<std::size_t>(buffers) * point + draw);
}

void DeviceLhs::draw(const unsigned long long* step, std::size_t n, int steps, int buffer, const double* by_area) {
  using namespace lhs_kernels;
  check(n, steps);
  const std::size_t items = n * static_cast<std::size_t>(steps);
  const LhsPoses poses{views_.data(), static_cast<std::uint32_t>(views_.size()), fresh_poses_};
  const Memory memory{walks_.planes(), generators_.data(),    progress_.data(),
                      hits_.data(),    drawn_[buffer].data(), drawn_surface_points_[buffer].points()};
  const auto queue = [&](int round) {
    return Queue{queues_[round % 2].data(), sizes_.data() + 2 * round, static_cast<std::uint32_t>(items)};
  };
  drawing_->fill(sizes_.data(), 0, sizes_.bytes());
  launch(*drawing_, items,
         Start{{},
               memory,
               options_,
               poses,
               step,
               by_area,
               static_cast<std::uint32_t>(n),
               static_cast<std::uint32_t>(steps),
               queue(0)});
  for (int r = 0; r < rounds_; ++r) {
    cast(*drawing_, items, Extend{{}, world_, memory, queue(r)}, sizes_.data() + 2 * rounds_ + 2 + r);
    drawing_->mark("left-hand rays");
    with_world(world_, [&](const auto& world) {
      launch(*drawing_, items,
             Arrive<std::decay_t<decltype(world)>>{{}, world, memory, options_, poses, queue(r), queue(r + 1)});
    });
    drawing_->mark("left-hand hits");
  }
  with_world(world_, [&](const auto& world) {
    launch(*drawing_, items, Finish<std::decay_t<decltype(world)>>{{}, world, memory, options_, poses, queue(rounds_)});
  });
  if (offset_.traced) {
    with_world(world_, [&](const auto& world) {
      launch(*drawing_, items,
             TracePointOffsets<std::decay_t<decltype(world)>>{
                 {}, world, offset_, drawn_[buffer].data(), drawn_surface_points_[buffer].points(offset_)});
    });
  }
  drawing_->mark("left-hand rest");
}

void DeviceLhs::take(const unsigned long long* step, std::size_t n, int steps, int buffer) {
  using namespace lhs_kernels;
  check(n, steps);
  launch(*stream_, n,
         Take{{},
              step,
              static_cast<std::uint32_t>(n),
              static_cast<std::uint32_t>(steps),
              drawn_[buffer].data(),
              drawn_surface_points_[buffer].points(offset_),
              points_.data(),
              surface_points_.points(offset_),
              missing_.data()});
}

void DeviceLhs::take_far_ends(const FarEnd* far_ends, std::size_t count) {
  using namespace lhs_kernels;
  check(count, 1);
  with_world(world_, [&](const auto& world) {
    launch(*stream_, count,
           TakeFarEnds<std::decay_t<decltype(world)>>{
               {}, world, far_ends, points_.data(), surface_points_.points(offset_), offset_, missing_.data()});
  });
}

void DeviceLhs::check(std::size_t n, int steps) const {
  if (steps >= 1 && n <= most_ && n <= most_ahead_ / static_cast<std::size_t>(steps)) return;
  throw UsageError(std::to_string(n) + " left-hand-side points of " + std::to_string(steps) +
                   " steps: memory was taken for " + std::to_string(most_) + " and " + std::to_string(most_ahead_) +
                   " of several steps");
}

unsigned long long DeviceLhs::take_missing() {
  const unsigned long long missing = missing_.download()[0];
  missing_.fill(0);
  return missing;
}

}  // namespace octrad
