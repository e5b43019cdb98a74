#include <algorithm>

#include "octrad/base/random_inputs.h"
#include "octrad/base/sobol_math.h"
#include "octrad/device/array.h"
#include "octrad/device/checks.h"
#include "octrad/device/launch.h"

namespace octrad {
namespace {

struct RandomNumbers : Kernel {
  std::uint64_t seed;
  std::uint32_t* out;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    Rng rng(seed, RngPurpose::test, i);
    rng.bits();
    out[i] = rng.bits();
  }
};

struct SobolPoints : Kernel {
  std::uint32_t* out;
  OCTRAD_HD void operator()(std::uint32_t i) const { sobol3(i, out + 3 * static_cast<std::size_t>(i)); }
};

struct Histogram : Kernel {
  const std::uint32_t* values;
  std::uint32_t *counts, *flags, *largest;
  float* sum;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    atomic_add(&counts[values[i] & 7u], std::uint32_t{1});
    atomic_add(sum, 1.0f);
    atomic_or(flags, 1u << (values[i] & 7u));
    atomic_max(largest, values[i]);
  }
};

}  // namespace

CheckResult check_random_numbers(Stream& stream, std::size_t n, std::uint64_t seed) {
  const DeviceArray<std::uint32_t> out(stream, n, "check");
  launch(stream, n, RandomNumbers{{}, seed, out.data()});
  std::vector<std::uint32_t> expected(n);
  for (std::size_t i = 0; i < n; ++i) {
    Rng rng(seed, RngPurpose::test, i);
    rng.bits();
    expected[i] = rng.bits();
  }
  CheckErrors errors;
  errors.compare_words(out.download(), expected);
  return errors.result("other bits", 0.0);
}

CheckResult check_sobol(Stream& stream, std::size_t n) {
  const DeviceArray<std::uint32_t> out(stream, 3 * n, "check");
  launch(stream, n, SobolPoints{{}, out.data()});
  std::vector<std::uint32_t> expected(3 * n);
  for (std::size_t i = 0; i < n; ++i) sobol3(static_cast<std::uint32_t>(i), expected.data() + 3 * i);
  CheckErrors errors;
  errors.compare_words(out.download(), expected);
  return errors.result("other bits", 0.0);
}

CheckResult check_atomics(Stream& stream, std::size_t n, std::uint64_t seed) {
  const std::vector<std::uint32_t> values = testing::random_words(n, seed);
  const DeviceArray<std::uint32_t> in(stream, std::span<const std::uint32_t>(values), "check");
  DeviceArray<std::uint32_t> counts(stream, 10, "check");  // and the flags, and the largest value
  DeviceArray<float> sum(stream, 1, "check");
  counts.fill(0);
  sum.fill(0);
  launch(stream, n, Histogram{{}, in.data(), counts.data(), counts.data() + 8, counts.data() + 9, sum.data()});
  std::vector<std::uint32_t> expected(10, 0);
  for (const std::uint32_t v : values) {
    ++expected[v & 7u];
    expected[8] |= 1u << (v & 7u);
    expected[9] = std::max(expected[9], v);
  }
  CheckErrors errors;
  errors.compare_words(counts.download(), expected);
  errors.compare(sum.download()[0], static_cast<float>(n));
  return errors.result("wrong counts", 0.0);
}

}  // namespace octrad
