#include <algorithm>
#include <cmath>

#include "octrad/base/random_inputs.h"
#include "octrad/network/adam_device.h"
#include "octrad/network/checks.h"
#include "octrad/network/packed_moments_math.h"

namespace octrad {
namespace {

constexpr AdamOptions kAdam{0.9, 0.99, 1e-8};
constexpr double kRate = 1e-2;
constexpr int kSteps = 3;
constexpr int kFeatures = 4;
constexpr std::size_t kTaps = 8;  // of a source

struct AdamUpdates : Kernel {
  AdamConstants constants;
  AdamCorrection correction;
  const float* gradients;
  float *parameters, *m, *v;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    parameters[i] = adam_update(parameters[i], gradients[i], m[i], v[i], constants,
                                static_cast<float>(kRate) * correction.first, correction.second);
  }
};

// Tap i, in slot i, to the gradient of a table: scale times upstream[source].
template <typename Sink>
struct Contributions : Kernel {
  const SparseTap* taps;
  const float* upstream;  // [sources][kFeatures]
  Sink sink;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    sink.template add<kFeatures>(i, taps[i].entry, taps[i].scale,
                                 upstream + static_cast<std::size_t>(taps[i].source) * kFeatures);
  }
};

// The moments as DeviceTable keeps them in half the bytes.
void round_moments(SparseAdam& adam) {
  const std::uint64_t step = mix64(static_cast<std::uint64_t>(adam.global_count()));
  float* row = adam.moments().data();
  for (std::size_t i = 0; i < adam.moments().size() / 2; ++i) {
    float &m = row[i / kFeatures * 2 * kFeatures + i % kFeatures], &v = *(&m + kFeatures);
    unpack_moments(pack_moments(m, v, rounding_of(four_roundings(step, i), i)), m, v);
  }
}

// Steps of both; whether steps, entries and what was dropped are counted as on the CPU.
bool step_tables(Stream& stream, std::size_t sources, TableMode mode, bool sorted, std::uint64_t seed,
                 CheckErrors& errors) {
  const bool dense = mode != TableMode::touched;
  constexpr std::size_t kWidth = kFeatures;
  const std::size_t taps = kTaps * sources, entries = taps;
  SparseAdam cpu(static_cast<std::int64_t>(entries), kFeatures, kAdam);
  cpu.set_dense(dense);
  std::vector<float> table = testing::random_floats(entries * kWidth, seed + 1);
  DeviceTableOptions options;
  options.training = true;
  options.dense = dense;
  options.half_moments = mode == TableMode::dense_half_moments;
  options.sorted = sorted;
  options.slots = options.touches = taps;
  options.adam = kAdam;
  DeviceTable device(stream, entries, kFeatures, options, "check");
  device.upload(stream, table, &cpu);
  const float one = 1.0f;
  const DeviceArray<float> scale(stream, std::span(&one, 1), "check");
  DeviceArray<unsigned long long> counters(stream, 2, "check");
  counters.fill(0);
  DeviceOptimizers optimizers;
  optimizers.add(device, kRate);
  SparseAdam::Result expected;
  for (std::uint64_t s = 0; s < kSteps; ++s) {
    // Tap i is of source i / kTaps. Two thirds of the entries are never touched.
    std::vector<SparseTap> list(taps);
    for (std::size_t i = 0; i < taps; ++i) {
      Rng rng(seed + 10 + s, RngPurpose::test, i);
      list[i] = {rng.below(static_cast<std::uint32_t>(entries / 3)) * 3, static_cast<std::uint32_t>(i / kTaps),
                 rng.uniform()};
    }
    std::vector<float> upstream = testing::random_floats(sources * kWidth, seed + 20 + s), by_feature(upstream.size());
    upstream[Rng(seed, RngPurpose::test, s).below(static_cast<std::uint32_t>(upstream.size()))] = std::nanf("");
    for (std::size_t i = 0; i < sources; ++i) {
      for (std::size_t k = 0; k < kWidth; ++k) by_feature[k * sources + i] = upstream[i * kWidth + k];
    }
    const std::vector<std::span<const SparseTap>> blocks{list};
    const SparseAdam::Result result = cpu.step(table, blocks, upstream, kRate);
    if (options.half_moments) round_moments(cpu);
    expected.touched += result.touched;
    expected.non_finite += result.non_finite;
    const DeviceArray<SparseTap> device_taps(stream, std::span<const SparseTap>(list), "check");
    const DeviceArray<float> by_source(stream, std::span<const float>(upstream), "check"),
        planes(stream, std::span<const float>(by_feature), "check");
    if (sorted) {
      device.begin_sorted(stream);
      launch(stream, taps, Contributions<KeepForSort>{{}, device_taps.data(), by_source.data(), device.keep()});
      device.sum_sorted(stream, static_cast<int>(kTaps), static_cast<std::uint32_t>(sources), 1, planes.data(),
                        sources);
    } else {
      launch(stream, taps, Contributions<AddNow>{{}, device_taps.data(), by_source.data(), device.add()});
    }
    optimizers.advance(stream, nullptr, scale.data(), counters.data() + 1);
    optimizers.step_tables(stream, counters.data());
    stream.synchronize();
  }
  std::vector<float> found(entries * kWidth);
  SparseAdam state(static_cast<std::int64_t>(entries), kFeatures, kAdam);
  device.download(found, &state);
  errors.compare(found, table);
  errors.compare(state.moments(), cpu.moments());
  std::vector<Half> halves(found.size());
  stream.download(halves.data(), device.halves(), halves.size() * sizeof(Half));
  const auto follows = [](Half half, float value) { return half.bits == to_half(value).bits; };
  const std::vector<unsigned long long> counted = counters.download();
  // Given to another table, the state stays the same bits: training goes on where it ended.
  DeviceTable other(stream, entries, kFeatures, options, "check");
  other.upload(stream, found, &state);
  std::vector<float> again(found.size());
  SparseAdam moved(static_cast<std::int64_t>(entries), kFeatures, kAdam);
  other.download(again, &moved);
  return again == found && std::ranges::equal(moved.moments(), state.moments()) &&
         moved.global_count() == state.global_count() &&
         std::equal(halves.begin(), halves.end(), found.begin(), follows) &&  // what look-ups read
         (dense || std::equal(state.counts().begin(), state.counts().end(), cpu.counts().begin())) &&
         state.global_count() == cpu.global_count() &&
         counted[0] == static_cast<unsigned long long>(expected.non_finite) &&
         counted[1] == static_cast<unsigned long long>(expected.touched);
}

}  // namespace

CheckResult check_adam_update(Stream& stream, std::size_t n, std::uint64_t seed) {
  const AdamConstants constants = adam_constants(kAdam.beta1, kAdam.beta2, kAdam.epsilon);
  const AdamCorrection correction = adam_correction(kAdam.beta1, kAdam.beta2, 3.0);
  const std::vector<float> gradients = testing::random_floats(n, seed);
  std::vector<float> parameters = testing::random_floats(n, seed + 1),
                     m = testing::random_floats(n, seed + 2, -0.5f, 0.5f),
                     v = testing::random_floats(n, seed + 3, 0.0f, 0.5f);
  const DeviceArray<float> g(stream, std::span<const float>(gradients), "check"),
      p(stream, std::span<const float>(parameters), "check"), device_m(stream, std::span<const float>(m), "check"),
      device_v(stream, std::span<const float>(v), "check");
  const AdamUpdates updates{{}, constants, correction, g.data(), p.data(), device_m.data(), device_v.data()};
  launch(stream, n, updates);
  for (std::size_t i = 0; i < n; ++i)
    parameters[i] = adam_update(parameters[i], gradients[i], m[i], v[i], constants,
                                static_cast<float>(kRate) * correction.first, correction.second);
  CheckErrors errors;
  errors.compare(p.download(), parameters);
  errors.compare(device_m.download(), m);
  errors.compare(device_v.download(), v);
  return errors.exact_on_host(stream, "error of parameters and moments", 1e-6);
}

CheckResult check_dense_adam(Stream& stream, std::size_t n, std::uint64_t seed) {
  DenseAdam cpu(n, kAdam);
  std::vector<float> parameters = testing::random_floats(n, seed);
  for (std::uint64_t s = 1; s <= kSteps; ++s) cpu.step(parameters, testing::random_floats(n, seed + s), 0.5 * kRate);
  DeviceDenseAdam device(stream, n, kAdam, "check");
  device.upload(cpu);
  const float half = 0.5f;
  const DeviceArray<float> values(stream, std::span<const float>(parameters), "check"),
      scale(stream, std::span(&half, 1), "check");
  DeviceArray<unsigned long long> dropped(stream, 1, "check");
  dropped.fill(0);
  std::int64_t expected_dropped = 0;
  for (std::uint64_t s = 1; s <= kSteps; ++s) {
    std::vector<float> gradient = testing::random_floats(n, seed + kSteps + s);
    gradient[17] = std::nanf("");
    gradient[18] = 1e30f;  // whose square is no number
    expected_dropped += cpu.step(parameters, gradient, 0.5 * kRate);
    const DeviceArray<float> device_gradient(stream, std::span<const float>(gradient), "check");
    DeviceOptimizers optimizers;
    optimizers.add(device, values.data(), device_gradient.data(), kRate);
    optimizers.advance(stream, scale.data(), nullptr, nullptr);
    optimizers.step_networks(stream, dropped.data());
    stream.synchronize();
  }
  DenseAdam state(n, kAdam);
  device.download(state);
  CheckErrors errors;
  errors.compare(values.download(), parameters);
  errors.compare(state.m(), cpu.m());
  errors.compare(state.v(), cpu.v());
  CheckResult r = errors.exact_on_host(stream, "error of values and moments", 2e-6);
  r.require(state.count() == cpu.count() && state.count() == 2 * kSteps, "other steps");
  r.require(dropped.download()[0] == static_cast<unsigned long long>(expected_dropped), "others were dropped");
  return r;
}

CheckResult check_table_adam(Stream& stream, std::size_t sources, TableMode mode, std::uint64_t seed) {
  CheckErrors as_they_come, in_order;
  const bool counts = step_tables(stream, sources, mode, false, seed, as_they_come),
             sorted_counts = step_tables(stream, sources, mode, true, seed, in_order);
  // A sum of almost nothing takes its sign from the order of its terms, and a first step is its sign: hardly ever. Half
  // moments are rounded the other way where a last bit decides.
  const double allowed = mode == TableMode::dense_half_moments ? 5e-4 : 2e-6;
  CheckResult r = as_they_come.result("error of values and moments", 2e-5, allowed);
  const CheckResult sorted = in_order.exact_on_host(stream, "", 2e-5, allowed);
  r.require(sorted.passed, "sums in the CPU's order are off by " + std::to_string(sorted.max));
  r.require(counts && sorted_counts, "other counts");
  return r;
}

}  // namespace octrad
