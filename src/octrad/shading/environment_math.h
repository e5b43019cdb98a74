// Evaluation and importance sampling of a latitude-longitude environment, from the tables that EnvironmentMap makes:
// for host and device. The layout is described in shading/environment_map.h.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "octrad/base/rng.h"
#include "octrad/shading/place_grid_math.h"

namespace octrad {

// An entry of an alias table (Walker 1977): itself with probability `keep`, otherwise `other`.
struct AliasEntry {
  float keep;
  int other;
};

// Parts of a map, whose probabilities depend on the place that is lit: columns of longitude and rows of latitude.
inline constexpr int kEnvironmentColumns = 16, kEnvironmentRows = 8,
                     kEnvironmentParts = kEnvironmentColumns * kEnvironmentRows;

struct EnvironmentView {
  const Vec3f* pixels = nullptr;  // [height][width]; null: no environment
  int width = 0, height = 0;
  float to_world_rows[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};  // and back; not unit for a unit vector unless it rotates
  float to_map_rows[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  bool rotates = true;       // or mirrors: keeps solid angles
  float determinant = 1.0f;  // of to_map_rows, absolute
  // For maps of two rows and more; others are sampled uniformly. A cell lies between four pixels.
  const float* sines = nullptr;       // [height] sin(theta) of the rows of pixels
  const AliasEntry* rows = nullptr;   // of cells, in each part: [kEnvironmentColumns (height - 1)], part after part
  const AliasEntry* cells = nullptr;  // [height - 1][width]: those of a row that are in one part
  PlaceGrid places;
  const AliasEntry* parts = nullptr;  // [places.count()][kEnvironmentParts]; null: black
  const float* densities = nullptr;   // likewise: density in (u, v) = weight x this

  OCTRAD_HD Vec3f to_world(Vec3f v) const {
    const float* m = to_world_rows;
    return {m[0] * v.x + m[1] * v.y + m[2] * v.z, m[3] * v.x + m[4] * v.y + m[5] * v.z,
            m[6] * v.x + m[7] * v.y + m[8] * v.z};
  }
  OCTRAD_HD Vec3f to_map(Vec3f v) const {
    const float* m = to_map_rows;
    return {m[0] * v.x + m[1] * v.y + m[2] * v.z, m[3] * v.x + m[4] * v.y + m[5] * v.z,
            m[6] * v.x + m[7] * v.y + m[8] * v.z};
  }
  OCTRAD_HD Vec3f texel(int x, int y) const {
    return pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)];
  }
  // Makes `v`, a direction in the world taken to the map, unit there; returns the solid angle in the map for one in the
  // world: |det A| / |A d|^3 for the linear map A and a unit direction d.
  OCTRAD_HD float normalize_in_map(Vec3f& v) const {
    if (rotates) return 1.0f;
    const float l = length(v);
    v = v / l;
    return determinant / (l * l * l);
  }
  // Luminance times sin(theta) at a pixel.
  OCTRAD_HD float weight(int x, int y) const {
    const float l = luminance(texel(x, y));
    return l > 0.0f ? l * sines[y] : 0.0f;
  }
  // First column of cells of a column of parts, and first row.
  OCTRAD_HD int first_column(int part_column) const { return part_column * width / kEnvironmentColumns; }
  OCTRAD_HD int first_row(int part_row) const { return part_row * (height - 1) / kEnvironmentRows; }
  // The part that a cell is in.
  OCTRAD_HD int part(int x, int y) const {
    const auto last = [](int at, int count, int size) { return (at * count + count - 1) / size; };
    return last(y, kEnvironmentRows, height - 1) * kEnvironmentColumns + last(x, kEnvironmentColumns, width);
  }
};

struct EnvironmentSample {
  Vec3f direction;
  Vec3f radiance;
  float pdf = 0.0f;
};

namespace environment_detail {

struct Cell {
  int x, y;      // lower corner
  float fx, fy;  // position inside, [0, 1]
};

// Position in [0, 1] of a linear density from a (at 0) to b (at 1), by inversion of its integral.
OCTRAD_HD inline float sample_linear(float a, float b, float u) {
  const float s = a + b;
  if (!(s > 0.0f)) return u;
  if (std::fabs(a - b) < 1e-4f * s) {  // nearly constant: avoid cancellation
    return u;
  }
  const float scale = a + std::sqrt(lerp(a * a, b * b, u));
  return scale > 0.0f ? std::min(u * s / scale, 1.0f) : 0.0f;  // 0: u and a are
}

OCTRAD_HD inline Vec2f direction_to_uv(Vec3f d) {
  const float u = std::atan2(d.x, -d.z) * (0.5f * kInvPi);
  const float v = std::atan2(std::sqrt(d.x * d.x + d.z * d.z), d.y) * kInvPi;  // acos(y), accurate at the poles
  return {u - std::floor(u), v};
}

OCTRAD_HD inline Cell cell(const EnvironmentView& e, Vec2f uv) {
  const float w = static_cast<float>(e.width);
  float x = uv.x * w - 0.5f;
  if (x < 0.0f) x += w;
  const float y = uv.y * static_cast<float>(e.height - 1);
  Cell c;
  c.x = std::clamp(static_cast<int>(x), 0, e.width - 1);
  c.y = std::clamp(static_cast<int>(y), 0, e.height - 2);
  c.fx = std::clamp(x - static_cast<float>(c.x), 0.0f, 1.0f);
  c.fy = std::clamp(y - static_cast<float>(c.y), 0.0f, 1.0f);
  return c;
}

OCTRAD_HD inline float bilinear_weight(const EnvironmentView& e, const Cell& c) {
  const int n = c.x + 1 == e.width ? 0 : c.x + 1;
  return lerp(lerp(e.weight(c.x, c.y), e.weight(n, c.y), c.fx),
              lerp(e.weight(c.x, c.y + 1), e.weight(n, c.y + 1), c.fx), c.fy);
}

OCTRAD_HD inline Vec3f bilinear_radiance(const EnvironmentView& e, const Cell& c) {
  const int n = c.x + 1 == e.width ? 0 : c.x + 1;
  return (e.texel(c.x, c.y) * (1.0f - c.fx) + e.texel(n, c.y) * c.fx) * (1.0f - c.fy) +
         (e.texel(c.x, c.y + 1) * (1.0f - c.fx) + e.texel(n, c.y + 1) * c.fx) * c.fy;
}

}  // namespace environment_detail

// Draws an index below `count`; `u` is replaced by its uniform remainder.
OCTRAD_HD inline int pick_alias(const AliasEntry* table, int count, float& u) {
  constexpr float kOneMinus = 0.99999994f;
  const float x = u * static_cast<float>(count);
  const int i = std::min(static_cast<int>(x), count - 1);
  const float rest = std::min(x - static_cast<float>(i), kOneMinus);
  const AliasEntry a = table[i];
  const bool kept = rest < a.keep;
  u = std::min(choose(kept, rest, rest - a.keep) / choose(kept, a.keep, 1.0f - a.keep), kOneMinus);
  return kept ? i : a.other;
}

OCTRAD_HD inline Vec3f environment_radiance(const EnvironmentView& e, Vec3f direction) {
  using namespace environment_detail;
  if (e.height < 2) {
    if (e.width == 1) return e.pixels[0];
    const Vec2f uv = direction_to_uv(e.to_map(direction));
    const float x = uv.x * static_cast<float>(e.width) - 0.5f;
    const int i = static_cast<int>(std::floor(x));
    const float f = x - static_cast<float>(i);
    return e.pixels[(i + e.width) % e.width] * (1.0f - f) + e.pixels[(i + 1) % e.width] * f;
  }
  return bilinear_radiance(e, cell(e, direction_to_uv(e.to_map(direction))));
}

// The part of the map, of two rows and more, that a direction is in.
OCTRAD_HD inline int environment_part(const EnvironmentView& e, Vec3f direction) {
  const environment_detail::Cell c =
      environment_detail::cell(e, environment_detail::direction_to_uv(e.to_map(direction)));
  return e.part(c.x, c.y);
}

namespace environment_detail {

// Density in (u, v) at a point of a cell, seen from a place.
OCTRAD_HD inline float cell_density(const EnvironmentView& e, int place, const Cell& c) {
  return e.densities[place * kEnvironmentParts + e.part(c.x, c.y)] * bilinear_weight(e, c);
}

// Where a direction looks in a map of two rows and more, and what makes densities in (u, v) there those per solid
// angle.
struct Look {
  Cell cell;
  float sin_theta, stretch;

  OCTRAD_HD Look(const EnvironmentView& e, Vec3f direction) {
    Vec3f d = e.to_map(direction);
    stretch = e.normalize_in_map(d);
    sin_theta = std::sqrt(d.x * d.x + d.z * d.z);
    cell = environment_detail::cell(e, direction_to_uv(d));
  }
  OCTRAD_HD float per_solid_angle(float density) const {
    return sin_theta > 0.0f ? density / (2.0f * kPi * kPi * sin_theta) * stretch : 0.0f;
  }
};

}  // namespace environment_detail

// Radiance along `direction`, and the solid-angle density with which sample_environment() draws it from `p`.
OCTRAD_HD inline Vec3f environment_radiance(const EnvironmentView& e, Vec3f p, Vec3f direction, float& density) {
  using namespace environment_detail;
  if (e.height < 2) {
    density = 0.25f * kInvPi;
    return environment_radiance(e, direction);
  }
  const Look look(e, direction);
  density = look.per_solid_angle(cell_density(e, e.places.place(p), look.cell));
  return bilinear_radiance(e, look.cell);
}

// The density alone.
OCTRAD_HD inline float environment_pdf(const EnvironmentView& e, Vec3f p, Vec3f direction) {
  if (e.height < 2) return 0.25f * kInvPi;
  const environment_detail::Look look(e, direction);
  return look.per_solid_angle(environment_detail::cell_density(e, e.places.place(p), look.cell));
}

// A cell of a map of two rows and more, drawn for light that arrives at a place: its row (pick_row()), then its column.
struct EnvironmentPick {
  int place = 0;
  int x = 0, y = 0;  // the cell; before its column is drawn, the first of `columns` in that row that are in one part
  int columns = 0;
  Vec2f u;  // what is left of the random numbers
};

OCTRAD_HD inline EnvironmentPick pick_row(const EnvironmentView& e, Vec3f p, Vec2f u) {
  EnvironmentPick pick;
  pick.place = e.places.place(p);
  pick.u = u;
  const int part = pick_alias(e.parts + pick.place * kEnvironmentParts, kEnvironmentParts, pick.u.y);
  const int column = part % kEnvironmentColumns, row = part / kEnvironmentColumns;
  const int y0 = e.first_row(row), rows = e.first_row(row + 1) - y0;
  pick.x = e.first_column(column);
  pick.columns = e.first_column(column + 1) - pick.x;
  const AliasEntry* table = e.rows + static_cast<std::size_t>(y0) * kEnvironmentColumns + column * rows;
  pick.y = y0 + pick_alias(table, rows, pick.u.y);
  return pick;
}

OCTRAD_HD inline void pick_column(const EnvironmentView& e, EnvironmentPick& pick) {
  const std::size_t first = static_cast<std::size_t>(pick.y) * static_cast<std::size_t>(e.width);
  pick.x += pick_alias(e.cells + first + pick.x, pick.columns, pick.u.x);
}

// A direction of the bilinear density inside the cell.
OCTRAD_HD inline EnvironmentSample sample_cell(const EnvironmentView& e, const EnvironmentPick& pick) {
  using namespace environment_detail;
  EnvironmentSample s;
  Cell c;
  c.x = pick.x;
  c.y = pick.y;
  const int n = c.x + 1 == e.width ? 0 : c.x + 1;
  const float w00 = e.weight(c.x, c.y), w10 = e.weight(n, c.y), w01 = e.weight(c.x, c.y + 1),
              w11 = e.weight(n, c.y + 1);
  c.fy = sample_linear(w00 + w10, w01 + w11, pick.u.y);
  c.fx = sample_linear(lerp(w00, w01, c.fy), lerp(w10, w11, c.fy), pick.u.x);
  const Vec2f phi = circle_point((static_cast<float>(c.x) + c.fx + 0.5f) / static_cast<float>(e.width));
  const Vec2f theta = circle_point(0.5f * (static_cast<float>(c.y) + c.fy) / static_cast<float>(e.height - 1));
  const float sin_theta = theta.y;
  if (!(sin_theta > 0.0f)) return s;
  s.direction = e.to_world({phi.y * sin_theta, theta.x, -phi.x * sin_theta});
  s.radiance = bilinear_radiance(e, c);
  s.pdf = cell_density(e, pick.place, c) / (2.0f * kPi * kPi * sin_theta);
  if (!e.rotates) {
    s.direction = normalize(s.direction);
    Vec3f d = e.to_map(s.direction);
    s.pdf *= e.normalize_in_map(d);
  }
  return s;
}

// Draws a direction for light that arrives at `p`: a part, a cell in it in proportion to its integral (its four
// corners' mean), then a point in it. The remainder of each random number is used again.
OCTRAD_HD inline EnvironmentSample sample_environment(const EnvironmentView& e, Vec3f p, Vec2f u) {
  EnvironmentSample s;
  if (e.height < 2) {
    s.direction = uniform_direction(u);
    s.pdf = 0.25f * kInvPi;
    s.radiance = environment_radiance(e, s.direction);
    return s;
  }
  if (e.parts == nullptr) return s;  // black
  EnvironmentPick pick = pick_row(e, p, u);
  pick_column(e, pick);
  return sample_cell(e, pick);
}

}  // namespace octrad
