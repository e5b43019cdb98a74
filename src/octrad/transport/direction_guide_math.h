// Directions of right-hand sides drawn by what arrived from them before (train.guide), for host and device.
//
// The scene's box is divided into kGuideSide^3 places, and each has six tables: of surfaces that face along +x, -x, +y,
// ... A table divides the sphere of world directions into kGuideParts parts and draws a part with a probability that is
// learnt from the samples of a training (method section 7, "Which direction").
#pragma once

#include <cstdint>

#include "octrad/base/guide_layout.h"
#include "octrad/device/launch.h"
#include "octrad/shading/bsdf_math.h"
#include "octrad/shading/place_grid_math.h"
#include "octrad/shading/shading_point.h"

namespace octrad {

// Rougher points are guided; what smoother ones reflect comes from where their BSDF looks.
inline constexpr float kGuideRoughness = 0.3f;

// One table's cumulative probabilities, as one point sees them.
struct Guide {
  const float* rows = nullptr;     // [kGuideRows]; null: no table, directions are drawn from the BSDF alone
  const float* columns = nullptr;  // [kGuideRows][kGuideColumns], of the parts of a row
  float share = 0.0f;              // of directions drawn from it

  OCTRAD_HD bool known() const { return rows != nullptr; }
  // Solid-angle density of the mixture of guide and BSDF, whose own density is `bsdf_pdf`.
  OCTRAD_HD float density(Vec3f direction, float bsdf_pdf) const;
};

struct GuideView {
  PlaceGrid places;
  float share = 0.0f;
  float unit = 1.0f;         // of radiance, about as bright as the scene
  float* rows = nullptr;     // of kGuideTables tables: Guide::rows; null: no guide. All 0 where one is not used
  float* columns = nullptr;  // likewise
  float* means = nullptr;    // [kGuideTables] of targets, when the table was made; 0: not known
  unsigned long long* squares = nullptr;  // [kGuideTables][kGuideParts] sums of what add_to_guide() makes of samples
  unsigned long long* bsdf_squares = nullptr;  // [kGuideTables] sums of what it makes of them for the BSDF alone
  unsigned long long* targets = nullptr;       // [kGuideTables] sums of targets, one for each sample
  unsigned long long* samples = nullptr;       // [kGuideTables] how many
};

namespace guide_detail {

// Around z directions are counted by quadrants and, in each, by y / (x + y): no trigonometry.
struct Place {
  float row, column;  // in [0, kGuideRows] and [0, kGuideColumns]
  float density;      // solid-angle density of a uniform (row, column)
};

// dt / d(angle) in a quadrant: 1 over its axes.
OCTRAD_HD inline float angle_density(float t) { return (1.0f - t) * (1.0f - t) + t * t; }

OCTRAD_HD inline float per_solid_angle(float t) {
  // d(row, column) / d(solid angle): rows / 2 along z, columns / 4 for each of t's units, dt / d(angle) around it
  return angle_density(t) * (0.125f * static_cast<float>(kGuideRows * kGuideColumns));
}

OCTRAD_HD inline Place place(Vec3f d) {
  const float x = d.x < 0.0f ? -d.x : d.x, y = d.y < 0.0f ? -d.y : d.y, sum = x + y;
  const float t = sum > 0.0f ? y / sum : 0.0f;
  const bool left = d.x < 0.0f, below = d.y < 0.0f;
  const int quadrant = left ? (below ? 2 : 1) : (below ? 3 : 0);
  const float along = left != below ? 1.0f - t : t;  // in the sense of rotation
  return {(d.z + 1.0f) * (0.5f * static_cast<float>(kGuideRows)),
          (static_cast<float>(quadrant) + along) * (0.25f * static_cast<float>(kGuideColumns)), per_solid_angle(t)};
}

OCTRAD_HD inline Vec3f direction(float row, float column) {
  const float turn = column * (4.0f / static_cast<float>(kGuideColumns));
  const int quadrant = static_cast<int>(lesser(turn, 3.0f));
  const float t = turn - static_cast<float>(quadrant);
  const float z = lesser(row * (2.0f / static_cast<float>(kGuideRows)) - 1.0f, 1.0f);
  const float radius = std::sqrt(greater(1.0f - z * z, 0.0f)) / std::sqrt(angle_density(t));
  const float a = (1.0f - t) * radius, b = t * radius;
  switch (quadrant) {
    case 0: return {a, b, z};
    case 1: return {-b, a, z};
    case 2: return {-a, -b, z};
    default: return {b, -a, z};
  }
}

OCTRAD_HD inline int whole(float at, int count) { return static_cast<int>(lesser(at, static_cast<float>(count - 1))); }

// What a cumulative table gives item i, and the item that u is in; u becomes its place there, in [0, 1).
OCTRAD_HD inline float probability(const float* cumulative, int i) {
  return cumulative[i] - (i > 0 ? cumulative[i - 1] : 0.0f);
}
OCTRAD_HD inline int pick(const float* cumulative, int count, float& u) {
  int i = 0;
  while (i + 1 < count && u >= cumulative[i]) ++i;
  const float p = probability(cumulative, i);
  u = p > 0.0f ? lesser(greater((u - cumulative[i] + p) / p, 0.0f), 0.99999994f) : 0.5f;
  return i;
}

// Where a surface faces.
OCTRAD_HD inline int axis(Vec3f n) {
  const float x = n.x < 0.0f ? -n.x : n.x, y = n.y < 0.0f ? -n.y : n.y, z = n.z < 0.0f ? -n.z : n.z;
  if (x >= y && x >= z) return n.x < 0.0f ? 1 : 0;
  if (y >= z) return n.y < 0.0f ? 3 : 2;
  return n.z < 0.0f ? 5 : 4;
}

OCTRAD_HD inline int part(const Place& at) {
  return whole(at.row, kGuideRows) * kGuideColumns + whole(at.column, kGuideColumns);
}

}  // namespace guide_detail

// Solid-angle density of the directions that a table draws.
OCTRAD_HD inline float guide_density(const float* rows, const float* columns, Vec3f direction) {
  using namespace guide_detail;
  const Place at = place(direction);
  const int row = whole(at.row, kGuideRows), column = whole(at.column, kGuideColumns);
  return probability(rows, row) * probability(columns + row * kGuideColumns, column) * at.density;
}

OCTRAD_HD inline Vec3f guide_direction(const float* rows, const float* columns, Vec2f u) {
  using namespace guide_detail;
  const int row = pick(rows, kGuideRows, u.y);
  const int column = pick(columns + row * kGuideColumns, kGuideColumns, u.x);
  return direction(static_cast<float>(row) + u.y, static_cast<float>(column) + u.x);
}

OCTRAD_HD inline float Guide::density(Vec3f direction, float bsdf_pdf) const {
  if (!known()) return bsdf_pdf;
  return share * guide_density(rows, columns, direction) + (1.0f - share) * bsdf_pdf;
}

// The table of a point that is guided, below 0 for others. `normal`: on the side of the viewer.
template <Models kModels = Models::all>
OCTRAD_HD inline int guide_table(const GuideView& guides, const ShadingPoint& point, Vec3f normal) {
  if (guides.rows == nullptr || is_delta_bsdf(point.bsdf)) return -1;
  if (roughness_bsdf<kModels>(point.bsdf) < kGuideRoughness) return -1;
  return guides.places.place(point.surface.position) * kGuideAxes + guide_detail::axis(normal);
}

OCTRAD_HD inline Guide guide_of(const GuideView& guides, int table) {
  if (table < 0) return {};
  const float* rows = guides.rows + table * kGuideRows;
  if (rows[kGuideRows - 1] <= 0.0f) return {};
  return {rows, guides.columns + table * kGuideParts, guides.share};
}

// What a direction of a guided point teaches, once the point's target is known.
struct GuideSample {
  int cell = 0;               // of GuideView::squares
  float scale = 0.0f;         // density of the direction over that inside its part; 0: the sample teaches nothing
  float bsdf_scale = 0.0f;    // the same over that of the BSDF
  float contribution = 0.0f;  // to the target, luminance
};

OCTRAD_HD inline GuideSample guide_sample(int table, Vec3f direction, float pdf, float bsdf_pdf) {
  const guide_detail::Place at = guide_detail::place(direction);
  return {table * kGuideParts + guide_detail::part(at), pdf / at.density, pdf / bsdf_pdf, 0.0f};
}

// Sums are whole numbers, so that their order does not matter.
inline constexpr float kGuideUnit = 0x1p20f;

// With the probabilities p of the parts and the densities k inside them, the squares of a sample's contribution g / q
// to a target have the mean sum_i (1 / p_i) integral_i g^2 / k, which is least for p_i in proportion to the root of
// that integral; (g / q)^2 q / k has the integral as its mean, and (g / q)^2 q / b the mean square of what a BSDF of
// density b draws alone. Relative to the mean target of the table and to the epsilon of the loss: a point's own target,
// which is large where one of its samples is, would hide just those samples that tables are for.
OCTRAD_HD inline void add_to_guide(const GuideView& guides, const GuideSample& sample, Vec3f target, float epsilon) {
  const int table = sample.cell / kGuideParts;
  const float mean = guides.means[table] > 0.0f ? guides.means[table] : luminance(target);
  const float relative = sample.contribution / (mean + epsilon);
  const float square = relative * relative;
  if (!(square * sample.scale > 0.0f)) return;
  const auto units = [](float s) { return static_cast<unsigned long long>(lesser(s, 0x1p20f) * kGuideUnit); };
  atomic_add(&guides.squares[sample.cell], units(square * sample.scale));
  atomic_add(&guides.bsdf_squares[table], units(square * sample.bsdf_scale));
}

// What a guided point teaches besides its samples.
OCTRAD_HD inline void add_to_guide(const GuideView& guides, int table, int directions, Vec3f target) {
  const float units = luminance(target) / guides.unit * kGuideUnit;
  const auto n = static_cast<unsigned long long>(directions);
  atomic_add(&guides.samples[table], n);
  if (units > 0.0f) atomic_add(&guides.targets[table], n * static_cast<unsigned long long>(lesser(units, 0x1p32f)));
}

// Tables are made anew every so many steps, and their sums multiplied by kGuideKept / 64 then: what was learnt
// 64 times as many steps ago counts 1 / e.
inline constexpr long long kGuideSteps = 64;
inline constexpr unsigned kGuideKept = 63;

// The mean square of what the BSDF draws alone, over that of what a table could, from which on tables are used.
inline constexpr float kGuideGain = 4.0f;

// Makes a table's probabilities of its sums.
OCTRAD_HD inline void make_guide_table(const GuideView& guides, int table) {
  constexpr unsigned long long kFewest = 1024;  // samples: of fewer, tables seem better than they are
  constexpr float kPrior = 16.0f;               // samples that count as if light came alike from everywhere
  unsigned long long& samples = guides.samples[table];
  unsigned long long* squares = guides.squares + table * kGuideParts;
  if (samples < kFewest) return;
  float total = 0.0f;
  for (int part = 0; part < kGuideParts; ++part) total += static_cast<float>(squares[part]);
  if (!(total > 0.0f)) return;
  guides.means[table] =
      static_cast<float>(guides.targets[table]) / static_cast<float>(samples) / kGuideUnit * guides.unit;
  // For light that comes alike from everywhere: a part's square is that of the cosine; their mean over the sphere is
  // 1/6.
  const float prior = total * kPrior / static_cast<float>(samples) * (6.0f / static_cast<float>(kGuideParts));
  const int axis = table % kGuideAxes;
  float* rows = guides.rows + table * kGuideRows;
  float* columns = guides.columns + table * kGuideParts;
  float sum = 0.0f;
  for (int row = 0; row < kGuideRows; ++row) {
    float of_row = 0.0f;
    for (int column = 0; column < kGuideColumns; ++column) {
      const int part = row * kGuideColumns + column;
      const Vec3f centre = guide_detail::direction(static_cast<float>(row) + 0.5f, static_cast<float>(column) + 0.5f);
      const float cosine = greater((axis % 2 == 0 ? 1.0f : -1.0f) * centre[axis / 2], 0.0f);
      of_row += std::sqrt(static_cast<float>(squares[part]) + prior * cosine * cosine);
      columns[part] = of_row;
    }
    for (int column = 0; column + 1 < kGuideColumns; ++column)
      columns[row * kGuideColumns + column] = of_row > 0.0f ? columns[row * kGuideColumns + column] / of_row : 0.0f;
    columns[(row + 1) * kGuideColumns - 1] = 1.0f;
    rows[row] = sum += of_row;
  }
  // Where light comes from everywhere, stratified samples of the BSDF alone are better.
  const bool worth = static_cast<float>(guides.bsdf_squares[table]) > kGuideGain * sum * sum;
  for (int row = 0; row < kGuideRows; ++row) rows[row] = !worth ? 0.0f : row + 1 < kGuideRows ? rows[row] / sum : 1.0f;
  const auto keep = [&](unsigned long long n) { return n / 64 * kGuideKept + n % 64 * kGuideKept / 64; };
  samples = keep(samples);
  guides.bsdf_squares[table] = keep(guides.bsdf_squares[table]);
  guides.targets[table] = keep(guides.targets[table]);
  for (int part = 0; part < kGuideParts; ++part) squares[part] = keep(squares[part]);
}

}  // namespace octrad
