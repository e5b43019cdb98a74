#include "octrad/encoding/octaoctree.h"

#include <cstring>
#include <limits>
#include <string>
#include <utility>

#include "octrad/base/error.h"
#include "octrad/encoding/cell_index.h"
#include "octrad/encoding/huge_array.h"
#include "octrad/encoding/octaoctree_math.h"
#include "octrad/encoding/octaoctree_simd.h"

namespace octrad {

struct OctaOctree::Impl {
  OctaOctreeOptions options;
  std::vector<std::vector<Vec3i>> cells;
  std::vector<CellIndex> index;
  std::vector<std::int64_t> offset;  // [levels + 1]
  HugeArray table;
  OctaOctreeView view;
};

namespace {

void check(const OctaOctreeOptions& options, std::size_t level_lists, Vec3f origin, Vec3f size) {
  if (options.levels < 1 || options.levels > kMaxOctreeLevels) {
    throw InputError("octree.levels is " + std::to_string(options.levels) + ", supported are 1 to " +
                     std::to_string(kMaxOctreeLevels));
  }
  if (options.features != 2 && options.features != 4 && options.features != 8) {
    throw InputError("octree.features is " + std::to_string(options.features) + ", supported are 2, 4 and 8");
  }
  if (level_lists != static_cast<std::size_t>(options.levels)) {
    throw InputError("octree of " + std::to_string(options.levels) + " levels was given the cells of " +
                     std::to_string(level_lists));
  }
  if (!is_finite(origin) || !is_finite(size) || !(min_component(size) > 0.0f)) {
    throw InputError("octree domain must be finite and of positive size in every axis");
  }
}

}  // namespace

OctaOctree::OctaOctree(const OctaOctreeOptions& options, const std::vector<std::vector<Vec3i>>& cells, Vec3f origin,
                       Vec3f size)
    : impl_(std::make_unique<Impl>()) {
  check(options, cells.size(), origin, size);
  Impl& m = *impl_;
  m.options = options;
  const int maps = options.levels - options.fine;
  m.offset.push_back(0);
  for (int l = 1; l <= options.levels; ++l) {
    const auto count = static_cast<std::int64_t>(cells[static_cast<std::size_t>(l - 1)].size());
    m.offset.push_back(m.offset.back() + octree_entries(maps, l, count));
  }
  const std::int64_t entries = m.offset.back();
  if (entries > static_cast<std::int64_t>(std::numeric_limits<std::uint32_t>::max())) {
    throw MemoryError("octree of " + std::to_string(entries) +
                      " feature vectors is above the limit of 2^32; lower octree.levels (now " +
                      std::to_string(options.levels) + "), each level less needs about a fifth");
  }
  m.cells = cells;
  for (int l = 1; l <= options.levels; ++l) {
    m.index.emplace_back(cells[static_cast<std::size_t>(l - 1)], octrad::spatial_resolution(l),
                         ("octree level " + std::to_string(l)).c_str());
  }
  m.table = HugeArray(static_cast<std::size_t>(entries) * static_cast<std::size_t>(options.features),
                      "the octree's features (lower octree.levels or octree.features)");
  m.view.table = m.table.data();
  m.view.levels = options.levels;
  m.view.features = options.features;
  m.view.trilinear = options.trilinear;
  m.view.barycentric = options.barycentric;
  m.view.origin = origin;
  m.view.size = size;
  for (int l = 1; l <= options.levels; ++l) {
    OctreeLevelView& level = m.view.level[l - 1];
    level.index = m.index[static_cast<std::size_t>(l - 1)].view();
    level.spatial_resolution = octrad::spatial_resolution(l);
    level.octahedral_resolution = octahedral_resolution(maps, l);
    level.map = octa_map<float>(level.octahedral_resolution);
    level.first_entry = static_cast<std::uint32_t>(m.offset[static_cast<std::size_t>(l - 1)]);
    level.cell_size = size / static_cast<float>(level.spatial_resolution);
  }
}

OctaOctree::~OctaOctree() = default;

const OctaOctreeOptions& OctaOctree::options() const { return impl_->options; }
Vec3f OctaOctree::origin() const { return impl_->view.origin; }
Vec3f OctaOctree::size() const { return impl_->view.size; }
int OctaOctree::feature_count() const { return impl_->options.levels * impl_->options.features; }
std::int64_t OctaOctree::entry_count() const { return impl_->offset.back(); }
std::int64_t OctaOctree::level_offset(int level) const { return impl_->offset.at(static_cast<std::size_t>(level - 1)); }
int OctaOctree::map_resolution(int level) const { return impl_->view.level[level - 1].octahedral_resolution; }
const std::vector<Vec3i>& OctaOctree::cells(int level) const {
  return impl_->cells.at(static_cast<std::size_t>(level - 1));
}
std::span<float> OctaOctree::features() { return impl_->table.span(); }
std::span<const float> OctaOctree::features() const { return std::as_const(impl_->table).span(); }
const OctaOctreeView& OctaOctree::view() const { return impl_->view; }

void OctaOctree::canonicalize_rims() {
  const Impl& m = *impl_;
  const auto features = static_cast<std::size_t>(m.options.features);
  for (int l = 1; l <= m.options.levels; ++l) {
    const int resolution = map_resolution(l), half = resolution / 2;
    if (resolution == 0) break;
    const auto map_floats = static_cast<std::size_t>((resolution + 1) * (resolution + 1)) * features;
    float* map = impl_->table.data() + static_cast<std::size_t>(level_offset(l)) * features;
    const OctaMap<int> octa = octa_map<int>(resolution);
    const auto copy = [&](int i, int j) {
      const OctaVertex<int> vertex{i, j}, a = octa_canonical(vertex, half);
      const float* from = map + static_cast<std::size_t>(octa_vertex_index(a, octa)) * features;
      float* to = map + static_cast<std::size_t>(octa_vertex_index(vertex, octa)) * features;
      // Equal values are not written, so that pages of an untrained table stay untouched.
      if (from != to && std::memcmp(from, to, features * sizeof(float)) != 0)
        std::memcpy(to, from, features * sizeof(float));
    };
    for (std::size_t c = 0; c < cells(l).size(); ++c, map += map_floats) {
      for (int a = -half; a <= half; ++a) {
        copy(a, -half);
        copy(a, half);
        copy(-half, a);
        copy(half, a);
      }
    }
  }
}

std::int64_t OctaOctree::lookup(const Vec3f* x, const Vec3f* w, const float* d, int n, float* out, int stride) const {
  return octaoctree_lookup(impl_->view, x, w, d, n, out, stride);
}

std::int64_t OctaOctree::lookup_record(const Vec3f* x, const Vec3f* w, const float* d, int n, float* out, int stride,
                                       Record& record) const {
  return octaoctree_lookup_record(impl_->view, x, w, d, n, out, stride, record);
}

}  // namespace octrad
