#include "octrad/image/bias.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "octrad/base/error.h"

namespace octrad {
namespace {

constexpr int kSide = 128;

float truth(int x, int y) { return 1.0f + 0.4f * std::sin(0.05f * static_cast<float>(x + 2 * y)); }

// The truth times `factor(x, y)` with independent noise of a standard deviation of `noise`.
template <typename F>
Image noisy(unsigned seed, float noise, F factor) {
  std::mt19937 generator(seed);
  std::normal_distribution<float> normal(0.0f, 1.0f);
  Image image(kSide, kSide, {"R", "G", "B"});
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const float t = truth(x, y) * factor(x, y);
      image.set_rgb(x, y,
                    {t + noise * normal(generator), t + noise * normal(generator), t + noise * normal(generator)});
    }
  }
  return image;
}
Image noisy(unsigned seed, float noise) {
  return noisy(seed, noise, [](int, int) { return 1.0f; });
}

TEST(Bias, TheNoiseFreeErrorIsTheErrorAgainstTheTruth) {
  const Image a = noisy(1, 0.03f), b = noisy(2, 0.03f), exact = noisy(0, 0.0f);
  const Image image = noisy(3, 0.0f, [](int x, int) { return x < kSide / 2 ? 1.03f : 1.0f; });
  double expected = 0.0;
  for (std::size_t k = 0; k < exact.data.size(); ++k) {
    const double t = exact.data[k], d = image.data[k] - t;
    expected += d * d / (t * t + 1e-4) / static_cast<double>(exact.data.size());
  }
  const double against_noise = noise_free_error(a, a, 0.5, image), free = noise_free_error(a, b, 0.5, image);
  EXPECT_GT(against_noise, 2.0 * expected);
  // The noise s of R in the denominator is left: relative to the error d about 4 s^2 / (d R), here 6 %.
  EXPECT_NEAR(free, expected, 0.15 * expected);
  // The truth itself has no error: six standard deviations of the mean of 49152 products, each with 0.0009.
  EXPECT_NEAR(noise_free_error(a, b, 0.5, exact), 0.0, 3e-5);
  EXPECT_GT(noise_free_error(a, a, 0.5, exact), 5e-4);
}

TEST(Bias, TheWeightedMeanIsInTheDenominator) {
  Image a(1, 1, {"Y"}), b(1, 1, {"Y"}), image(1, 1, {"Y"});
  a.data = {1.0f};
  b.data = {2.0f};
  image.data = {4.0f};
  EXPECT_NEAR(noise_free_error(a, b, 0.25, image), 3.0 * 2.0 / (1.25 * 1.25 + 1e-4), 1e-9);
}

TEST(Bias, SignedErrors) {
  Image reference(3, 1, {"R", "G", "B"}), image(3, 1, {"R", "G", "B"});
  reference.data = {0.99f, 0.99f, 0.99f, 0.0f, 0.0f, 0.0f, NAN, 0.0f, 0.0f};
  image.data = {1.99f, 0.99f, 0.99f, 0.0f, 0.0f, -0.01f, 1.0f, 1.0f, 1.0f};
  const Image error = signed_error_image(reference, image);
  EXPECT_NEAR(error.data[0], 1.0 / 3.0, 1e-6);
  EXPECT_NEAR(error.data[1], -1.0 / 3.0, 1e-6);
  EXPECT_EQ(error.data[2], 0.0f);
}

TEST(Bias, ScoresOfBlocksWithoutBiasAreStandardNormal) {
  const Image a = noisy(1, 0.2f), b = noisy(2, 0.2f);
  for (const float noise : {0.0f, 0.1f, 1.0f}) {  // of the picture: none, less and more than the reference's
    const BlockScores scores = block_scores(a, b, 0.5, noisy(3, noise));
    EXPECT_EQ(scores.blocks, 256);
    // Both errors are estimates, and the larger of two is used: scores come out a little small. 256 blocks: 0.044 each
    // way.
    EXPECT_NEAR(scores.rms, 0.95, 0.2) << noise;
    EXPECT_LE(scores.beyond_3, 0.02) << noise;
  }
}

// A reconstruction filter of a standard deviation of half a pixel.
Image filtered(const Image& image) {
  Image out = image;
  const float weight[3] = {0.1065f, 0.787f, 0.1065f};
  const auto clamped = [](int x) { return std::clamp(x, 0, kSide - 1); };
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      Vec3f sum(0.0f);
      for (int j = -1; j <= 1; ++j) {
        for (int i = -1; i <= 1; ++i)
          sum += image.rgb(clamped(x + i), clamped(y + j)) * (weight[i + 1] * weight[j + 1]);
      }
      out.set_rgb(x, y, sum);
    }
  }
  return out;
}

TEST(Bias, ScoresKnowThatFiltersCorrelatePixels) {
  const Image a = filtered(noisy(1, 0.1f)), b = filtered(noisy(2, 0.1f));
  const BlockScores scores = block_scores(a, b, 0.5, filtered(noisy(3, 0.1f)));
  EXPECT_NEAR(scores.rms, 1.0, 0.15);
  EXPECT_LT(scores.beyond_3, 0.02);
}

TEST(Bias, ScoresFindABiasThatNoiseHides) {
  const Image a = noisy(1, 0.2f), b = noisy(2, 0.2f);
  const BlockScores scores = block_scores(a, b, 0.5, noisy(3, 0.1f, [](int x, int) { return x < 64 ? 1.3f : 1.0f; }));
  double left = 0.0, right = 0.0;
  for (int y = 0; y < kSide; y += 8) {
    for (int x = 0; x < kSide; x += 8) (x < 64 ? left : right) += scores.z.at(x, y, 0) / 128.0;
  }
  EXPECT_GT(left, 5.0);
  EXPECT_NEAR(right, 0.0, 0.4);
  EXPECT_GT(scores.beyond_3, 0.3);
  EXPECT_EQ(scores.z.at(0, 0, 0), scores.z.at(7, 7, 0));
  EXPECT_NE(scores.z.at(0, 0, 0), scores.z.at(8, 0, 0));
}

TEST(Bias, ScoresOfOddCases) {
  const Image a = noisy(1, 0.2f), b = noisy(2, 0.2f);
  EXPECT_THROW(block_scores(a, b, 0.5, a, 1), InputError);
  EXPECT_THROW(block_scores(a, b, 0.5, Image(8, 8, {"Y"})), InputError);
  EXPECT_THROW(noise_free_error(a, b, 0.5, a, std::vector<std::uint8_t>(a.pixel_count(), 0)), InputError);
  // Without any noise a difference is beyond all doubt, and no difference is none.
  const Image exact = noisy(0, 0.0f, [](int, int) { return 0.0f; });
  Image brighter = exact;
  brighter.set_rgb(0, 0, Vec3f(1.0f));
  for (int k = 0; k < 64; ++k) brighter.set_rgb(8 + k % 8, k / 8, Vec3f(1.0f));
  const BlockScores sure = block_scores(exact, exact, 0.5, brighter);
  EXPECT_EQ(sure.z.at(8, 0, 0), 1000.0f);
  EXPECT_NEAR(sure.z.at(0, 0, 0), 1.0f, 1e-4f);  // one pixel of 64: its scatter is its mean's error
  EXPECT_EQ(sure.z.at(16, 0, 0), 0.0f);
  std::vector<std::uint8_t> one(a.pixel_count(), 0);
  one[0] = 1;
  const BlockScores none = block_scores(a, b, 0.5, a, 8, one);
  EXPECT_EQ(none.blocks, 0);
  EXPECT_TRUE(std::isnan(none.z.data[0]));
}

}  // namespace
}  // namespace octrad
