#include "octrad/encoding/hash_grid.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "octrad/base/error.h"
#include "octrad/encoding/hash_grid_simd.h"

namespace octrad {
namespace {

void check(const HashGridOptions& o) {
  const auto fail = [](const std::string& key, const std::string& value, const std::string& accepted) {
    throw InputError("hash grid: " + key + " is " + value + ", supported " + accepted);
  };
  if (o.levels < 1 || o.levels > kMaxHashGridLevels)
    fail("levels", std::to_string(o.levels), "are 1 to " + std::to_string(kMaxHashGridLevels));
  if (o.features != 2 && o.features != 4 && o.features != 8)
    fail("features", std::to_string(o.features), "are 2, 4 and 8");
  if (o.log2_table < 4 || o.log2_table > 26) fail("log2_table", std::to_string(o.log2_table), "are 4 to 26");
  if (o.base < 2 || o.base > 4096) fail("base", std::to_string(o.base), "are 2 to 4096");
  if (!(o.growth >= 1.0 && o.growth <= 4.0)) fail("growth", std::to_string(o.growth), "are 1 to 4");
  // Beyond 2^20 vertices per axis a float position cannot tell neighbours apart.
  const double finest = hash_grid_resolution(o, o.levels - 1);
  if (finest > 0x1p20)
    fail("finest resolution", std::to_string(finest), "are up to 2^20: lower base, growth or levels");
}

}  // namespace

double hash_grid_resolution(const HashGridOptions& options, int level) {
  return options.base * std::pow(options.growth, level);
}

std::int64_t hash_grid_entries(const HashGridOptions& options) {
  double total = 0.0;
  for (int l = 0; l < options.levels; ++l) {
    const double r = std::ceil(hash_grid_resolution(options, l) - 1.0) + 1.0;
    total += std::min(r * r * r, std::ldexp(1.0, options.log2_table));
  }
  return static_cast<std::int64_t>(total);
}

HashGrid::HashGrid(const HashGridOptions& options) : options_(options) {
  check(options);
  offsets_.push_back(0);
  levels_.resize(static_cast<std::size_t>(options.levels));
  for (int l = 0; l < options.levels; ++l) {
    const double scale = hash_grid_resolution(options, l) - 1.0;
    const auto resolution = static_cast<std::int64_t>(std::ceil(scale)) + 1;
    const std::int64_t table_size = std::int64_t{1} << options.log2_table;
    HashGridLevelView& level = levels_[static_cast<std::size_t>(l)];
    level.dense = resolution * resolution * resolution <= table_size;
    const std::int64_t entries = level.dense ? resolution * resolution * resolution : table_size;
    level.scale = static_cast<float>(scale);
    level.resolution = static_cast<std::uint32_t>(resolution);
    level.first_entry = static_cast<std::uint32_t>(offsets_.back());
    level.entries = static_cast<std::uint32_t>(entries);
    offsets_.push_back(offsets_.back() + entries);
  }
  table_ = HugeArray(static_cast<std::size_t>(offsets_.back() * options.features),
                     "the hash grid (lower its log2_table or levels)");
}

HashGridView HashGrid::view() const {
  HashGridView view;
  view.table = table_.data();
  view.levels = options_.levels;
  view.features = options_.features;
  for (std::size_t l = 0; l < levels_.size(); ++l) view.level[l] = levels_[l];
  return view;
}

void HashGrid::lookup(const Vec3f* p, int n, float* out, int stride) const {
  hash_grid_lookup(view(), p, n, out, stride, nullptr);
}

void HashGrid::lookup_record(const Vec3f* p, int n, float* out, int stride, std::vector<Tap>& taps) const {
  taps.resize(static_cast<std::size_t>(n) * static_cast<std::size_t>(options_.levels) * 8);
  hash_grid_lookup(view(), p, n, out, stride, taps.data());
}

}  // namespace octrad
