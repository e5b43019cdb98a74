// Measured materials (Dupuy and Jakob 2018, "An Adaptive Parameterization for Efficient Material Acquisition and
// Rendering") as Mitsuba's `measured` has them: reflection as a table over the places that a sample of the visible
// normals comes from. The tables: scene/measured_tables.h.
#pragma once

#include "octrad/shading/material_record.h"

namespace octrad {

// The last cell, of those before point `last`, that does not begin after x: point i is at begin(i), which ascends.
template <typename Begin>
OCTRAD_HD inline int measured_cell(int last, float x, const Begin& begin) {
  int i = 0;
  while (last - i > 1) {
    const int middle = (i + last) / 2;
    if (begin(middle) <= x) i = middle;
    else last = middle;
  }
  return i;
}

// Between which nodes the direction to the viewer lies.
struct MeasuredNodes {
  int first = 0;                   // node before in phi and theta
  int next_phi = 0;                // from a node to the next one in phi; in theta they follow one another
  float phi = 0.0f, theta = 0.0f;  // how far the direction is on the way to it

  OCTRAD_HD MeasuredNodes() = default;  // of a grid that is the same for all
  OCTRAD_HD MeasuredNodes(const MeasuredView& m, float phi_o, float theta_o) {
    const MeasuredLayout& l = m.layout;
    const int i = place(m.data + l.phi, l.phi_count, phi_o, phi);
    const int j = place(m.data + l.theta, l.theta_count, theta_o, theta);
    first = i * l.theta_count + j;
    next_phi = l.theta_count;
  }
  // The last node that is not after x, and how far x is from there to the next one; 0 where there is none.
  OCTRAD_HD static int place(const float* nodes, int count, float x, float& way) {
    const int i = measured_cell(count - 1, x, [&](int k) { return nodes[k]; });
    if (count > 1) way = lesser(greater((x - nodes[i]) / (nodes[i + 1] - nodes[i]), 0.0f), 1.0f);
    return i;
  }

  // Item i of a table of `size` items a node.
  OCTRAD_HD float at(const float* table, std::size_t size, std::size_t i) const {
    const float* const here = table + static_cast<std::size_t>(first) * size + i;
    const float before = along_phi(here, size);
    if (theta == 0.0f) return before;
    return before + theta * (along_phi(here + size, size) - before);
  }

 private:
  OCTRAD_HD float along_phi(const float* here, std::size_t size) const {
    return phi == 0.0f ? here[0] : here[0] + phi * (here[static_cast<std::size_t>(next_phi) * size] - here[0]);
  }
};

// A cell of a grid, and a place in it.
struct MeasuredCell {
  int x, y;
  float u, v;
  OCTRAD_HD MeasuredCell(const MeasuredGrid& g, Vec2f place) {
    u = lesser(greater(place.x, 0.0f), 1.0f) * static_cast<float>(g.width - 1);
    v = lesser(greater(place.y, 0.0f), 1.0f) * static_cast<float>(g.height - 1);
    x = lesser(static_cast<int>(u), g.width - 2);
    y = lesser(static_cast<int>(v), g.height - 2);
    u -= static_cast<float>(x);
    v -= static_cast<float>(y);
  }
};

// The value in a cell, of table `i` of the `count` that each node has.
OCTRAD_HD inline float measured_value(const float* values, const MeasuredGrid& g, const MeasuredNodes& nodes,
                                      const MeasuredCell& c, std::size_t i = 0, std::size_t count = 1) {
  const auto width = static_cast<std::size_t>(g.width), size = width * static_cast<std::size_t>(g.height);
  const std::size_t at = i * size + static_cast<std::size_t>(c.y) * width + static_cast<std::size_t>(c.x);
  const auto value = [&](std::size_t k) { return nodes.at(values, count * size, k); };
  return lerp(lerp(value(at), value(at + 1), c.u), lerp(value(at + width), value(at + width + 1), c.u), c.v);
}

struct MeasuredPlace {
  Vec2f place;
  float density;
};

// A density over the unit square, that of the nodes' mean: sampled by inverting the integral over rows, then that in
// the row.
struct MeasuredDensityAt {
  const float *values, *rows, *columns;
  MeasuredDensity grid;
  MeasuredNodes nodes;
  OCTRAD_HD MeasuredDensityAt(const float* data, const MeasuredDensity& d, const MeasuredNodes& n)
      : values(data + d.values),
        rows(data + d.rows),
        columns(data + d.columns),
        grid(d),
        nodes(n) {}

  OCTRAD_HD float value(const MeasuredCell& c) const {
    return measured_value(values, grid, nodes, c) * static_cast<float>((grid.width - 1) * (grid.height - 1));
  }

  OCTRAD_HD MeasuredPlace sample(Vec2f u) const {
    const int y = measured_cell(grid.height - 1, u.y, [&](int k) { return row(k); });
    const float v = inverse(row_density(y), row_density(y + 1), u.y - row(y));
    const float left = u.x * lerp(row_density(y), row_density(y + 1), v);
    const int x = measured_cell(grid.width - 1, left, [&](int k) { return column(k, y, v); });
    MeasuredCell c(grid, {0.0f, 0.0f});
    c.x = x;
    c.y = y;
    c.v = v;
    c.u = inverse(edge(x, y, v), edge(x + 1, y, v), left - column(x, y, v));
    return {{(static_cast<float>(x) + c.u) / static_cast<float>(grid.width - 1),
             (static_cast<float>(y) + c.v) / static_cast<float>(grid.height - 1)},
            value(c)};
  }

  // What sample() makes `place` of.
  OCTRAD_HD MeasuredPlace invert(Vec2f place) const {
    const MeasuredCell c(grid, place);
    const float a = edge(c.x, c.y, c.v), b = edge(c.x + 1, c.y, c.v);
    const float r0 = row_density(c.y), r1 = row_density(c.y + 1), whole = lerp(r0, r1, c.v);
    const float before = column(c.x, c.y, c.v) + c.u * (a + 0.5f * c.u * (b - a));
    return {{whole > 0.0f ? before / whole : 0.5f, row(c.y) + c.v * (r0 + 0.5f * c.v * (r1 - r0))}, value(c)};
  }

 private:
  // t with a t + (b - a) t^2 / 2 = integral.
  OCTRAD_HD static float inverse(float a, float b, float integral) {
    const float root = a + std::sqrt(greater(a * a + 2.0f * integral * (b - a), 0.0f));
    return root > 0.0f ? lesser(greater(2.0f * integral / root, 0.0f), 1.0f) : 0.5f;
  }
  OCTRAD_HD std::size_t width() const { return static_cast<std::size_t>(grid.width); }
  OCTRAD_HD std::size_t size() const { return width() * static_cast<std::size_t>(grid.height); }
  OCTRAD_HD std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * width() + static_cast<std::size_t>(x);
  }
  OCTRAD_HD float row(int y) const {
    return nodes.at(rows, static_cast<std::size_t>(grid.height), static_cast<std::size_t>(y));
  }
  OCTRAD_HD float row_density(int y) const { return nodes.at(columns, size(), index(grid.width - 1, y)); }
  OCTRAD_HD float column(int x, int y, float v) const {
    return lerp(nodes.at(columns, size(), index(x, y)), nodes.at(columns, size(), index(x, y + 1)), v);
  }
  OCTRAD_HD float edge(int x, int y, float v) const {
    return lerp(nodes.at(values, size(), index(x, y)), nodes.at(values, size(), index(x, y + 1)), v);
  }
};

// The unit square of directions: theta along x, phi along y.
struct MeasuredAngles {
  float theta, phi;
  OCTRAD_HD explicit MeasuredAngles(Vec3f d) : phi(std::atan2(d.y, d.x)) {
    const float chord = std::sqrt(d.x * d.x + d.y * d.y + (d.z - 1.0f) * (d.z - 1.0f));
    theta = 2.0f * std::asin(lesser(0.5f * chord, 1.0f));
  }
  OCTRAD_HD Vec2f place(float from_phi) const {
    const float y = (phi - from_phi + kPi) * (0.5f * kInvPi);
    return {std::sqrt(theta * (2.0f * kInvPi)), y};
  }
};

// What depends on the direction to the viewer.
struct MeasuredAtView {
  const MeasuredView& m;
  Vec3f turn{1.0f, 1.0f, 1.0f};  // to the part that the nodes cover
  Vec3f wo;
  float theta, phi;
  MeasuredNodes nodes;

  OCTRAD_HD MeasuredAtView(const MeasuredView& material, Vec3f to_viewer) : m(material), wo(to_viewer) {
    if (m.layout.symmetry >= 2) {
      const float y = wo.y, x = m.layout.symmetry == 4 ? wo.x : y;
      turn = {-std::copysign(1.0f, x), -std::copysign(1.0f, y), 1.0f};  // 0 as well: atan2() asks for its sign
      wo = wo * turn;
    }
    const MeasuredAngles angles(wo);
    theta = angles.theta;
    phi = angles.phi;
    nodes = MeasuredNodes(m, phi, theta);
  }
  OCTRAD_HD float from_phi() const { return m.layout.isotropic ? phi : 0.0f; }
  OCTRAD_HD MeasuredDensityAt visible_normals() const { return {m.data, m.layout.visible_normals, nodes}; }
  OCTRAD_HD MeasuredDensityAt luminance() const { return {m.data, m.layout.luminance, nodes}; }

  // The value of half vector h at `normal` on the grid of normals, which `place` of the square becomes; `density`: of
  // both samples there.
  OCTRAD_HD BsdfValue value(Vec3f h, Vec2f normal, Vec2f place, float density) const {
    const MeasuredLayout& l = m.layout;
    BsdfValue out;
    const MeasuredCell cell(l.luminance, place);
    for (std::size_t i = 0; i < 3; ++i) {
      out.value[static_cast<int>(i)] = measured_value(m.data + l.rgb, l.luminance, nodes, cell, i, 3);
    }
    if (l.is_density) {
      const MeasuredNodes all;
      const Vec2f viewer{std::sqrt(theta * (2.0f * kInvPi)), (phi + kPi) * (0.5f * kInvPi)};
      const float common = measured_value(m.data + l.normals.values, l.normals, all, MeasuredCell(l.normals, normal));
      const float area = measured_value(m.data + l.area.values, l.area, all, MeasuredCell(l.area, viewer));
      out.value *= area > 1e-6f ? common / (4.0f * area) : 0.0f;
    }
    const float sin = std::sqrt(h.x * h.x + h.y * h.y);
    const float solid_angle = greater(2.0f * kPi * kPi * normal.x * sin, 1e-6f) * 4.0f * dot(wo, h);
    out.pdf = lesser(density / solid_angle, 1e30f);
    return out;
  }
};

OCTRAD_HD_APART inline BsdfValue evaluate_measured(const MaterialRecord& record, Vec3f wo, Vec3f wi) {
  if (!(wo.z > 0.0f && wi.z > 0.0f)) return {};
  const MeasuredAtView view(record.measured, wo);
  const Vec3f h = normalize(view.wo + wi * view.turn);
  if (!(dot(view.wo, h) > 0.0f)) return {};
  Vec2f normal = MeasuredAngles(h).place(view.from_phi());
  normal.y -= std::floor(normal.y);
  const MeasuredPlace at = view.visible_normals().invert(normal);
  const MeasuredCell cell(record.measured.layout.luminance, at.place);
  return view.value(h, normal, at.place, at.density * view.luminance().value(cell));
}

OCTRAD_HD_APART inline BsdfSample sample_measured(const MaterialRecord& record, Vec3f wo, Vec2f u) {
  BsdfSample s;
  if (!(wo.z > 0.0f)) return s;
  const MeasuredAtView view(record.measured, wo);
  const MeasuredPlace place = view.luminance().sample(u);
  const MeasuredPlace normal = view.visible_normals().sample(place.place);
  const float theta = normal.place.x * normal.place.x * (0.5f * kPi);
  const float phi = (2.0f * normal.place.y - 1.0f) * kPi + view.from_phi();
  const float sin = std::sin(theta);
  const Vec3f h(sin * std::cos(phi), sin * std::sin(phi), std::cos(theta));
  const float cos = dot(view.wo, h);
  const Vec3f wi = h * (2.0f * cos) - view.wo;
  if (!(cos > 0.0f && wi.z > 0.0f)) return s;
  const BsdfValue v = view.value(h, normal.place, place.place, place.density * normal.density);
  if (!(v.pdf > 0.0f)) return s;
  s.wi = wi * view.turn;
  s.weight = v.value / v.pdf;
  s.pdf = v.pdf;
  s.valid = max_component(s.weight) < 1e10f;  // tables of which one has nothing where the other has much
  return s;
}

struct MeasuredModel {
  static constexpr bool kDeltaOnly = false;

  OCTRAD_HD static BsdfValue evaluate(const Bsdf& b, Vec3f wo, Vec3f wi) {
    return evaluate_measured(*b.record, wo, wi);
  }
  OCTRAD_HD static BsdfSample sample(const Bsdf& b, Vec3f wo, float, Vec2f u) {
    return sample_measured(*b.record, wo, u);
  }
  // Albedo and roughness of the tables, as Materials has found them.
  OCTRAD_HD static Vec3f albedo(const Bsdf& b) { return b.specular_reflectance; }
  OCTRAD_HD static float roughness(const Bsdf& b) { return b.alpha_u; }
};

}  // namespace octrad
