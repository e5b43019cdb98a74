#include <algorithm>
#include <cmath>

#include "app/selftest/entries.h"
#include "app/selftest/kernels.h"
#include "octrad/base/rng.h"
#include "octrad/device/array.h"
#include "octrad/network/adam_device.h"

namespace octrad::selftest {
namespace {

constexpr AdamOptions kAdam{0.9, 0.99, 1e-8};
constexpr double kRate = 1e-2;
constexpr std::uint64_t kSteps = 3;

std::vector<float> random_values(std::size_t n, std::uint64_t seed) {
  std::vector<float> values(n);
  for (std::size_t i = 0; i < n; ++i) values[i] = 2.0f * Rng(seed, RngPurpose::test, i).uniform() - 1.0f;
  return values;
}

void compare(Errors& errors, std::span<const float> got, std::span<const float> expected) {
  for (std::size_t i = 0; i < got.size(); ++i)
    errors.add(std::fabs(static_cast<double>(got[i]) - expected[i]) /
               std::max(1.0, std::fabs(static_cast<double>(expected[i]))));
}

CheckResult with_counts(CheckResult r, bool same) {
  if (same) return r;
  r.passed = false;
  r.error += "; other counts";
  return r;
}

// Steps over a table from random contributions, a few of them to each entry: `sorted` sums them in the CPU's order,
// else they come in any. Whether steps, entries and what was dropped were counted as on the CPU.
bool table_steps(const Context& c, bool dense, bool sorted, Errors& errors) {
  constexpr std::size_t kTaps = 8, kWidth = kTapFeatures;
  const std::size_t sources = c.items(1 << 16, 1 << 10), taps = kTaps * sources, entries = taps;
  SparseAdam cpu(static_cast<std::int64_t>(entries), kTapFeatures, kAdam);
  cpu.set_dense(dense);
  std::vector<float> table = random_values(entries * kWidth, c.seed + 1);
  DeviceTableOptions options;
  options.training = true;
  options.dense = dense;
  options.sorted = sorted;
  options.slots = options.touches = taps;
  options.adam = kAdam;
  DeviceTable device(c.stream, entries, kTapFeatures, options, "selftest");
  device.upload(c.stream, table, &cpu);
  const std::vector<float> one{1.0f};
  const DeviceArray<float> scale(c.stream, std::span<const float>(one), "selftest");
  DeviceArray<unsigned long long> counters(c.stream, 2, "selftest");
  counters.fill(0);
  SparseAdam::Result expected;
  for (std::uint64_t s = 0; s < kSteps; ++s) {
    // Tap i is of source i / 8. Two thirds of the entries are never touched.
    std::vector<SparseTap> list(taps);
    for (std::size_t i = 0; i < taps; ++i) {
      Rng rng(c.seed + 10 + s, RngPurpose::test, i);
      list[i] = {rng.below(static_cast<std::uint32_t>(entries / 3)) * 3, static_cast<std::uint32_t>(i / kTaps),
                 rng.uniform()};
    }
    std::vector<float> upstream = random_values(sources * kWidth, c.seed + 20 + s), by_feature(sources * kWidth);
    upstream[Rng(c.seed, RngPurpose::test, s).below(static_cast<std::uint32_t>(upstream.size()))] = std::nanf("");
    for (std::size_t i = 0; i < sources; ++i) {
      for (std::size_t k = 0; k < kWidth; ++k) by_feature[k * sources + i] = upstream[i * kWidth + k];
    }
    const std::vector<std::span<const SparseTap>> blocks{list};
    const SparseAdam::Result result = cpu.step(table, blocks, upstream, kRate);
    expected.touched += result.touched;
    expected.non_finite += result.non_finite;
    const DeviceArray<SparseTap> device_taps(c.stream, std::span<const SparseTap>(list), "selftest");
    const DeviceArray<float> by_source(c.stream, std::span<const float>(upstream), "selftest"),
        planes(c.stream, std::span<const float>(by_feature), "selftest");
    if (sorted) {
      device.begin_sorted(c.stream);
      run_taps(c.stream, taps, device_taps.data(), by_source.data(), device.keep());
      device.sum_sorted(c.stream, static_cast<int>(kTaps), static_cast<std::uint32_t>(sources), 1, planes.data(),
                        sources);
    } else {
      run_taps(c.stream, taps, device_taps.data(), by_source.data(), device.add());
    }
    device.step(c.stream, kRate, scale.data(), counters.data(), counters.data() + 1);
    c.stream.synchronize();
  }
  std::vector<float> got(entries * kWidth);
  SparseAdam state(static_cast<std::int64_t>(entries), kTapFeatures, kAdam);
  device.download(got, &state);
  compare(errors, got, table);
  compare(errors, state.moments(), cpu.moments());
  std::vector<Half> halves(entries * kWidth);
  c.stream.download(halves.data(), device.halves(), halves.size() * sizeof(Half));
  const auto follows = [](Half half, float value) { return half.bits == to_half(value).bits; };
  const std::vector<unsigned long long> counted = counters.download();
  return std::equal(halves.begin(), halves.end(), got.begin(), follows) &&  // what look-ups read
         (dense || std::equal(state.counts().begin(), state.counts().end(), cpu.counts().begin())) &&
         state.global_count() == cpu.global_count() &&
         counted[0] == static_cast<unsigned long long>(expected.non_finite) &&
         counted[1] == static_cast<unsigned long long>(expected.touched);
}

CheckResult check_table(const Context& c, bool dense) {
  Errors errors;
  bool same = true;
  for (const bool sorted : {false, true}) same = table_steps(c, dense, sorted, errors) && same;
  // A sum of almost nothing takes its sign from the order of its terms, and a first step is its sign: hardly ever.
  return with_counts(errors.result("error of values and moments", 2e-5, 2e-6), same);
}

}  // namespace

CheckResult check_network_optimiser(const Context& c) {
  const std::size_t n = c.items(1 << 20, 1 << 15);
  DenseAdam cpu(n, kAdam);
  std::vector<float> parameters = random_values(n, c.seed + 1);
  DeviceDenseAdam device(c.stream, n, kAdam, "selftest");
  device.upload(cpu);
  const std::vector<float> half{0.5f};
  const DeviceArray<float> values(c.stream, std::span<const float>(parameters), "selftest"),
      scale(c.stream, std::span<const float>(half), "selftest");
  DeviceArray<unsigned long long> dropped(c.stream, 1, "selftest");
  dropped.fill(0);
  std::int64_t expected_dropped = 0;
  for (std::uint64_t s = 0; s < kSteps; ++s) {
    std::vector<float> gradient = random_values(n, c.seed + 10 + s);
    gradient[17] = std::nanf("");
    gradient[18] = 1e30f;  // whose square is no number
    expected_dropped += cpu.step(parameters, gradient, 0.5 * kRate);
    const DeviceArray<float> device_gradient(c.stream, std::span<const float>(gradient), "selftest");
    device.step(c.stream, values.data(), device_gradient.data(), kRate, scale.data(), dropped.data());
    c.stream.synchronize();
  }
  Errors errors;
  compare(errors, values.download(), parameters);
  DenseAdam state(n, kAdam);
  device.download(state);
  compare(errors, state.m(), cpu.m());
  compare(errors, state.v(), cpu.v());
  return with_counts(
      errors.result("error of values and moments", 2e-6),
      state.count() == cpu.count() && dropped.download()[0] == static_cast<unsigned long long>(expected_dropped));
}

CheckResult check_touched_optimiser(const Context& c) { return check_table(c, false); }
CheckResult check_dense_optimiser(const Context& c) { return check_table(c, true); }

}  // namespace octrad::selftest
