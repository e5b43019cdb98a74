// How a kernel is compared with the CPU's definition: errors of many items, judged by a tolerance. Each module that has
// kernels offers its comparisons in MODULE/checks.h; unit tests and `octrad selftest` run the same ones.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "octrad/device/stream.h"

namespace octrad {

struct CheckResult {
  std::string error;  // what is measured: "relative error of t"
  std::size_t items = 0;
  double p50 = 0.0, p99 = 0.0, p999 = 0.0, max = 0.0;
  double tolerance = 0.0;
  double allowed = 0.0;  // share of the items that may be above
  double above = 0.0;    // that is
  bool passed = false;

  // Fails where `condition` is false; `otherwise` says what is wrong then.
  void require(bool condition, const std::string& otherwise);
  std::string text() const;  // "relative error of t: p99.9 1e-07, max 2e-07; at most 1e-06"
};

// `count` items of a stream's memory.
template <typename T>
std::vector<T> fetch(Stream& stream, const T* data, std::size_t count) {
  std::vector<T> values(count);
  if (count > 0) stream.download(values.data(), data, count * sizeof(T));
  return values;
}

class CheckErrors {
 public:
  // What is not a number counts as infinite.
  void add(double error);
  // |found - expected| / max(1, |expected|), and 0 where both are no number. 0 otherwise means the same bits.
  void compare(float found, float expected);
  void compare(std::span<const float> found, std::span<const float> expected);
  void compare_words(std::span<const std::uint32_t> found, std::span<const std::uint32_t> expected);  // 0 or 1
  // Nothing looked at is not passed.
  CheckResult result(std::string what, double tolerance, double allowed_share = 0.0);
  // The host stream runs the CPU's own code, so that there no error is allowed at all: the same bits.
  CheckResult exact_on_host(const Stream& stream, std::string what, double tolerance, double allowed_share = 0.0);

 private:
  std::vector<double> errors_;
};

}  // namespace octrad
