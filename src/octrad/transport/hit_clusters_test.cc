#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "octrad/base/rng.h"
#include "octrad/transport/hit_clusters_math.h"

namespace octrad {
namespace {

struct Clusters {
  HitCluster cluster[kHitClusters];
  // Sum of squared distances from the centres.
  double cost(std::size_t rays) const {
    double sum = 0.0;
    for (const HitCluster& c : cluster)
      sum += static_cast<double>(c.share) * static_cast<double>(rays) * static_cast<double>(c.deviation) *
             static_cast<double>(c.deviation);
    return sum;
  }
};

Clusters cluster(const std::vector<float>& t, int iterations, int clusters = kHitClusters, int missed = 0) {
  Clusters result;
  cluster_hits(t.data(), static_cast<int>(t.size()), static_cast<int>(t.size()) + missed, clusters, iterations,
               result.cluster);
  return result;
}

// The least possible cost, by dynamic programming over the sorted distances: clusters of the optimum are intervals.
double least_cost(std::vector<float> t, int clusters) {
  std::sort(t.begin(), t.end());
  const std::size_t n = t.size();
  const auto interval = [&](std::size_t begin, std::size_t end) {
    double mean = 0.0, sum = 0.0;
    for (std::size_t i = begin; i < end; ++i) mean += static_cast<double>(t[i]) / static_cast<double>(end - begin);
    for (std::size_t i = begin; i < end; ++i)
      sum += (static_cast<double>(t[i]) - mean) * (static_cast<double>(t[i]) - mean);
    return sum;
  };
  std::vector<double> best(n + 1, HUGE_VAL);
  best[0] = 0.0;
  for (int k = 0; k < clusters; ++k) {
    std::vector<double> next(n + 1, HUGE_VAL);
    for (std::size_t end = 0; end <= n; ++end) {
      for (std::size_t begin = 0; begin <= end; ++begin)
        next[end] = std::min(next[end], best[begin] + interval(begin, end));
    }
    best = next;
  }
  return best[n];
}

// Around 1, 2.5, 4.2 and 6, which centres that start evenly find.
std::vector<float> four_groups(std::uint64_t seed) {
  Rng rng(seed, RngPurpose::test, 1);
  std::vector<float> t;
  for (int i = 0; i < 60; ++i)
    t.push_back(std::vector{1.0f, 2.5f, 4.2f, 6.0f}[rng.below(4)] + 0.4f * (rng.uniform() - 0.5f));
  return t;
}

std::vector<float> random_distances(std::uint64_t seed, int n) {
  Rng rng(seed, RngPurpose::test, 2);
  std::vector<float> t;
  for (int i = 0; i < n; ++i) t.push_back(std::exp(3.0f * rng.uniform()));
  return t;
}

TEST(HitClusters, SeparateGroupsGetTheLeastPossibleCost) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const std::vector<float> t = four_groups(seed);
    EXPECT_NEAR(cluster(t, 10).cost(t.size()), least_cost(t, 4), 1e-4 * least_cost(t, 4));
  }
}

TEST(HitClusters, IterationsNeverRaiseTheCostNorGoBelowTheLeast) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    for (const int clusters : {1, 2, 3, 4}) {
      const std::vector<float> t = random_distances(seed, 40);
      const double least = least_cost(t, clusters);
      double before = HUGE_VAL;
      for (int iterations = 1; iterations <= 12; ++iterations) {
        const double cost = cluster(t, iterations, clusters).cost(t.size());
        EXPECT_LE(cost, before * (1 + 1e-5));
        EXPECT_GE(cost, least * (1 - 1e-5));
        before = cost;
      }
      if (clusters == 1) {
        EXPECT_NEAR(before, least, 1e-4 * least);
      }
    }
  }
}

// Mean and deviation of each cluster are those of the members that the nearest centre gives.
TEST(HitClusters, AreMeansAndDeviationsOfTheirMembers) {
  const std::vector<float> t = random_distances(3, 50);
  const Clusters c = cluster(t, 40, 4, 10);  // converged
  for (const HitCluster& mine : c.cluster) {
    double count = 0.0, mean = 0.0, square = 0.0;
    for (const float d : t) {
      const bool nearest = std::all_of(std::begin(c.cluster), std::end(c.cluster), [&](const HitCluster& other) {
        return std::abs(d - mine.distance) <= std::abs(d - other.distance);
      });
      if (!nearest) continue;
      ++count;
      mean += static_cast<double>(d);
      square += static_cast<double>(d) * static_cast<double>(d);
    }
    mean /= count;
    EXPECT_NEAR(mine.share, count / 60.0, 1e-6);
    EXPECT_NEAR(mine.distance, mean, 1e-5 * mean);
    EXPECT_NEAR(mine.deviation, std::sqrt(square / count - mean * mean), 1e-4 * mean);
  }
}

TEST(HitClusters, DoNotDependOnTheOrder) {
  const std::vector<float> t = random_distances(4, 32);
  const Clusters expected = cluster(t, 3);
  std::vector<float> shuffled = t;
  Rng rng(5, RngPurpose::test, 3);
  for (int trial = 0; trial < 10; ++trial) {
    for (std::size_t i = shuffled.size(); i > 1; --i)
      std::swap(shuffled[i - 1], shuffled[rng.below(static_cast<std::uint32_t>(i))]);
    const Clusters c = cluster(shuffled, 3);
    for (int k = 0; k < kHitClusters; ++k) {
      EXPECT_NEAR(c.cluster[k].distance, expected.cluster[k].distance, 1e-5);
      EXPECT_NEAR(c.cluster[k].deviation, expected.cluster[k].deviation, 1e-5);
      EXPECT_EQ(c.cluster[k].share, expected.cluster[k].share);
    }
  }
}

TEST(HitClusters, NoneOneEqualAndMissed) {
  for (const HitCluster& c : cluster({}, 10, 4, 32).cluster) {
    EXPECT_EQ(c.share, 0.0f);
    EXPECT_EQ(c.distance, 0.0f);
  }
  const Clusters one = cluster({2.5f}, 10, 4, 3);
  EXPECT_EQ(one.cluster[0].distance, 2.5f);
  EXPECT_EQ(one.cluster[0].deviation, 0.0f);
  EXPECT_EQ(one.cluster[0].share, 0.25f);
  const Clusters equal = cluster(std::vector<float>(24, 3.0f), 10, 4, 8);
  EXPECT_EQ(equal.cluster[0].distance, 3.0f);
  EXPECT_EQ(equal.cluster[0].deviation, 0.0f);
  EXPECT_EQ(equal.cluster[0].share, 0.75f);
  for (int k = 1; k < kHitClusters; ++k) {
    EXPECT_EQ(one.cluster[k].share, 0.0f);
    EXPECT_EQ(equal.cluster[k].share, 0.0f);
  }
  const Clusters two = cluster({1.0f, 1.0f, 5.0f}, 10);  // clusters between them stay empty
  EXPECT_EQ(two.cluster[0].distance, 1.0f);
  EXPECT_EQ(two.cluster[1].share + two.cluster[2].share, 0.0f);
  EXPECT_EQ(two.cluster[3].distance, 5.0f);
  const Clusters single = cluster({1.0f, 2.0f, 6.0f}, 10, 1);
  EXPECT_NEAR(single.cluster[0].distance, 3.0f, 1e-6);
  EXPECT_EQ(single.cluster[0].share, 1.0f);
}

}  // namespace
}  // namespace octrad
