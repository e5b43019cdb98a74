#include "app/selftest/ground.h"

#include <cmath>

namespace octrad::selftest {
Ground::Ground(const Context& c, PreparedScene make())
    : own(c.loaded ? std::nullopt : std::optional(make())),
      use(c.loaded ? *c.loaded : *own),
      context(use.context()) {}

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
