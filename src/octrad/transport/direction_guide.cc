#include "octrad/transport/direction_guide.h"

#include <cmath>

#include "octrad/base/threads.h"
#include "octrad/transport/lhs_sampler.h"

namespace octrad {
namespace {

constexpr std::size_t kPoints = 4096;                                // drawn to find the box
constexpr unsigned long long kStream = (1ull << 62) + (1ull << 61);  // of their random numbers: no step's

}  // namespace

std::size_t GuideState::bytes() {
  return static_cast<std::size_t>(kGuideTables) *
         (sizeof(float) * (kGuideRows + kGuideParts + 1) + sizeof(unsigned long long) * (kGuideParts + 3));
}

bool GuideState::valid() const {
  constexpr std::size_t tables = kGuideTables;
  if (rows.size() != tables * kGuideRows || columns.size() != tables * kGuideParts ||
      squares.size() != tables * kGuideParts || alone.size() != tables || means.size() != tables ||
      targets.size() != tables || samples.size() != tables)
    return false;
  for (int a = 0; a < 3; ++a)
    if (!(unit > 0.0f) || !std::isfinite(unit) || !std::isfinite(box.lower[a]) || !std::isfinite(box.upper[a]) ||
        !(box.lower[a] <= box.upper[a]))
      return false;
  // Each list rises to 1, or is 0 where nothing is known.
  const auto rises = [](const std::vector<float>& lists, std::size_t count) {
    for (std::size_t i = 0; i < lists.size(); ++i) {
      const float before = i % count == 0 ? 0.0f : lists[i - 1];
      if (!(lists[i] >= before) || lists[i] > 1.0f) return false;
      if (i % count == count - 1 && lists[i] != 1.0f && lists[i] != 0.0f) return false;
    }
    return true;
  };
  for (const float mean : means)
    if (!(mean >= 0.0f)) return false;
  return rises(rows, kGuideRows) && rises(columns, kGuideColumns);
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
          alone.data(),
          targets.data(),
          samples.data()};
}

GuideState make_guide(const LhsSampler& sampler, float unit) {
  std::vector<ShadingPoint> points(kPoints);
  sampler.sample(kStream, points);
  std::vector<Vec3f> positions;
  for (const ShadingPoint& point : points) positions.push_back(point.surface.position);
  constexpr std::size_t tables = kGuideTables;
  GuideState guide;
  guide.box = bounds_of_most(positions);
  guide.unit = unit;
  guide.rows.resize(tables * kGuideRows);
  guide.columns.resize(tables * kGuideParts);
  guide.squares.resize(tables * kGuideParts);
  guide.means.resize(tables);
  for (auto* sums : {&guide.alone, &guide.targets, &guide.samples}) sums->resize(tables);
  return guide;
}

void make_guide_tables(const GuideView& guides, unsigned kept) {
  parallel_blocks(kGuideTables, 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t table = begin; table < end; ++table) make_guide_table(guides, static_cast<int>(table), kept);
  });
}

}  // namespace octrad
