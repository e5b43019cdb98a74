#include "octrad/network/adam.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <vector>

#include "octrad/base/each_target_test_helper.h"
#include "octrad/base/random_inputs.h"
#include "octrad/base/rng.h"
#include "octrad/base/threads.h"
#include "octrad/network/adam_math.h"

namespace octrad {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();

// Algorithm 1 of Kingma & Ba (2015), in double.
struct Textbook {
  double m = 0, v = 0;
  int t = 0;
  double update(double parameter, double gradient, double rate) {
    ++t;
    m = 0.9 * m + 0.1 * gradient;
    v = 0.999 * v + 0.001 * gradient * gradient;
    return parameter - rate * (m / (1 - std::pow(0.9, t))) / (std::sqrt(v / (1 - std::pow(0.999, t))) + 1e-8);
  }
};

struct RestoreThreads {
  ~RestoreThreads() { set_thread_count(0); }
};

TEST(DenseAdam, AgreesWithTheTextbook) {
  testing::for_each_simd_target([] {
    constexpr std::size_t kN = 16384 + 37;  // more than one task, and a remainder
    std::vector<float> p = testing::random_floats(kN, 0);
    std::vector<double> want(p.begin(), p.end());
    std::vector<Textbook> textbook(kN);
    DenseAdam adam(kN, {});
    for (std::uint64_t step = 1; step <= 20; ++step) {
      const std::vector<float> g = testing::random_floats(kN, step);
      EXPECT_EQ(adam.step(p, g, 0.01), 0);
      for (std::size_t i = 0; i < kN; ++i) want[i] = textbook[i].update(want[i], g[i], 0.01);
    }
    EXPECT_EQ(adam.count(), 20);
    for (std::size_t i = 0; i < kN; ++i) ASSERT_NEAR(p[i], want[i], 3e-6) << i;
  });
}

TEST(DenseAdam, SameBitsOnEveryTargetAndThreadCount) {
  RestoreThreads restore;
  std::vector<float> first;
  testing::for_each_simd_target([&] {
    for (int threads : {1, 2, 3}) {
      set_thread_count(threads);
      std::vector<float> p = testing::random_floats(100003, 0);
      DenseAdam adam(p.size(), {});
      for (std::uint64_t step = 1; step <= 4; ++step) adam.step(p, testing::random_floats(p.size(), step), 0.003);
      if (first.empty()) first = p;
      EXPECT_TRUE(first == p) << threads;
    }
  });
}

TEST(DenseAdam, NonFiniteGradientsAreTakenAsZeroAndCounted) {
  testing::for_each_simd_target([] {
    std::vector<float> p(40, 1.0f), q(40, 1.0f), g(40, 0.5f), clean(40, 0.5f);
    const std::vector<std::pair<std::size_t, float>> bad{{0, kNan}, {7, kInf}, {20, -kInf}, {38, 1e30f}, {39, kNan}};
    for (const auto& [i, value] : bad) {
      g[i] = value;
      clean[i] = 0.0f;
    }
    DenseAdam adam(40, {}), reference(40, {});
    EXPECT_EQ(adam.step(p, g, 0.1), 5);
    EXPECT_EQ(reference.step(q, clean, 0.1), 0);
    EXPECT_EQ(p, q);
    EXPECT_EQ(p[0], 1.0f);
    EXPECT_LT(p[1], 1.0f);
  });
}

// Random contributions to few entries, so that many coincide; `blocks` of uneven length.
struct Batch {
  std::vector<std::vector<SparseTap>> lists;
  std::vector<float> upstream;
  std::vector<std::span<const SparseTap>> blocks() const { return {lists.begin(), lists.end()}; }
};

Batch make_batch(std::uint64_t index, std::uint32_t entries, std::size_t features, std::size_t taps) {
  constexpr std::uint32_t kSources = 300;
  Batch batch;
  batch.upstream = testing::random_floats(kSources * features, 1000 + index);
  Rng rng(12, RngPurpose::test, index);
  batch.lists.resize(5);
  for (std::size_t t = 0; t < taps; ++t) {
    const std::uint32_t list = std::min(rng.below(7), 4u);
    batch.lists[list == 3 ? 4 : list].push_back(
        {rng.below(entries), rng.below(kSources), rng.uniform() - 0.3f});  // list 3 stays empty
  }
  return batch;
}

class SparseAdamFeatures : public ::testing::TestWithParam<std::size_t> {};

TEST_P(SparseAdamFeatures, TouchedEntriesFollowTheTextbookWithTheirOwnCounts) {
  const std::size_t features = GetParam();
  constexpr std::uint32_t kEntries = 9000;
  testing::for_each_simd_target([&] {
    std::vector<float> table = testing::random_floats(kEntries * features, 0);
    const std::vector<float> before = table;
    std::vector<double> want(table.begin(), table.end());
    std::map<std::size_t, std::vector<Textbook>> textbook;
    SparseAdam adam(kEntries, static_cast<int>(features), {});
    for (std::uint64_t step = 1; step <= 6; ++step) {
      const Batch batch = make_batch(step, kEntries, features, 12000);
      std::map<std::size_t, std::vector<double>> gradients;
      for (const auto& list : batch.lists) {
        for (const SparseTap& tap : list) {
          auto& g = gradients[tap.entry];
          g.resize(features);
          for (std::size_t f = 0; f < features; ++f)
            g[f] += static_cast<double>(tap.scale) * batch.upstream[tap.source * features + f];
        }
      }
      const SparseAdam::Result result = adam.step(table, batch.blocks(), batch.upstream, 0.01);
      EXPECT_EQ(result.touched, static_cast<std::int64_t>(gradients.size()));
      EXPECT_EQ(result.non_finite, 0);
      for (const auto& [entry, g] : gradients) {
        auto& states = textbook[entry];
        states.resize(features);
        for (std::size_t f = 0; f < features; ++f)
          want[entry * features + f] = states[f].update(want[entry * features + f], g[f], 0.01);
      }
    }
    std::size_t untouched = 0;
    for (std::size_t e = 0; e < kEntries; ++e) {
      const bool touched = textbook.count(e) > 0;
      EXPECT_EQ(adam.counts()[e], touched ? textbook[e][0].t : 0);
      untouched += touched ? 0 : 1;
      for (std::size_t f = 0; f < features; ++f) {
        const std::size_t j = e * features + f;
        // A sum that nearly cancels is in single precision not that of double; Adam turns its sign into a whole step.
        if (touched) {
          ASSERT_NEAR(table[j], want[j], 2e-4) << e;
          ASSERT_NEAR(adam.moments()[2 * e * features + f], textbook[e][f].m, 1e-6);
          ASSERT_NEAR(adam.moments()[(2 * e + 1) * features + f], textbook[e][f].v, 1e-6);
        } else {
          EXPECT_EQ(table[j], before[j]);
        }
      }
    }
    EXPECT_GT(untouched, 0u);
    EXPECT_EQ(adam.global_count(), 6);
  });
}

INSTANTIATE_TEST_SUITE_P(Features, SparseAdamFeatures, ::testing::Values(1, 2, 3, 4, 8),
                         ::testing::PrintToStringParamName());

TEST(SparseAdam, TouchedAndDenseAgreeWhenAllEntriesAreTouched) {
  constexpr std::uint32_t kEntries = 5000;
  for (int features : {2, 3, 4}) {
    std::vector<float> a = testing::random_floats(kEntries * static_cast<std::size_t>(features), 0), b = a;
    SparseAdam touched(kEntries, features, {}), dense(kEntries, features, {});
    dense.set_dense(true);
    for (std::uint64_t step = 1; step <= 5; ++step) {
      Batch batch = make_batch(step, kEntries, static_cast<std::size_t>(features), 3000);
      for (std::uint32_t e = 0; e < kEntries; ++e) batch.lists[3].push_back({e, e % 300, 0.25f});
      EXPECT_EQ(touched.step(a, batch.blocks(), batch.upstream, 0.01).touched, kEntries);
      EXPECT_EQ(dense.step(b, batch.blocks(), batch.upstream, 0.01).touched, kEntries);
    }
    EXPECT_TRUE(a == b);
    EXPECT_TRUE(std::equal(touched.moments().begin(), touched.moments().end(), dense.moments().begin()));
  }
}

TEST(SparseAdam, DenseModeIsTheTextbookOnEntriesWithoutGradientToo) {
  constexpr std::uint32_t kEntries = 2500;
  std::vector<float> table = testing::random_floats(kEntries * 4, 0);
  std::vector<double> want(table.begin(), table.end());
  std::vector<Textbook> textbook(kEntries * 4);
  SparseAdam adam(kEntries, 4, {});
  adam.set_dense(true);
  for (std::uint64_t step = 1; step <= 5; ++step) {
    const Batch batch = make_batch(step, kEntries, 4, 2000);
    std::vector<double> g(kEntries * 4);
    for (const auto& list : batch.lists) {
      for (const SparseTap& tap : list) {
        for (std::size_t f = 0; f < 4; ++f)
          g[tap.entry * 4 + f] += static_cast<double>(tap.scale) * batch.upstream[tap.source * 4 + f];
      }
    }
    adam.step(table, batch.blocks(), batch.upstream, 0.01);
    for (std::size_t j = 0; j < g.size(); ++j) want[j] = textbook[j].update(want[j], g[j], 0.01);
  }
  for (std::size_t j = 0; j < table.size(); ++j) ASSERT_NEAR(table[j], want[j], 2e-4) << j;
}

TEST(SparseAdam, SameBitsOnEveryTargetAndThreadCount) {
  RestoreThreads restore;
  constexpr std::uint32_t kEntries = 30000;
  for (bool dense : {false, true}) {
    std::vector<float> first;
    testing::for_each_simd_target([&] {
      for (int threads : {1, 2, 3}) {
        set_thread_count(threads);
        std::vector<float> table = testing::random_floats(kEntries * 4, 0);
        SparseAdam adam(kEntries, 4, {});
        adam.set_dense(dense);
        for (std::uint64_t step = 1; step <= 3; ++step) {
          const Batch batch = make_batch(step, kEntries, 4, 40000);
          adam.step(table, batch.blocks(), batch.upstream, 0.01);
        }
        if (first.empty()) first = table;
        EXPECT_TRUE(first == table) << threads;
      }
    });
  }
}

// The sum of an entry goes through the blocks in order, however they are cut.
TEST(SparseAdam, OrderOfContributionsIsThatOfTheLists) {
  std::vector<SparseTap> taps;
  for (std::uint32_t i = 0; i < 50000; ++i) taps.push_back({i % 7, i % 300, 1.0f / static_cast<float>(i + 1)});
  const std::vector<float> upstream = testing::random_floats(300 * 4, 5);
  std::vector<float> one(7 * 4), cut(7 * 4), scalar(7 * 4);
  for (const SparseTap& tap : taps) {
    for (std::size_t f = 0; f < 4; ++f) scalar[tap.entry * 4 + f] += tap.scale * upstream[tap.source * 4 + f];
  }
  SparseAdam a(7, 4, {}), b(7, 4, {});
  const std::span<const SparseTap> all(taps);
  a.step(one, std::vector<std::span<const SparseTap>>{all}, upstream, 0.01);
  b.step(cut, std::vector<std::span<const SparseTap>>{all.first(123), all.subspan(123, 30001), all.subspan(30124)},
         upstream, 0.01);
  EXPECT_EQ(one, cut);
  for (std::size_t e = 0; e < 7; ++e) {
    for (std::size_t f = 0; f < 4; ++f)
      EXPECT_EQ(a.moments()[e * 8 + f], adam_constants(0.9, 0.999, 1e-8).rest1 * scalar[e * 4 + f]);
  }
}

TEST(SparseAdam, NonFiniteGradientsAreTakenAsZeroAndCounted) {
  testing::for_each_simd_target([] {
    for (bool dense : {false, true}) {
      std::vector<float> table(10 * 4, 1.0f), upstream{1.0f, kNan, 1.0f, -kInf, 1.0f, 1.0f, 1.0f, 1.0f};
      SparseAdam adam(10, 4, {});
      adam.set_dense(dense);
      const std::vector<SparseTap> taps{{3, 0, 1.0f}, {5, 1, 1.0f}, {3, 1, 0.5f}};
      const SparseAdam::Result result = adam.step(table, std::vector<std::span<const SparseTap>>{taps}, upstream, 0.1);
      EXPECT_EQ(result.non_finite, 2);
      EXPECT_EQ(result.touched, dense ? 10 : 2);
      // Everything else is as if those two were not there.
      std::vector<float> clean(10 * 4, 1.0f);
      SparseAdam other(10, 4, {});
      other.set_dense(dense);
      other.step(clean, std::vector<std::span<const SparseTap>>{taps}, std::vector<float>(8, 1.0f), 0.1);
      EXPECT_LT(clean[3 * 4 + 1], 1.0f);
      clean[3 * 4 + 1] = clean[3 * 4 + 3] = 1.0f;
      EXPECT_EQ(table, clean);
    }
  });
}

TEST(SparseAdam, CountsSaturateAndCorrectionsEndAtOne) {
  std::vector<float> table(4, 0.0f);
  SparseAdam adam(1, 4, {});
  const std::vector<SparseTap> taps{{0, 0, 1.0f}};
  const std::vector<float> upstream(4, 1.0f);
  // A constant gradient moves by the rate each step, at any count: the corrections cancel the moments' start exactly.
  float largest = 0.0f;
  for (int i = 0; i < 66000; ++i) {
    const float was = table[0];
    adam.step(table, std::vector<std::span<const SparseTap>>{taps}, upstream, 0.5);
    largest = std::max(largest, std::abs(was - table[0] - 0.5f));
  }
  EXPECT_LT(largest, 0.004f);  // half a unit in the last place of 33000 is 0.002
  EXPECT_EQ(adam.counts()[0], 0xffff);
}

TEST(SparseAdam, StateRestoresARun) {
  constexpr std::uint32_t kEntries = 3000;
  std::vector<float> table = testing::random_floats(kEntries * 4, 0);
  SparseAdam adam(kEntries, 4, {});
  const auto step = [](SparseAdam& a, std::vector<float>& t, std::uint64_t i) {
    const Batch batch = make_batch(i, kEntries, 4, 5000);
    a.step(t, batch.blocks(), batch.upstream, 0.01);
  };
  for (std::uint64_t i = 1; i <= 3; ++i) step(adam, table, i);
  std::vector<float> resumed_table = table;
  SparseAdam resumed(kEntries, 4, {});
  std::copy(adam.moments().begin(), adam.moments().end(), resumed.moments().begin());
  std::copy(adam.counts().begin(), adam.counts().end(), resumed.counts().begin());
  resumed.global_count() = adam.global_count();
  step(adam, table, 4);
  step(resumed, resumed_table, 4);
  EXPECT_EQ(table, resumed_table);
}

TEST(SparseAdam, EmptyStepAndStateSize) {
  std::vector<float> table(8, 1.0f);
  SparseAdam adam(2, 4, {});
  EXPECT_EQ(adam.step(table, {}, {}, 0.1).touched, 0);
  EXPECT_EQ(table, std::vector<float>(8, 1.0f));
  EXPECT_EQ(SparseAdam::bytes(79'375'000, 4), 79'375'000LL * 34);
  // The state of a paper-size table costs nothing until entries are touched.
  SparseAdam large(79'375'000, 4, {});
  EXPECT_EQ(large.counts().size(), 79'375'000u);
}

}  // namespace
}  // namespace octrad
