#include "app/selftest/ground.h"

#include <cmath>

#include "octrad/geometry/bvh8_math.h"

namespace octrad::selftest {
namespace {

// A ray at a time through a tree that somebody else keeps.
class TreeTracer final : public Tracer {
 public:
  explicit TreeTracer(const Bvh8View& tree) : tree_(tree) {}
  using Tracer::intersect;
  using Tracer::occluded;
  Hit intersect(Vec3f origin, Vec3f direction, float t_min, float t_max) const override {
    return bvh8_intersect(tree_, origin, direction, t_min, t_max);
  }
  bool occluded(Vec3f origin, Vec3f direction, float t_min, float t_max) const override {
    return bvh8_occluded(tree_, origin, direction, t_min, t_max);
  }

 private:
  Bvh8View tree_;
};

}  // namespace

Ground::Ground(const Context& c, cli::LoadedScene make())
    : own(c.loaded ? cli::LoadedScene{} : make()),
      use(c.loaded ? *c.loaded : own),
      own_bvh(c.loaded ? Bvh8{} : build_bvh8(*use.scene)),
      bvh(c.loaded ? c.bvh : own_bvh),
      tracer(std::make_unique<TreeTracer>(bvh.view())),
      context{*use.scene, *tracer, *use.materials, *use.lights} {}

void Estimates::add(Vec3f found, Vec3f expected) {
  constexpr double kSmall = 5e-3;  // below which errors count as absolute
  errors_.add(static_cast<double>(length(found - expected)) /
              (static_cast<double>(length(found)) + static_cast<double>(length(expected)) + kSmall));
  const double a = static_cast<double>(luminance(found)), b = static_cast<double>(luminance(expected));
  ++items_;
  sum_ += a - b;
  square_ += (a - b) * (a - b);
  size_ += std::fabs(b);
}

CheckResult Estimates::result(const Context& c, std::string what, double tolerance, double allowed_share) {
  CheckResult r = errors_.result(std::move(what), c.stream.on_device() ? tolerance : 1e-6,
                                 c.stream.on_device() ? allowed_share : 0.0);
  // Items that went their own way differ at random: their mean by 5 of its standard errors, seldom more.
  const double standard = std::sqrt(square_), off = std::fabs(sum_) / (5.0 * standard + 1e-3 * size_ + 1e-30);
  if (!(off <= 1.0)) {
    r.passed = false;
    r.error += "; their means differ";
  }
  for (const auto& [found, expected] : counts_) {
    if (std::fabs(found - expected) <= (c.stream.on_device() ? 0.01 * expected : 0.0)) continue;
    r.passed = false;
    r.error += "; other counts";
    break;
  }
  return r;
}

}  // namespace octrad::selftest
