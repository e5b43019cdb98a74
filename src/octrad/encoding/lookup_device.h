// Look-ups of feature tables on a device and the scatter of their gradients (method section 4). Launched level by
// level: all queries of a level before the next one's, so that a level's part of the table stays in the cache.
#pragma once

#include <cstdint>
#include <vector>

#include "octrad/base/half.h"
#include "octrad/device/array.h"
#include "octrad/device/rows.h"
#include "octrad/encoding/cell_index.h"
#include "octrad/encoding/hash_grid.h"
#include "octrad/encoding/octaoctree.h"
#include "octrad/encoding/octaoctree_math.h"
#include "octrad/encoding/prefiltered_grid_math.h"

namespace octrad {

// A table of feature vectors in device memory, as floats or as halves (one of the two is set).
struct DeviceFeatures {
  const float* floats = nullptr;
  const Half* halves = nullptr;
};

// Queries in device memory: rows 0, 1, 2 of x and w are components, `stride` items apart each.
struct DeviceQueries {
  const float* x = nullptr;  // world positions
  std::size_t x_stride = 0;
  const float* w = nullptr;  // directions; not used by hash grids
  std::size_t w_stride = 0;
  const float* d = nullptr;  // disparities; null: 0
  QueueSlice slice;
  std::uint32_t n = 0;                  // items of a launch
  unsigned long long* empty = nullptr;  // octree look-ups count those of a level without an occupied cell; may be null
  const float* alpha = nullptr;         // not null: hash grids get gradients only from queries with alpha < alpha_below
  float alpha_below = 0.0f;

  OCTRAD_HD Vec3f position(std::size_t i) const { return {x[i], x[x_stride + i], x[2 * x_stride + i]}; }
  OCTRAD_HD Vec3f direction(std::size_t i) const { return {w[i], w[w_stride + i], w[2 * w_stride + i]}; }
  OCTRAD_HD bool teaches_grid(std::uint32_t i) const {
    return slice.holds(i) && (alpha == nullptr || alpha[i] < alpha_below);
  }
};

// Taps of one (query, level): slot s of (level, query i) is (level n + i) taps + s.
inline constexpr int kOctreeTaps = 24, kHashGridTaps = 8;
// Taps of one look-up with a footprint: slot s of query i is 16 i + s.
inline constexpr int kPrefilteredTaps = 16;

// Look-ups with footprints, in device memory.
struct DeviceFootprints {
  const float* p = nullptr;  // positions in [0,1]^3 (clamped), components `stride` items apart
  const float* r = nullptr;  // footprints in the same unit; below 0: nothing is looked up there
  std::size_t stride = 0;
  QueueSlice slice;
  std::uint32_t n = 0;  // items of a launch

  OCTRAD_HD Vec3f position(std::size_t i) const { return {p[i], p[stride + i], p[2 * stride + i]}; }
};

// The cells of an OctaOctree in device memory.
class DeviceOctree {
 public:
  DeviceOctree(Stream& stream, const OctaOctree& octree);
  // Its table is null.
  const OctaOctreeView& view() const { return view_; }
  int feature_count() const { return view_.levels * view_.features; }

  // Features f = level C + c of query i to rows `first` + f of out (`first` is even).
  void lookup(Stream& stream, DeviceFeatures table, const DeviceQueries& queries, HalfRows out, int first) const;
  void lookup(Stream& stream, DeviceFeatures table, const DeviceQueries& queries, FloatRows out, int first) const;
  // Adds the gradients of the table to `sink`. upstream: gradient at the features [K C][upstream_stride]. d_disparity,
  // unless null: receives the contribution of each level to the gradient at d, [K][d_stride].
  void scatter(Stream& stream, DeviceFeatures table, const DeviceQueries& queries, const float* upstream,
               std::size_t upstream_stride, float* d_disparity, std::size_t d_stride, const AddNow& sink) const;
  void scatter(Stream& stream, DeviceFeatures table, const DeviceQueries& queries, const float* upstream,
               std::size_t upstream_stride, float* d_disparity, std::size_t d_stride, const KeepForSort& sink) const;

 private:
  OctaOctreeView view_;
  std::vector<DeviceArray<std::uint32_t>> tops_;
  std::vector<DeviceArray<CellOctant>> octants_;
};

// A hash grid; positions are (x - origin) / size.
class DeviceHashGrid {
 public:
  DeviceHashGrid(const HashGrid& grid, Vec3f origin, Vec3f size);
  int levels() const { return view_.levels; }
  int features() const { return view_.features; }
  int feature_count() const { return view_.levels * view_.features; }
  void lookup(Stream& stream, DeviceFeatures table, const DeviceQueries& queries, HalfRows out, int first) const;
  void lookup(Stream& stream, DeviceFeatures table, const DeviceQueries& queries, FloatRows out, int first) const;
  void scatter(Stream& stream, const DeviceQueries& queries, const float* upstream, std::size_t upstream_stride,
               const AddNow& sink) const;
  void scatter(Stream& stream, const DeviceQueries& queries, const float* upstream, std::size_t upstream_stride,
               const KeepForSort& sink) const;

 private:
  HashGridView view_;
  Vec3f origin_, size_;
};

// A hash grid looked up with footprints (prefiltered_grid_math.h). F features a query, 0 where nothing is looked up.
class DevicePrefilteredGrid {
 public:
  explicit DevicePrefilteredGrid(const HashGrid& grid);
  int features() const { return view_.features; }
  void lookup(Stream& stream, DeviceFeatures table, const DeviceFootprints& queries, HalfRows out, int first) const;
  void lookup(Stream& stream, DeviceFeatures table, const DeviceFootprints& queries, FloatRows out, int first) const;
  // upstream: gradient at the features [F][upstream_stride].
  void scatter(Stream& stream, const DeviceFootprints& queries, const float* upstream, std::size_t upstream_stride,
               const AddNow& sink) const;
  void scatter(Stream& stream, const DeviceFootprints& queries, const float* upstream, std::size_t upstream_stride,
               const KeepForSort& sink) const;

 private:
  HashGridView view_;
};

}  // namespace octrad
