// FLIP is compared with the authors' implementation in tests/test_metrics.py; here, what holds for any correct one.
#include "octrad/image/flip.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "octrad/base/each_target_test_helper.h"
#include "octrad/base/error.h"
#include "octrad/base/rng.h"

namespace octrad {
namespace {

Image random_picture(int width, int height, float largest, std::uint64_t seed) {
  Image image(width, height, {"R", "G", "B"});
  Rng rng(seed, RngPurpose::test, 0);
  for (float& v : image.data) v = largest * rng.uniform();
  return image;
}

TEST(Flip, EveryInstructionSetAgrees) {
  const Image reference = random_picture(150, 70, 1.0f, 1), image = random_picture(150, 70, 1.0f, 2);
  const Image bright = random_picture(150, 70, 50.0f, 3);
  const FlipExposures exposures = flip_exposures(bright);
  const Image ldr = flip_ldr(reference, image), hdr = flip_hdr(bright, image, exposures);
  testing::for_each_simd_target([&] {
    const Image other = flip_ldr(reference, image), other_hdr = flip_hdr(bright, image, exposures);
    for (std::size_t p = 0; p < ldr.data.size(); ++p) {
      ASSERT_NEAR(other.data[p], ldr.data[p], 1e-4f);
      ASSERT_NEAR(other_hdr.data[p], hdr.data[p], 1e-4f);
    }
  });
}

TEST(Flip, BlackAgainstWhiteIsNearlyEverything) {
  Image black(200, 90, {"R", "G", "B"}), white(200, 90, {"R", "G", "B"});
  std::fill(white.data.begin(), white.data.end(), 1.0f);
  const Image error = flip_ldr(black, white);
  // 100^0.7 of the largest difference, on the upper line; without edges all pixels are equal, at the border too.
  for (const float e : error.data) EXPECT_NEAR(e, error.data[0], 1e-5f);
  EXPECT_GT(error.data[0], 0.95f);
  EXPECT_LE(error.data[0], 1.0f);
  const Image none = flip_ldr(white, white);
  EXPECT_EQ(*std::max_element(none.data.begin(), none.data.end()), 0.0f);
}

TEST(Flip, ADifferenceSpreadsAsFarAsTheFilters) {
  Image reference(160, 80, {"R", "G", "B"});
  std::fill(reference.data.begin(), reference.data.end(), 0.3f);
  Image image = reference;
  image.set_rgb(130, 40, {0.9f, 0.2f, 0.1f});  // two pixels beyond the border of a tile
  const Image error = flip_ldr(reference, image);
  for (int y = 0; y < 80; ++y) {
    for (int x = 0; x < 160; ++x) {
      if (std::abs(x - 130) <= 10 && std::abs(y - 40) <= 10) continue;
      EXPECT_EQ(error.at(x, y, 0), 0.0f) << x << ", " << y;
    }
  }
  EXPECT_GT(error.at(130, 40, 0), 0.1f);
  EXPECT_NEAR(error.at(127, 40, 0), error.at(133, 40, 0), 1e-5f);
}

TEST(Flip, Exposures) {
  Image image(2, 2, {"R", "G", "B"});
  image.data = {4.0f, 4.0f, 4.0f, 1.0f, 1.0f, 1.0f, 0.25f, 0.25f, 0.25f, 1.0f, 1.0f, 1.0f};
  const FlipExposures e = flip_exposures(image);
  EXPECT_NEAR(e.last - e.first, 2.0, 1e-5);  // from 4 to the median 1
  EXPECT_EQ(e.count, 2);
  // 0.85 through the curve for 0.6 x.
  const double x = 4.0 * std::exp2(e.first) * 0.6;
  EXPECT_NEAR(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 0.85, 1e-6);
  std::fill_n(image.data.begin() + 3, 9, 0.0f);
  EXPECT_NEAR(flip_exposures(image).last, flip_exposures(image).first, 1e-6);  // of the one pixel that is not black
  std::fill(image.data.begin(), image.data.end(), 0.0f);
  EXPECT_EQ(flip_exposures(image).count, 0);
  EXPECT_EQ(flip_hdr(image, image, flip_exposures(image)).data[0], 0.0f);
  EXPECT_THROW(flip_ldr(image, image, 0.5), InputError);
  EXPECT_THROW(flip_ldr(image, image, NAN), InputError);
}

}  // namespace
}  // namespace octrad
