#include "octrad/device/check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

namespace octrad {

void CheckResult::require(bool condition, const std::string& otherwise) {
  if (condition) return;
  passed = false;
  error += "; " + otherwise;
}

std::string CheckResult::text() const {
  return fmt::format("{}: p99.9 {:.2g}, max {:.2g}; at most {:.2g}{}", error, p999, max, tolerance,
                     allowed > 0.0 ? fmt::format(" for all but {:.3g} %", 100.0 * allowed) : "");
}

void CheckErrors::add(double error) {
  errors_.push_back(std::isnan(error) ? std::numeric_limits<double>::infinity() : error);
}

void CheckErrors::compare(float found, float expected) {
  if (std::memcmp(&found, &expected, sizeof(float)) == 0 || (std::isnan(found) && std::isnan(expected))) {
    errors_.push_back(0.0);
    return;
  }
  const double size = std::fabs(static_cast<double>(expected));
  const double error = std::fabs(static_cast<double>(found) - static_cast<double>(expected)) / std::max(1.0, size);
  add(error == 0.0 ? std::numeric_limits<double>::min() : error);  // 0 and -0
}

void CheckErrors::compare(std::span<const float> found, std::span<const float> expected) {
  if (found.size() != expected.size()) add(std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < std::min(found.size(), expected.size()); ++i) compare(found[i], expected[i]);
}

void CheckErrors::compare_words(std::span<const std::uint32_t> found, std::span<const std::uint32_t> expected) {
  if (found.size() != expected.size()) add(std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < std::min(found.size(), expected.size()); ++i) add(found[i] == expected[i] ? 0.0 : 1.0);
}

CheckResult CheckErrors::result(std::string what, double tolerance, double allowed_share) {
  CheckResult r;
  r.error = std::move(what);
  r.items = errors_.size();
  r.tolerance = tolerance;
  r.allowed = allowed_share;
  if (errors_.empty()) return r;
  std::sort(errors_.begin(), errors_.end());
  const auto at = [&](double share) {
    return errors_[std::min(errors_.size() - 1, static_cast<std::size_t>(share * static_cast<double>(errors_.size())))];
  };
  r.p50 = at(0.5);
  r.p99 = at(0.99);
  r.p999 = at(0.999);
  r.max = errors_.back();
  r.above = static_cast<double>(errors_.end() - std::upper_bound(errors_.begin(), errors_.end(), tolerance)) /
            static_cast<double>(errors_.size());
  r.passed = r.above <= allowed_share;
  return r;
}

CheckResult CheckErrors::exact_on_host(const Stream& stream, std::string what, double tolerance, double allowed_share) {
  return stream.on_device() ? result(std::move(what), tolerance, allowed_share) : result(std::move(what), 0.0);
}

}  // namespace octrad
