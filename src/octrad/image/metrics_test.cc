#include "octrad/image/metrics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "octrad/base/error.h"
#include "octrad/base/rng.h"

namespace octrad {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

Image picture(int width, int height, const std::vector<Vec3f>& pixels) {
  Image image(width, height, {"R", "G", "B"});
  for (std::size_t p = 0; p < pixels.size(); ++p) {
    for (int c = 0; c < 3; ++c) image.data[3 * p + static_cast<std::size_t>(c)] = pixels[p][c];
  }
  return image;
}

TEST(Metrics, HandComputedValues) {
  const Image reference = picture(2, 1, {{0.99f, 0.49f, 0.0f}, {1.0f, 1.0f, 1.0f}});
  const Image image = picture(2, 1, {{1.09f, 0.39f, 0.01f}, {1.0f, 1.0f, 1.0f}});
  const Metrics m = compare(reference, image);
  // First pixel: 0.1 / 1.0, 0.1 / 0.5, 0.01 / 0.01; second: 0.
  EXPECT_NEAR(m.mape, (0.1 + 0.2 + 1.0) / 3.0 / 2.0, 1e-6);
  EXPECT_NEAR(m.mape_trimmed, m.mape, 1e-12);  // 0.1 % of 2 pixels is none
  EXPECT_NEAR(m.mse, (0.01 + 0.01 + 0.0001) / 6.0, 1e-7);
  EXPECT_NEAR(m.relmse, (0.01 / (0.9801 + 0.01) + 0.01 / (0.2401 + 0.01) + 0.0001 / 0.01) / 6.0, 1e-7);
  const double lr = 0.212671 * 0.99 + 0.715160 * 0.49 + 1.0,
               li = 0.212671 * 1.09 + 0.715160 * 0.39 + 0.072169 * 0.01 + 1.0;
  EXPECT_NEAR(m.mean_ratio, li / lr, 1e-6);
  EXPECT_EQ(m.pixels, 2);
  EXPECT_EQ(m.non_finite_image + m.non_finite_reference, 0);
}

TEST(Metrics, PsnrIsOfDisplayedPictures) {
  // sRGB: 0.5 linear shows as 0.735357, 0.25 as 0.537099; values above 1 show as 1.
  const Metrics m = compare(picture(2, 1, {Vec3f(0.5f), Vec3f(2.0f)}), picture(2, 1, {Vec3f(0.25f), Vec3f(7.0f)}));
  const double d = 0.735357 - 0.537099;
  EXPECT_NEAR(m.psnr, -10.0 * std::log10(d * d / 2.0), 1e-3);
  const Image same = picture(1, 1, {Vec3f(0.3f)});
  EXPECT_TRUE(std::isinf(compare(same, same).psnr));
}

TEST(Metrics, TrimmingDropsTheWorstThousandth) {
  const int n = 2000;
  std::vector<Vec3f> reference(n, Vec3f(0.99f)), pixels(n, Vec3f(1.09f));
  pixels[3] = Vec3f(100.99f);
  pixels[77] = Vec3f(50.99f);
  const Metrics m = compare(picture(n, 1, reference), picture(n, 1, pixels));
  EXPECT_NEAR(m.mape_trimmed, 0.1, 1e-5);
  EXPECT_NEAR(m.mape, (0.1 * (n - 2) + 100.0 + 50.0) / n, 1e-4);
}

TEST(Metrics, MaskAndNonFiniteValues) {
  const Image reference = picture(4, 1, {Vec3f(0.99f), Vec3f(0.99f), Vec3f(kNan), Vec3f(0.99f)});
  const Image image = picture(4, 1, {Vec3f(0.89f), Vec3f(kNan), Vec3f(0.5f), Vec3f(50.0f)});
  const std::vector<std::uint8_t> mask = {1, 1, 1, 0};
  const Metrics m = compare(reference, image, mask);
  EXPECT_EQ(m.pixels, 2);
  EXPECT_EQ(m.non_finite_image, 1);
  EXPECT_EQ(m.non_finite_reference, 1);
  EXPECT_NEAR(m.mape, (0.1 + 0.99) / 2.0, 1e-6);  // a NaN pixel counts as black
  const Image errors = error_image(reference, image, ErrorKind::mape, mask);
  ASSERT_EQ(errors.channels, std::vector<std::string>{"Y"});
  EXPECT_NEAR(errors.data[0], 0.1f, 1e-5f);
  EXPECT_NEAR(errors.data[1], 0.99f, 1e-5f);
  EXPECT_EQ(errors.data[2], 0.0f);
  EXPECT_EQ(errors.data[3], 0.0f);
  EXPECT_NEAR(error_image(reference, image, ErrorKind::squared).data[0], 0.01f, 1e-5f);
  EXPECT_NEAR(error_image(reference, image, ErrorKind::relative_squared).data[0], 0.01f / 0.9901f, 1e-5f);
}

TEST(Metrics, RoughnessMask) {
  Image reference(5, 1, {"R", "G", "B", "normal.X", "normal.Y", "normal.Z", "roughness.Y"});
  const float roughness[5] = {0.0f, 0.2f, 0.5f, 1.0f, 0.0f};
  for (int x = 0; x < 5; ++x) {
    reference.at(x, 0, reference.channel("roughness.Y")) = roughness[x];
    reference.at(x, 0, reference.channel("normal.Y")) = x == 4 ? 0.0f : 1.0f;  // the last one hits nothing
  }
  EXPECT_EQ(roughness_mask(reference, 0.0f, 0.5f), (std::vector<std::uint8_t>{1, 1, 0, 0, 0}));
  EXPECT_EQ(roughness_mask(reference, 0.2f, 1.0f), (std::vector<std::uint8_t>{0, 1, 1, 0, 0}));
  EXPECT_THROW(roughness_mask(picture(1, 1, {Vec3f(1.0f)}), 0.0f, 1.0f), InputError);
}

TEST(Metrics, NoiseOfAReferenceFromASecondOne) {
  // Gaussian noise of a pixel with n samples: standard deviation s / sqrt(n). The estimate must be the distance to the
  // truth.
  const double s = 0.8, truth = 0.99;
  const int n_a = 64, n_b = 16, width = 200, height = 200;
  Image a(width, height, {"R", "G", "B"}), b = a, exact = a;
  Rng rng(1, RngPurpose::test, 0);
  const auto gauss = [&] {
    const double r = std::sqrt(-2.0 * std::log(1.0 - static_cast<double>(rng.uniform())));
    return r * std::cos(6.283185307179586 * static_cast<double>(rng.uniform()));
  };
  for (std::size_t i = 0; i < a.data.size(); ++i) {
    exact.data[i] = static_cast<float>(truth);
    a.data[i] = static_cast<float>(truth + s / std::sqrt(n_a) * gauss());
    b.data[i] = static_cast<float>(truth + s / std::sqrt(n_b) * gauss());
  }
  const Metrics estimate = reference_noise(a, b, static_cast<double>(n_b) / (n_a + n_b)), real = compare(exact, a);
  EXPECT_NEAR(estimate.mse, s * s / n_a, 0.02 * s * s / n_a);  // 5 sigma of 120,000 values
  EXPECT_NEAR(estimate.mape, real.mape, 0.03 * real.mape);     // the denominator is noisy in one and exact in the other
  EXPECT_NEAR(estimate.relmse, real.relmse, 0.08 * real.relmse);
  EXPECT_NEAR(reference_noise(a, b, 0.5).mse, compare(a, b).mse / 2.0, 1e-12);
}

TEST(Metrics, PictureMask) {
  EXPECT_EQ(picture_mask(picture(4, 1, {Vec3f(1.0f), Vec3f(0.5f), Vec3f(0.49f), Vec3f(kNan)})),
            (std::vector<std::uint8_t>{1, 1, 0, 0}));
  EXPECT_EQ(picture_mask(picture(2, 1, {{1.0f, 1.0f, 0.0f}, {1.0f, 0.0f, 0.0f}})), (std::vector<std::uint8_t>{1, 0}));
  EXPECT_THROW(picture_mask(Image(1, 1, {"depth.Z"})), InputError);
}

TEST(Metrics, RefusesWhatCannotBeCompared) {
  EXPECT_THROW(compare(picture(2, 1, {Vec3f(1.0f), Vec3f(1.0f)}), picture(1, 2, {Vec3f(1.0f), Vec3f(1.0f)})),
               InputError);
  EXPECT_THROW(compare(picture(1, 1, {Vec3f(kNan)}), picture(1, 1, {Vec3f(1.0f)})), InputError);
  EXPECT_THROW(compare(picture(1, 1, {Vec3f(1.0f)}), Image(1, 1, {"depth.Z"})), InputError);
  const std::vector<std::uint8_t> nothing = {0};
  EXPECT_THROW(compare(picture(1, 1, {Vec3f(1.0f)}), picture(1, 1, {Vec3f(1.0f)}), nothing), InputError);
}

}  // namespace
}  // namespace octrad
