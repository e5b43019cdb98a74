#include "octrad/scene/curves.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "octrad/base/input_file.h"
#include "octrad/base/memory_limit.h"
#include "octrad/base/number_text.h"
#include "octrad/base/read_decimal.h"
#include "octrad/scene/limits.h"
#include "octrad/scene/source.h"

namespace octrad {
namespace {

constexpr double kHalfCircle = std::numbers::pi;

// A circle of vertices across `direction`. Where u leads from the centre to one of them, the normal there is along
// (bulge - radius (u . bend)) u - slope direction.
struct Ring {
  Vec3d center, direction;
  double radius = 0.0;
  double along = 0.0;  // texture coordinate; the other one goes around
  double bulge = 1.0, slope = 0.0;
  Vec3d bend{0.0, 0.0, 0.0};
  bool first = false;  // of a curve: not joined to the ring before it
};

double turn_between(Vec3d a, Vec3d b) {
  return length(a) > 0.0 && length(b) > 0.0 ? angle_between(normalize(a), normalize(b)) : 0.0;
}

// Steps of at most `step` for an angle, which points beyond all limits make a NaN.
int steps_for(double angle, double step) {
  const double steps = std::ceil(angle / step);
  return steps > 1.0 ? static_cast<int>(std::min(steps, 64.0)) : 1;
}

// Some direction across the unit vector d.
Vec3d across(Vec3d d) { return normalize(cross(d, std::fabs(d.x) < 0.7 ? Vec3d(1, 0, 0) : Vec3d(0, 1, 0))); }

class Rings {
 public:
  // `turn`: of a curve from ring to ring, in radians.
  Rings(std::size_t segments, double turn) : segments_(static_cast<double>(segments)), turn_(turn) {}

  // Spheres about the points, and the cones that touch two of them. A point where the last one was is left out.
  void add_linear(std::span<const CurvePoint> points) {
    Vec3d direction;
    double latitude = 0.0;  // of the circle where a cone touches its sphere
    const CurvePoint* last = nullptr;
    for (std::size_t i = 0; i + 1 < points.size(); ++i, ++segment_) {
      const CurvePoint &a = points[i], &b = points[i + 1];
      const double size = length(b.position - a.position);
      if (!(size > 0.0)) continue;
      const Vec3d d = (b.position - a.position) / size;
      // Where one sphere lies in the other there is no cone, and the larger one is nearly whole.
      const double touch = std::asin(std::clamp((a.radius - b.radius) / size, -0.999, 0.999));
      const auto along = static_cast<double>(segment_);
      if (last == nullptr) add_arc(a, d, d, -0.5 * kHalfCircle, touch, along + kArc, true);
      else add_arc(a, direction, d, latitude, touch, along, false);
      add_circle(b, d, touch, along + 1.0 - kArc, false);
      direction = d;
      latitude = touch;
      last = &b;
    }
    if (last != nullptr)
      add_arc(*last, direction, direction, latitude, 0.5 * kHalfCircle, static_cast<double>(segment_), false);
  }

  // Uniform cubic B-spline (de Boor 1978, "A Practical Guide to Splines"). Of a sweep of circles the normal is that of
  // c(u) + r(u) e(u, v): (|c'|^2 - r e . c'') e - r' c'.
  void add_bspline(std::span<const CurvePoint> points) {
    bool first = true;
    for (std::size_t i = 0; i + 3 < points.size(); ++i, ++segment_) {
      const CurvePoint* p = &points[i];
      // Of the control polygon, and of the outline that radii make. Points may lie on one another.
      double bend = 0.0, last_slope = 0.0;
      Vec3d last(0.0);
      for (int k = 0, edges = 0; k < 3; ++k) {
        const Vec3d edge = p[k + 1].position - p[k].position;
        const double l = length(edge), wider = p[k + 1].radius - p[k].radius;
        if (l == 0.0 && wider == 0.0) continue;
        const double slope = std::atan2(wider, l);
        if (edges++ > 0) bend += turn_between(last, edge) + std::fabs(slope - last_slope);
        if (l > 0.0) last = edge;
        last_slope = slope;
      }
      const int steps = steps_for(bend, turn_);
      for (int k = first ? 0 : 1; k <= steps; ++k) {
        const double u = static_cast<double>(k) / steps, v = 1.0 - u;
        const double b[4] = {v * v * v / 6.0, (3.0 * u * u * u - 6.0 * u * u + 4.0) / 6.0,
                             (3.0 * v * v * v - 6.0 * v * v + 4.0) / 6.0, u * u * u / 6.0};
        const double d[4] = {-0.5 * v * v, 1.5 * u * u - 2.0 * u, -1.5 * v * v + 2.0 * v, 0.5 * u * u};
        const double dd[4] = {v, 3.0 * u - 2.0, 3.0 * v - 2.0, u};
        Ring ring;
        Vec3d speed(0.0);
        double widening = 0.0;
        for (int j = 0; j < 4; ++j) {
          ring.center += p[j].position * b[j];
          ring.radius += p[j].radius * b[j];
          speed += p[j].position * d[j];
          widening += p[j].radius * d[j];
          ring.bend += p[j].position * dd[j];
        }
        const double l = length(speed);
        if (!(l > 0.0)) continue;  // points on one another
        ring.direction = speed / l;
        ring.bulge = l * l;
        ring.slope = widening * l;
        ring.along = (static_cast<double>(segment_) + u) / segments_;
        ring.first = first;
        first = false;
        add(ring);
      }
    }
  }

  const std::vector<Ring>& rings() const { return rings_; }

 private:
  void add(const Ring& ring) {
    meter_.add(2 * sizeof(Ring));
    rings_.push_back(ring);
  }
  void add_circle(const CurvePoint& p, Vec3d d, double latitude, double along, bool first) {
    Ring ring;
    ring.center = p.position + d * (p.radius * std::sin(latitude));
    ring.direction = d;
    ring.radius = p.radius * std::max(0.0, std::cos(latitude));
    ring.along = along / segments_;
    ring.bulge = std::max(0.0, std::cos(latitude));
    ring.slope = -std::sin(latitude);
    ring.first = first;
    add(ring);
  }
  // What an arc gets of the texture coordinate of a segment: some, so that the coordinates say where the curve runs.
  static constexpr double kArc = 1e-3;
  // On the sphere about p, from one circle to another: its directions turn from d0 to d1. It ends at `along`.
  void add_arc(const CurvePoint& p, Vec3d d0, Vec3d d1, double from, double to, double along, bool first) {
    const double turn = angle_between(d0, d1);
    const Vec3d rest = d1 - d0 * dot(d0, d1), side = length(rest) > 1e-9 ? normalize(rest) : across(d0);
    const int steps = steps_for(std::max(turn, std::fabs(to - from)), 2.0 * turn_);
    for (int k = first ? 0 : 1; k <= steps; ++k) {
      const double t = static_cast<double>(k) / steps;
      add_circle(p, k == steps ? d1 : d0 * std::cos(t * turn) + side * std::sin(t * turn), from + t * (to - from),
                 along - kArc * (1.0 - t), first && k == 0);
    }
  }

  std::vector<Ring> rings_;
  MemoryMeter meter_{"curves"};
  double segments_, turn_;
  std::size_t segment_ = 0;  // of all curves
};

// The angle of u about d, in turns, in Mitsuba's frame of curves, which looks for the z axis.
double turn_about(Vec3d d, Vec3d u) {
  const Vec3d z(0, 0, 1), rest = z - d * d.z;
  const Vec3d towards = length(rest) > 1e-9 ? normalize(rest) : Vec3d(0, 1, 0), from = cross(towards, d);
  return std::atan2(dot(towards, u), dot(from, u)) / (2.0 * kHalfCircle);
}

RawMesh make_tubes(const std::vector<Ring>& rings) {
  constexpr std::size_t kTriangles = 4'000'000, kFewest = 6, kMost = 48;
  const auto corners = static_cast<int>(std::clamp(kTriangles / (2 * rings.size() + 1), kFewest, kMost));
  const auto row = static_cast<std::size_t>(corners) + 1;  // the seam has two vertices
  const std::size_t vertices = rings.size() * row, triangles = 2 * rings.size() * static_cast<std::size_t>(corners);
  if (triangles > kMostMeshElements) throw InputError("the curves have too many points");
  ask_memory(vertices * (2 * sizeof(Vec3f) + sizeof(Vec2f)) + triangles * sizeof(Vec3i), "curves");
  RawMesh mesh;
  mesh.positions.reserve(vertices);
  mesh.normals.reserve(vertices);
  mesh.uvs.reserve(vertices);
  mesh.triangles.reserve(triangles);
  const double half = kHalfCircle / corners, wider = half / std::sin(half);  // of the area of a round tube
  Vec3d side(0.0);
  double turn = 0.0;
  for (const Ring& ring : rings) {
    const Vec3d d = ring.direction;
    // The first corner turns as little as it can from ring to ring.
    const Vec3d carried = side - d * dot(side, d);
    side = !ring.first && length(carried) > 1e-3 ? normalize(carried) : across(d);
    const Vec3d other = cross(d, side);
    const double here = turn_about(d, side);
    turn = ring.first ? here - std::floor(here) : here + std::round(turn - here);
    const auto begin = static_cast<int>(mesh.positions.size());
    for (int k = 0; k <= corners; ++k) {
      const double share = static_cast<double>(k) / corners, phi = 2.0 * kHalfCircle * share;
      const Vec3d u = side * std::cos(phi) + other * std::sin(phi);
      mesh.positions.push_back(Vec3f(ring.center + u * (ring.radius * wider)));
      mesh.normals.push_back(Vec3f(u * (ring.bulge - ring.radius * dot(u, ring.bend)) - d * ring.slope));
      mesh.uvs.push_back({static_cast<float>(turn + share), static_cast<float>(ring.along)});
    }
    if (ring.first) continue;
    for (int k = 0; k < corners; ++k) {
      const int a = begin - static_cast<int>(row) + k, b = begin + k;
      mesh.triangles.push_back({a, a + 1, b + 1});
      mesh.triangles.push_back({a, b + 1, b});
    }
  }
  return mesh;
}

}  // namespace

Curves parse_curves(const std::string& name, const std::string& text, CurveKind kind) {
  const std::size_t fewest = kind == CurveKind::linear ? 2 : 4;
  Curves curves;
  std::vector<CurvePoint> curve;
  MemoryMeter meter(name);
  std::size_t points = 0;
  const auto fail_at = [&](const char* where, const std::string& message) {
    fail(name, text, static_cast<std::size_t>(where - text.data()), message);
  };
  const char *p = text.data(), *const end = p + text.size();
  const auto skip_blanks = [&] {
    while (p < end && (*p == ' ' || *p == '\t' || *p == '\r')) ++p;
  };
  const auto finish = [&](const char* where) {
    if (curve.empty()) return;
    if (curve.size() < fewest)
      fail_at(where, "the curve before this has " + std::to_string(curve.size()) + " control points: it needs " +
                         std::to_string(fewest));
    curves.push_back(std::move(curve));
    curve.clear();
  };
  while (p < end) {
    skip_blanks();
    if (p == end || *p == '\n') {
      finish(p);
    } else {
      double numbers[4];
      for (double& value : numbers) {
        skip_blanks();
        const char* begin = p < end && *p == '+' ? p + 1 : p;
        const auto result = read_decimal(begin, end, value);
        if (result.ec != std::errc()) fail_at(p, "control point: expected a number (x y z radius)");
        if (!std::isfinite(value)) fail_at(p, "control point: the number is not finite");
        if (&value == &numbers[3] && value < 0.0) fail_at(p, "control point: the radius is negative");
        p = result.ptr;
      }
      meter.add(2 * sizeof(CurvePoint));
      curve.push_back({{numbers[0], numbers[1], numbers[2]}, numbers[3]});
      if (++points > kMostMeshElements) fail_at(p, "the file has too many control points");
      while (p < end && *p != '\n') ++p;
    }
    if (p < end) ++p;
  }
  finish(end);
  if (curves.empty()) fail_at(text.data(), "the file holds no curve");
  return curves;
}

Curves read_curves(const std::string& file, CurveKind kind) { return parse_curves(file, read_file(file), kind); }

std::string curves_text(const Curves& curves) {
  std::string text;
  for (const auto& curve : curves) {
    if (!text.empty()) text += '\n';
    for (const CurvePoint& p : curve) {
      for (const double v : {p.position.x, p.position.y, p.position.z}) text.append(number_text(v)).append(" ");
      text.append(number_text(p.radius)).append("\n");
    }
  }
  return text;
}

RawMesh make_curves(const Curves& curves, CurveKind kind, const Transform& to_world) {
  const bool linear = kind == CurveKind::linear;
  std::size_t points = 0;
  for (const auto& curve : curves) points += curve.size();
  const std::size_t segments = linear ? points - curves.size() : points - 3 * curves.size();
  // 5 degrees, and up to 40 where there are many points.
  Rings rings(segments, kHalfCircle / 36.0 * std::clamp(static_cast<double>(points) / 10000.0, 1.0, 8.0));
  for (std::vector<CurvePoint> curve : curves) {
    for (CurvePoint& p : curve) p.position = to_world.point(p.position);
    if (linear) rings.add_linear(curve);
    else rings.add_bspline(curve);
  }
  return make_tubes(rings.rings());
}

}  // namespace octrad
