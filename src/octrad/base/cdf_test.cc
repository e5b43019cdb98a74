#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "octrad/base/cdf.h"
#include "octrad/base/rng.h"

namespace octrad {
namespace {

// What pick_entry() says it returns, by looking at every entry.
int first_above(const std::vector<CdfEntry>& cdf, float u) {
  const auto at = std::find_if(cdf.begin(), cdf.end(), [u](const CdfEntry& e) { return u < e.sum; });
  return static_cast<int>(std::min(at - cdf.begin(), static_cast<std::ptrdiff_t>(cdf.size()) - 1));
}

void expect_first_above(const std::vector<CdfEntry>& cdf, float u) {
  const int n = static_cast<int>(cdf.size()), i = pick_entry(cdf.data(), n, u);
  ASSERT_EQ(i, first_above(cdf, u)) << u << " of " << n;
  if (!(share_of(cdf.data(), i) > 0.0f)) return;
  const float rest = rest_of(cdf.data(), i, u);
  ASSERT_GE(rest, 0.0f);
  ASSERT_LT(rest, 1.0f);
  ASSERT_NEAR(sum_before(cdf.data(), i) + rest * share_of(cdf.data(), i), u, 1e-6f);
}

TEST(Cdf, PicksTheFirstEntryAboveTheNumber) {
  Rng rng(1, RngPurpose::test, 31);
  for (int n = 1; n < 3000; n = n * 3 / 2 + 1) {
    for (const int kind : {0, 1, 2, 3}) {
      std::vector<double> sums;
      double sum = 0.0;
      for (int i = 0; i < n; ++i) {
        const auto u = static_cast<double>(rng.uniform());
        // Alike; many of them 0; one that is nearly all; from tiny to large.
        sum += kind == 0   ? 1.0
               : kind == 1 ? (u < 0.7 ? 0.0 : u)
               : kind == 2 ? (i == n / 2 ? 1e9 : u)
                           : u / (1.0 + i * i);
        sums.push_back(sum);
      }
      const std::vector<CdfEntry> cdf = make_cdf(sums);
      EXPECT_EQ(cdf.back().sum, 1.0f);
      for (int k = 0; k < 500; ++k) expect_first_above(cdf, rng.uniform());
      for (int i = 0; i <= n; ++i) {  // where entries and slots begin
        const float start = static_cast<float>(i) / static_cast<float>(n),
                    below = sum_before(cdf.data(), std::min(i, n - 1));
        for (const float u : {start, std::nextafter(start, 0.0f), below, std::nextafter(below, 0.0f)})
          if (u < 1.0f) expect_first_above(cdf, u);
      }
    }
  }
}

TEST(Cdf, WithoutWeightsTheFirstEntryHasAll) {
  const std::vector<CdfEntry> cdf = make_cdf(std::vector<double>(4, 0.0));
  for (const float u : {0.0f, 0.3f, 0.99999994f}) EXPECT_EQ(pick_entry(cdf.data(), 4, u), 0);
  EXPECT_TRUE(make_cdf({}).empty());
}

// Most numbers look at one entry or two, also of a table whose entries are alike by no means.
TEST(Cdf, FewEntriesAreLookedAt) {
  Rng rng(2, RngPurpose::test, 32);
  std::vector<double> sums;
  double sum = 0.0;
  for (int i = 0; i < 10000; ++i) sums.push_back(sum += std::exp(10.0 * static_cast<double>(rng.uniform())));
  const std::vector<CdfEntry> cdf = make_cdf(sums);
  double looked_at = 0.0;
  for (int k = 0; k < 10000; ++k) {
    const float u = rng.uniform();
    looked_at +=
        pick_entry(cdf.data(), 10000, u) - static_cast<int>(cdf[static_cast<std::size_t>(u * 10000.0f)].first) + 1;
  }
  EXPECT_LT(looked_at / 10000.0, 2.5);
}

}  // namespace
}  // namespace octrad
