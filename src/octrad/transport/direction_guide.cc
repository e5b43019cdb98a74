#include "octrad/transport/direction_guide.h"

#include <cmath>

#include "octrad/base/threads.h"
#include "octrad/shading/place_grid.h"
#include "octrad/transport/lhs_sampler.h"

namespace octrad {
namespace {

constexpr std::size_t kPoints = 4096;                                // drawn to find the box
constexpr unsigned long long kStream = (1ull << 62) + (1ull << 61);  // of their random numbers: no step's

}  // namespace

bool GuideState::valid() const {
  constexpr std::size_t tables = kGuideTables;
  if (rows.size() != tables * kGuideRows || columns.size() != tables * kGuideParts ||
      squares.size() != tables * kGuideParts || bsdf_squares.size() != tables || means.size() != tables ||
      targets.size() != tables || samples.size() != tables)
    return false;
  if (!(unit > 0.0f) || !std::isfinite(unit)) return false;
  for (int a = 0; a < 3; ++a)
    if (!std::isfinite(box.lower[a]) || !std::isfinite(box.upper[a]) || !(box.lower[a] <= box.upper[a])) return false;
  // A list rises to 1, or is 0: where the table is not used, and of rows that are not drawn.
  const auto rises = [](const float* list, int count, bool used) {
    for (int i = 0; i < count; ++i)
      if (!(list[i] >= (i == 0 ? 0.0f : list[i - 1])) || list[i] > 1.0f) return false;
    return list[count - 1] == 1.0f || (!used && list[count - 1] == 0.0f);
  };
  for (std::size_t table = 0; table < tables; ++table) {
    if (!(means[table] >= 0.0f) || !std::isfinite(means[table])) return false;
    const float* of_table = &rows[table * kGuideRows];
    if (!rises(of_table, kGuideRows, false)) return false;
    for (int row = 0; row < kGuideRows; ++row) {
      const bool used = guide_detail::probability(of_table, row) > 0.0f;
      if (!rises(&columns[table * kGuideParts + static_cast<std::size_t>(row * kGuideColumns)], kGuideColumns, used))
        return false;
    }
  }
  return true;
}

GuideView GuideState::view(float share) {
  if (empty()) return {};
  return {PlaceGrid(box, kGuideSide),
          share,
          unit,
          rows.data(),
          columns.data(),
          means.data(),
          squares.data(),
          bsdf_squares.data(),
          targets.data(),
          samples.data()};
}

GuideState make_guide(const Bounds3f& box, float unit) {
  constexpr std::size_t tables = kGuideTables;
  GuideState guide;
  guide.box = box;
  guide.unit = unit;
  guide.rows.resize(tables * kGuideRows);
  guide.columns.resize(tables * kGuideParts);
  guide.squares.resize(tables * kGuideParts);
  guide.means.resize(tables);
  for (auto* sums : {&guide.bsdf_squares, &guide.targets, &guide.samples}) sums->resize(tables);
  return guide;
}

Bounds3f guide_box(const LhsSampler& sampler) {
  std::vector<ShadingPoint> points(kPoints);
  sampler.sample(kStream, points);
  std::vector<Vec3f> positions;
  for (const ShadingPoint& point : points) positions.push_back(point.surface.position);
  return bounds_of_most(positions);
}

void make_guide_tables(const GuideView& guides) {
  parallel_blocks(kGuideTables, 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t table = begin; table < end; ++table) make_guide_table(guides, static_cast<int>(table));
  });
}

}  // namespace octrad
