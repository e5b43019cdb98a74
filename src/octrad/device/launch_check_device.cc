#include <algorithm>
#include <span>
#include <vector>

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

// Appends item i to one of two lists, up to three times to a third, and as many times at once to a fourth.
struct Append : Kernel {
  const std::uint32_t* values;
  std::uint32_t *counts, *lists;
  std::uint32_t n;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    const std::uint32_t v = values[i], copies = v >> 1 & 3u;
    if ((v & 1u) != 0) lists[atomic_append(counts)] = i;
    else lists[n + atomic_append(counts + 1)] = i;
    for (std::uint32_t k = 0; k < copies; ++k) lists[2 * n + atomic_append(counts + 2)] = i;
  }
};
struct AppendMany : Kernel {
  const std::uint32_t* values;
  std::uint32_t *count, *list;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    const std::uint32_t copies = values[i] >> 1 & 3u, first = atomic_append_many(count, copies);
    for (std::uint32_t k = 0; k < copies; ++k) list[first + k] = i;
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

CheckResult check_appends(Stream& stream, std::size_t n, std::uint64_t seed) {
  const std::vector<std::uint32_t> values = testing::random_words(n, seed);
  const DeviceArray<std::uint32_t> in(stream, std::span<const std::uint32_t>(values), "check");
  DeviceArray<std::uint32_t> counts(stream, 4, "check"), lists(stream, 8 * n, "check");
  counts.fill(0);
  launch(stream, n, Append{{}, in.data(), counts.data(), lists.data(), static_cast<std::uint32_t>(n)});
  launch(stream, n, AppendMany{{}, in.data(), counts.data() + 3, lists.data() + 5 * n});
  std::vector<std::uint32_t> expected[4];
  for (std::uint32_t i = 0; i < n; ++i) {
    expected[(values[i] & 1u) != 0 ? 0 : 1].push_back(i);
    for (const int list : {2, 3}) expected[list].insert(expected[list].end(), values[i] >> 1 & 3u, i);
  }
  const std::vector<std::uint32_t> count = counts.download(), list = lists.download();
  const std::size_t first[] = {0, n, 2 * n, 5 * n};
  CheckErrors errors;
  for (int k = 0; k < 4; ++k) {
    const auto found = count[static_cast<std::size_t>(k)], wanted = static_cast<std::uint32_t>(expected[k].size());
    errors.compare_words(std::span(&found, 1), std::span(&wanted, 1));
    // In any order.
    const auto begin = list.begin() + static_cast<std::ptrdiff_t>(first[k]);
    std::vector<std::uint32_t> items(begin, begin + static_cast<std::ptrdiff_t>(expected[k].size()));
    std::sort(items.begin(), items.end());
    errors.compare_words(items, expected[k]);
  }
  return errors.result("other items", 0.0);
}

}  // namespace octrad
