#include "octrad/encoding/lookup_device.h"

#include "octrad/device/feature_width.h"
#include "octrad/device/launch.h"

namespace octrad {
namespace {

template <int C, typename E, typename Rows>
struct OctreeLookup : Kernel {
  OctaOctreeView view;
  const E* table;
  DeviceQueries queries;
  Rows out;
  int first;

  OCTRAD_HD void operator()(std::uint32_t l, std::uint32_t i) const {
    if (!queries.slice.holds(i)) return;
    float sum[C];
    OCTRAD_UNROLL
    for (int c = 0; c < C; ++c) sum[c] = 0.0f;
    const float d = queries.d != nullptr ? queries.d[i] : 0.0f;
    const int cells = visit_level(view, view.level[l], normalize_position(view, queries.position(i)),
                                  queries.direction(i), d, [&](std::uint32_t entry, float weight, float) {
                                    float value[C];
                                    load_row<C>(table, entry, value);
                                    OCTRAD_UNROLL
                                    for (int c = 0; c < C; ++c) sum[c] += weight * value[c];
                                  });
    if (cells == 0 && queries.empty != nullptr) atomic_add(queries.empty, 1ull);
    OCTRAD_UNROLL
    for (int c = 0; c < C; c += 2) out.store2(first + static_cast<int>(l) * C + c, i, sum[c], sum[c + 1]);
  }
};

template <int C, typename E, typename Sink>
struct OctreeScatter : Kernel {
  static constexpr unsigned kMinBlocks = 6;  // 80 registers: nothing spills
  OctaOctreeView view;
  const E* table;
  DeviceQueries queries;
  const float* upstream;
  std::size_t upstream_stride;
  float* d_disparity;
  std::size_t d_stride;
  Sink sink;

  OCTRAD_HD void operator()(std::uint32_t l, std::uint32_t i) const {
    if (!queries.slice.holds(i)) return;
    float up[C];
    OCTRAD_UNROLL
    for (int c = 0; c < C; ++c) up[c] = upstream[(l * C + static_cast<std::uint32_t>(c)) * upstream_stride + i];
    const float d = queries.d != nullptr ? queries.d[i] : 0.0f;
    std::uint64_t slot = (static_cast<std::uint64_t>(l) * queries.n + i) * kOctreeTaps;
    float by_disparity = 0.0f;
    visit_level(view, view.level[l], normalize_position(view, queries.position(i)), queries.direction(i), d,
                [&](std::uint32_t entry, float weight, float dweight) {
                  if (d_disparity != nullptr && dweight != 0.0f) {
                    float value[C];
                    load_row<C>(table, entry, value);
                    float product = 0.0f;
                    OCTRAD_UNROLL
                    for (int c = 0; c < C; ++c) product += up[c] * value[c];
                    by_disparity += dweight * product;
                  }
                  if (weight != 0.0f) sink.template add<C>(slot++, entry, weight, up);
                });
    if (d_disparity != nullptr) d_disparity[l * d_stride + i] = by_disparity;
  }
};

// Sum of the 8 entries of a hash grid's level, times their weights.
template <int F, typename E>
OCTRAD_HD inline void sum_taps(const E* table, const std::uint32_t* entry, const float* weight, float* sum) {
  OCTRAD_UNROLL
  for (int c = 0; c < F; ++c) sum[c] = 0.0f;
  OCTRAD_UNROLL
  for (int k = 0; k < 8; ++k) {
    float value[F];
    load_row<F>(table, entry[k], value);
    OCTRAD_UNROLL
    for (int c = 0; c < F; ++c) sum[c] += weight[k] * value[c];
  }
}

template <int F, typename E, typename Rows>
struct GridLookup : Kernel {
  HashGridView view;
  Vec3f origin, size;
  const E* table;
  DeviceQueries queries;
  Rows out;
  int first;

  OCTRAD_HD void operator()(std::uint32_t l, std::uint32_t i) const {
    if (!queries.slice.holds(i)) return;
    std::uint32_t entry[8];
    float weight[8], sum[F];
    hash_grid_taps(view.level[l], divide(queries.position(i) - origin, size), entry, weight);
    sum_taps<F>(table, entry, weight, sum);
    OCTRAD_UNROLL
    for (int c = 0; c < F; c += 2) out.store2(first + static_cast<int>(l) * F + c, i, sum[c], sum[c + 1]);
  }
};

template <int F, typename Sink>
struct GridScatter : Kernel {
  HashGridView view;
  Vec3f origin, size;
  DeviceQueries queries;
  const float* upstream;
  std::size_t upstream_stride;
  Sink sink;

  OCTRAD_HD void operator()(std::uint32_t l, std::uint32_t i) const {
    if (!queries.teaches_grid(i)) return;
    float up[F];
    OCTRAD_UNROLL
    for (int c = 0; c < F; ++c) up[c] = upstream[(l * F + static_cast<std::uint32_t>(c)) * upstream_stride + i];
    std::uint32_t entry[8];
    float weight[8];
    const std::uint64_t slot = (static_cast<std::uint64_t>(l) * queries.n + i) * kHashGridTaps;
    hash_grid_taps(view.level[l], divide(queries.position(i) - origin, size), entry, weight);
    OCTRAD_UNROLL
    for (int k = 0; k < 8; ++k) sink.template add<F>(slot + static_cast<std::uint64_t>(k), entry[k], weight[k], up);
  }
};

template <int F, typename E, typename Rows>
struct PrefilteredLookup : Kernel {
  HashGridView view;
  const E* table;
  DeviceFootprints queries;
  Rows out;
  int first;

  OCTRAD_HD void operator()(std::uint32_t i) const {
    if (!queries.slice.holds(i)) return;
    float sum[F];
    OCTRAD_UNROLL
    for (int c = 0; c < F; ++c) sum[c] = 0.0f;
    if (const float r = queries.r[i]; r >= 0.0f) {
      visit_prefiltered(view, queries.position(i), r,
                        [&](int, const std::uint32_t* entry, const float* weight, float of_level) {
                          float level[F];
                          sum_taps<F>(table, entry, weight, level);
                          OCTRAD_UNROLL
                          for (int c = 0; c < F; ++c) sum[c] += of_level * level[c];
                        });
    }
    OCTRAD_UNROLL
    for (int c = 0; c < F; c += 2) out.store2(first + c, i, sum[c], sum[c + 1]);
  }
};

template <int F, typename Sink>
struct PrefilteredScatter : Kernel {
  HashGridView view;
  DeviceFootprints queries;
  const float* upstream;
  std::size_t upstream_stride;
  Sink sink;

  OCTRAD_HD void operator()(std::uint32_t i) const {
    if (!queries.slice.holds(i) || !(queries.r[i] >= 0.0f)) return;
    float up[F];
    OCTRAD_UNROLL
    for (int c = 0; c < F; ++c) up[c] = upstream[static_cast<std::size_t>(c) * upstream_stride + i];
    visit_prefiltered(
        view, queries.position(i), queries.r[i],
        [&](int side, const std::uint32_t* entry, const float* weight, float of_level) {
          const std::uint64_t slot =
              static_cast<std::uint64_t>(i) * kPrefilteredTaps + static_cast<std::uint64_t>(side * kHashGridTaps);
          OCTRAD_UNROLL
          for (int k = 0; k < 8; ++k)
            sink.template add<F>(slot + static_cast<std::uint64_t>(k), entry[k], weight[k] * of_level, up);
        });
  }
};

template <typename Rows>
void octree_lookup(Stream& stream, const OctaOctreeView& view, DeviceFeatures table, const DeviceQueries& queries,
                   Rows out, int first) {
  with_width(view.features, [&](auto width) {
    constexpr int C = decltype(width)::value;
    if (table.halves != nullptr)
      launch_levels(stream, queries.n, view.levels,
                    OctreeLookup<C, Half, Rows>{{}, view, table.halves, queries, out, first});
    else
      launch_levels(stream, queries.n, view.levels,
                    OctreeLookup<C, float, Rows>{{}, view, table.floats, queries, out, first});
  });
}

template <typename Sink>
void octree_scatter(Stream& stream, const OctaOctreeView& view, DeviceFeatures table, const DeviceQueries& queries,
                    const float* upstream, std::size_t upstream_stride, float* d_disparity, std::size_t d_stride,
                    const Sink& sink) {
  with_width(view.features, [&](auto width) {
    constexpr int C = decltype(width)::value;
    if (table.halves != nullptr) {
      launch_levels(stream, queries.n, view.levels,
                    OctreeScatter<C, Half, Sink>{
                        {}, view, table.halves, queries, upstream, upstream_stride, d_disparity, d_stride, sink});
    } else {
      launch_levels(stream, queries.n, view.levels,
                    OctreeScatter<C, float, Sink>{
                        {}, view, table.floats, queries, upstream, upstream_stride, d_disparity, d_stride, sink});
    }
  });
}

template <typename Rows>
void grid_lookup(Stream& stream, const HashGridView& view, Vec3f origin, Vec3f size, DeviceFeatures table,
                 const DeviceQueries& queries, Rows out, int first) {
  with_width(view.features, [&](auto width) {
    constexpr int F = decltype(width)::value;
    if (table.halves != nullptr)
      launch_levels(stream, queries.n, view.levels,
                    GridLookup<F, Half, Rows>{{}, view, origin, size, table.halves, queries, out, first});
    else
      launch_levels(stream, queries.n, view.levels,
                    GridLookup<F, float, Rows>{{}, view, origin, size, table.floats, queries, out, first});
  });
}

template <typename Sink>
void grid_scatter(Stream& stream, const HashGridView& view, Vec3f origin, Vec3f size, const DeviceQueries& queries,
                  const float* upstream, std::size_t upstream_stride, const Sink& sink) {
  with_width(view.features, [&](auto width) {
    constexpr int F = decltype(width)::value;
    launch_levels(stream, queries.n, view.levels,
                  GridScatter<F, Sink>{{}, view, origin, size, queries, upstream, upstream_stride, sink});
  });
}

template <typename Rows>
void prefiltered(Stream& stream, const HashGridView& view, DeviceFeatures table, const DeviceFootprints& queries,
                 Rows out, int first) {
  with_width(view.features, [&](auto width) {
    constexpr int F = decltype(width)::value;
    if (table.halves != nullptr)
      launch(stream, queries.n, PrefilteredLookup<F, Half, Rows>{{}, view, table.halves, queries, out, first});
    else launch(stream, queries.n, PrefilteredLookup<F, float, Rows>{{}, view, table.floats, queries, out, first});
  });
}

template <typename Sink>
void prefiltered_scatter(Stream& stream, const HashGridView& view, const DeviceFootprints& queries,
                         const float* upstream, std::size_t upstream_stride, const Sink& sink) {
  with_width(view.features, [&](auto width) {
    constexpr int F = decltype(width)::value;
    launch(stream, queries.n, PrefilteredScatter<F, Sink>{{}, view, queries, upstream, upstream_stride, sink});
  });
}

}  // namespace

DeviceOctree::DeviceOctree(Stream& stream, const OctaOctree& octree) : view_(octree.view()) {
  view_.table = nullptr;
  for (int l = 0; l < view_.levels; ++l) {
    CellIndexView& index = view_.level[l].index;
    const auto bricks = static_cast<std::size_t>(index.bricks_per_axis);
    const std::span<const std::uint32_t> top(index.top, bricks * bricks * bricks);
    std::uint32_t last = 0;
    for (const std::uint32_t brick : top) last = brick > last ? brick : last;
    tops_.emplace_back(stream, top, "the octree's cell index");
    octants_.emplace_back(stream, std::span<const CellOctant>(index.octants, (std::size_t{last} + 1) * 8),
                          "the octree's cell index");
    index.top = tops_.back().data();
    index.octants = octants_.back().data();
  }
}

void DeviceOctree::lookup(Stream& stream, DeviceFeatures table, const DeviceQueries& queries, HalfRows out,
                          int first) const {
  octree_lookup(stream, view_, table, queries, out, first);
}
void DeviceOctree::lookup(Stream& stream, DeviceFeatures table, const DeviceQueries& queries, FloatRows out,
                          int first) const {
  octree_lookup(stream, view_, table, queries, out, first);
}
void DeviceOctree::scatter(Stream& stream, DeviceFeatures table, const DeviceQueries& queries, const float* upstream,
                           std::size_t upstream_stride, float* d_disparity, std::size_t d_stride,
                           const AddNow& sink) const {
  octree_scatter(stream, view_, table, queries, upstream, upstream_stride, d_disparity, d_stride, sink);
}
void DeviceOctree::scatter(Stream& stream, DeviceFeatures table, const DeviceQueries& queries, const float* upstream,
                           std::size_t upstream_stride, float* d_disparity, std::size_t d_stride,
                           const KeepForSort& sink) const {
  octree_scatter(stream, view_, table, queries, upstream, upstream_stride, d_disparity, d_stride, sink);
}

DeviceHashGrid::DeviceHashGrid(const HashGrid& grid, Vec3f origin, Vec3f size)
    : view_(grid.view()),
      origin_(origin),
      size_(size) {
  view_.table = nullptr;
}
void DeviceHashGrid::lookup(Stream& stream, DeviceFeatures table, const DeviceQueries& queries, HalfRows out,
                            int first) const {
  grid_lookup(stream, view_, origin_, size_, table, queries, out, first);
}
void DeviceHashGrid::lookup(Stream& stream, DeviceFeatures table, const DeviceQueries& queries, FloatRows out,
                            int first) const {
  grid_lookup(stream, view_, origin_, size_, table, queries, out, first);
}
void DeviceHashGrid::scatter(Stream& stream, const DeviceQueries& queries, const float* upstream,
                             std::size_t upstream_stride, const AddNow& sink) const {
  grid_scatter(stream, view_, origin_, size_, queries, upstream, upstream_stride, sink);
}
void DeviceHashGrid::scatter(Stream& stream, const DeviceQueries& queries, const float* upstream,
                             std::size_t upstream_stride, const KeepForSort& sink) const {
  grid_scatter(stream, view_, origin_, size_, queries, upstream, upstream_stride, sink);
}

DevicePrefilteredGrid::DevicePrefilteredGrid(const HashGrid& grid) : view_(grid.view()) { view_.table = nullptr; }
void DevicePrefilteredGrid::lookup(Stream& stream, DeviceFeatures table, const DeviceFootprints& queries, HalfRows out,
                                   int first) const {
  prefiltered(stream, view_, table, queries, out, first);
}
void DevicePrefilteredGrid::lookup(Stream& stream, DeviceFeatures table, const DeviceFootprints& queries, FloatRows out,
                                   int first) const {
  prefiltered(stream, view_, table, queries, out, first);
}
void DevicePrefilteredGrid::scatter(Stream& stream, const DeviceFootprints& queries, const float* upstream,
                                    std::size_t upstream_stride, const AddNow& sink) const {
  prefiltered_scatter(stream, view_, queries, upstream, upstream_stride, sink);
}
void DevicePrefilteredGrid::scatter(Stream& stream, const DeviceFootprints& queries, const float* upstream,
                                    std::size_t upstream_stride, const KeepForSort& sink) const {
  prefiltered_scatter(stream, view_, queries, upstream, upstream_stride, sink);
}

}  // namespace octrad
