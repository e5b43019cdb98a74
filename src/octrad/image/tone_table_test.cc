#include "octrad/image/tone_table.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "octrad/base/rng.h"
#include "octrad/image/encode.h"

namespace octrad {
namespace {

TEST(ToneTable, IsToneMappingToOneStep) {
  Rng rng(1, RngPurpose::pixel, 0);
  Image image(64, 64, {"A", "R", "G", "B"});
  for (float& v : image.data) v = std::exp2(30.0f * rng.uniform() - 18.0f);
  image.set_rgb(0, 0, {-1.0f, std::numeric_limits<float>::quiet_NaN(), 1e30f}, 1);
  const Vec3f white{0.8f, 1.0f, 1.3f};
  using Curve = ToneMapping::Curve;
  for (const Curve curve : {Curve::none, Curve::log1p, Curve::filmic}) {
    ToneMapping mapping;
    mapping.curve = curve;
    mapping.exposure = -1.5f;
    const Image8 shown = ToneTable(mapping, white)(image, 1);
    int other = 0;
    for (std::size_t i = 0; i < image.pixel_count(); ++i) {
      for (std::size_t c = 0; c < 3; ++c) {
        const float value = image.data[4 * i + 1 + c] * white[static_cast<int>(c)];
        const int expected = to_byte(tonemap(value, mapping)), found = shown.data[3 * i + c];
        ASSERT_LE(std::abs(expected - found), 1) << value;
        other += expected != found;
      }
    }
    EXPECT_LT(other, 64 * 64 * 3 / 10);
    EXPECT_EQ(shown.data[0], 0);
    EXPECT_EQ(shown.data[1], 0);
    EXPECT_EQ(shown.data[2], 255);
  }
}

TEST(Encode, BytesAreWhatReadersRead) {
  Image8 image(5, 3, 3);
  for (std::size_t i = 0; i < image.data.size(); ++i) image.data[i] = static_cast<std::uint8_t>(i * 5);
  const Image png = parse_image("png", encode_png(image)), jpeg = parse_image("jpeg", encode_jpeg(image, 100));
  for (std::size_t i = 0; i < image.data.size(); ++i) {
    EXPECT_EQ(std::lround(png.data[i] * 255.0f), image.data[i]);
    EXPECT_NEAR(jpeg.data[i] * 255.0f, image.data[i], 6.0f);
  }
  EXPECT_LT(encode_jpeg(image, 10).size(), encode_jpeg(image, 100).size());
  Image linear(2, 1, {"R", "G", "B"});
  linear.set_rgb(1, 0, {0.1f, 2.0f, 3e5f});
  linear.metadata["octrad.version"] = "x";
  const Image exr = parse_image("exr", encode_exr("exr", linear));
  EXPECT_EQ(exr.data, linear.data);
  EXPECT_EQ(exr.metadata.at("octrad.version"), "x");
}

}  // namespace
}  // namespace octrad
