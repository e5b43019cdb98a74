#include <algorithm>
#include <cmath>
#include <numeric>

#include "octrad/base/random_inputs.h"
#include "octrad/device/array.h"
#include "octrad/device/checks.h"
#include "octrad/device/sort.h"

namespace octrad {

using Words = std::vector<std::uint32_t>;

CheckResult check_sort(Stream& stream, std::size_t n, int bits, std::uint64_t seed) {
  const Words keys = testing::random_words(n, seed);
  Words places(n);
  std::iota(places.begin(), places.end(), 0u);
  const SortWorkspace workspace(stream, n, "check");
  const DeviceArray<std::uint32_t> keys_in(stream, std::span<const std::uint32_t>(keys), "check"),
      values_in(stream, std::span<const std::uint32_t>(places), "check"), keys_out(stream, n, "check"),
      values_out(stream, n, "check");
  sort_pairs(stream, workspace, n, keys_in.data(), keys_out.data(), values_in.data(), values_out.data(), bits);
  const std::uint32_t mask = ~0u >> (32 - bits);
  std::stable_sort(places.begin(), places.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return (keys[a] & mask) < (keys[b] & mask); });
  Words sorted(n);
  for (std::size_t i = 0; i < n; ++i) sorted[i] = keys[places[i]];
  CheckErrors errors;
  errors.compare_words(values_out.download(), places);
  CheckResult r = errors.result("wrong places", 0.0);
  r.require(keys_out.download() == sorted, "keys are not where their values are");
  r.require(keys_in.download() == keys, "the inputs are overwritten");
  return r;
}

CheckResult check_scan(Stream& stream, std::size_t n, std::uint64_t seed) {
  const Words values = testing::random_words(n, seed);
  const SortWorkspace workspace(stream, n, "check");
  const DeviceArray<std::uint32_t> data(stream, std::span<const std::uint32_t>(values), "check");
  exclusive_sum(stream, workspace, n, data.data(), data.data());
  Words expected(n);
  std::exclusive_scan(values.begin(), values.end(), expected.begin(), 0u);
  CheckErrors errors;
  errors.compare_words(data.download(), expected);
  return errors.result("wrong sums", 0.0);
}

CheckResult check_sum(Stream& stream, std::size_t n, std::uint64_t seed) {
  const std::vector<float> values = testing::random_floats(n, seed, 0.0f, 1.0f);
  const SortWorkspace workspace(stream, n, "check");
  const DeviceArray<float> in(stream, std::span<const float>(values), "check"), out(stream, 2, "check");
  sum(stream, workspace, n, in.data(), out.data());
  sum(stream, workspace, n, in.data(), out.data() + 1);
  const std::vector<float> found = out.download();
  const double expected = std::accumulate(values.begin(), values.end(), 0.0);
  CheckErrors errors;
  errors.add(std::fabs(static_cast<double>(found[0]) - expected) / std::max(1.0, expected));
  CheckResult r = errors.result("relative error of the sum", 1e-6);
  r.require(found[0] == found[1], "a second sum has other bits");
  return r;
}

}  // namespace octrad
