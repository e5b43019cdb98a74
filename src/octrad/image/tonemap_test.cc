// Pictures for the screen: tone mapping, false colours, text and contact sheets.
#include "octrad/image/tonemap.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "octrad/base/error.h"
#include "octrad/image/contact_sheet.h"
#include "octrad/image/text.h"

namespace octrad {
namespace {

constexpr float kNotANumber = std::numeric_limits<float>::quiet_NaN();

Image8 filled(int width, int height, std::uint8_t value) {
  Image8 image(width, height, 3);
  std::fill(image.data.begin(), image.data.end(), value);
  return image;
}

int count_pixels(const Image8& image, std::uint8_t value) {
  int n = 0;
  for (std::size_t i = 0; i < image.data.size(); i += static_cast<std::size_t>(image.channels))
    n += image.data[i] == value;
  return n;
}

TEST(Tonemap, KnownValues) {
  EXPECT_NEAR(encode_srgb(0.5f), 0.735357f, 1e-5f);
  EXPECT_NEAR(encode_srgb(0.002f), 0.02584f, 1e-6f);
  for (float v = 0.0f; v <= 1.0f; v += 0.01f) EXPECT_NEAR(decode_srgb(encode_srgb(v)), v, 1e-5f);
  ToneMapping mapping;
  mapping.exposure = 1.0f;
  EXPECT_NEAR(tonemap(0.25f, mapping), 0.735357f, 1e-5f);
  mapping = {0.0f, ToneMapping::Curve::log1p, ToneMapping::Encoding::linear, 2.2f};
  EXPECT_NEAR(tonemap(1.0f, mapping), std::log(2.0f), 1e-6f);
  mapping.encoding = ToneMapping::Encoding::gamma;
  EXPECT_NEAR(tonemap(1.0f, mapping), std::pow(std::log(2.0f), 1.0f / 2.2f), 1e-6f);
  EXPECT_EQ(tonemap(100.0f, mapping), 1.0f);
  EXPECT_EQ(tonemap(-1.0f, mapping), 0.0f);
  EXPECT_EQ(tonemap(kNotANumber, mapping), 0.0f);
  EXPECT_EQ(tonemap(std::numeric_limits<float>::infinity(), mapping), 1.0f);

  Image image(2, 1, {"R", "G", "B"});
  image.data = {0.5f, 0.0f, 2.0f, 0.25f, 0.25f, 0.25f};
  const Image8 shown = tonemap(image, ToneMapping{});
  EXPECT_EQ(shown.data, (std::vector<std::uint8_t>{188, 0, 255, 137, 137, 137}));
}

TEST(Tonemap, TheFilmicCurveRisesFromBlackToWhite) {
  EXPECT_NEAR(filmic_curve(1.0f), 2.54f / 3.16f, 1e-6f);
  EXPECT_EQ(filmic_curve(0.0f), 0.0f);
  ToneMapping mapping{0.0f, ToneMapping::Curve::filmic, ToneMapping::Encoding::linear, 2.2f};
  float last = 0.0f;
  for (float v = 0.01f; v < 7.0f; v += 0.01f) {
    const float now = tonemap(v, mapping);
    EXPECT_GT(now, last) << v;
    last = now;
  }
  EXPECT_LT(last, 1.0f);
  EXPECT_EQ(tonemap(7.4f, mapping), 1.0f);
  EXPECT_EQ(tonemap(std::numeric_limits<float>::infinity(), mapping), 1.0f);
  EXPECT_EQ(tonemap(-1.0f, mapping), 0.0f);
}

TEST(Tonemap, VectorsAreShownFromMinusOneToOne) {
  Image image(3, 1, {"R", "G", "B", "normal.X", "normal.Y", "normal.Z", "albedo.R", "albedo.G", "albedo.B"});
  const Vec3f normals[3] = {{0.0f, -1.0f, 0.0f}, {0.6f, 0.8f, 0.0f}, {0.0f, 0.0f, 0.0f}};
  for (int x = 0; x < 3; ++x) image.set_rgb(x, 0, normals[x], 3);
  EXPECT_TRUE(is_vector_layer(image, "normal"));
  EXPECT_FALSE(is_vector_layer(image, "albedo"));
  EXPECT_FALSE(is_vector_layer(image, ""));
  EXPECT_EQ(vector_color(image, "normal").data, (std::vector<std::uint8_t>{128, 0, 128, 204, 230, 128, 0, 0, 0}));
  EXPECT_EQ(vector_color(image, "normal", 0.0f, 1.0f).data, (std::vector<std::uint8_t>{0, 0, 0, 153, 204, 0, 0, 0, 0}));
  EXPECT_THROW(vector_color(image, "normal", 1.0f, 1.0f), InputError);
  EXPECT_THROW(vector_color(image, "position"), InputError);
}

TEST(Tonemap, FalseColors) {
  Image values(3, 1, {"Y"});
  values.data = {-1.0f, 5.0f, kNotANumber};
  const Image8 colors = false_color(values, 0, 0.0f, 1.0f);
  EXPECT_EQ(colors.data, (std::vector<std::uint8_t>{0, 0, 0, 255, 255, 235, 0, 255, 0}));
  EXPECT_THROW(false_color(values, 0, 1.0f, 1.0f), InputError);
}

TEST(Text, EveryPrintableCharacterHasItsOwnShape) {
  std::vector<std::vector<std::uint8_t>> shapes;
  for (char c = ' '; c <= '~'; ++c) {
    Image8 image(5, 8, 1);
    draw_text(image, 0, 0, 1, std::string(1, c));
    EXPECT_EQ(count_pixels(image, 255) == 0, c == ' ') << c;
    for (const auto& other : shapes) EXPECT_NE(image.data, other) << c;
    shapes.push_back(image.data);
  }
}

TEST(Text, SizesScaleAndWhatLiesOutsideIsCut) {
  EXPECT_EQ(text_width("", 3), 0);
  EXPECT_EQ(text_width("ab", 1), 11);
  EXPECT_EQ(text_width("ab", 3), 33);
  EXPECT_EQ(text_width("\xc3\xa9", 1), 5);  // one character in UTF-8
  EXPECT_EQ(text_height(2), 16);
  Image8 small(5, 8, 3), large(10, 16, 3), outside(4, 4, 3);
  draw_text(small, 0, 0, 1, "R", 200);
  draw_text(large, 0, 0, 2, "R", 200);
  EXPECT_GT(count_pixels(small, 200), 10);
  EXPECT_EQ(count_pixels(large, 200), 4 * count_pixels(small, 200));
  draw_text(outside, -30, -2, 1, "cut off on every side", 200);
  EXPECT_EQ(fit_text("abcdef", 1, 35), "abcdef");
  EXPECT_EQ(fit_text("abcdef", 1, 34), "abc..");
  EXPECT_EQ(fit_text("abcdef", 2, 35), "a..");
  EXPECT_EQ(fit_text("abcdef", 1, 3), "");
}

TEST(ContactSheet, PicturesStandInRowsWithLabelsBelow) {
  const std::vector<LabelledImage> pictures = {
      {filled(40, 30, 100), "a"}, {filled(40, 30, 150), "b"}, {filled(20, 10, 200), "a very long name"}};
  const Image8 row = contact_sheet(pictures, 3), column = contact_sheet(pictures, 1), square = contact_sheet(pictures);
  EXPECT_GT(row.width, 3 * 40);
  EXPECT_LT(row.height, 2 * 30);
  EXPECT_GT(column.height, 3 * 30);
  EXPECT_LT(column.width, 2 * 40);
  EXPECT_EQ(square.width, contact_sheet(pictures, 2).width);
  EXPECT_EQ(contact_sheet(pictures, 100).width, row.width);  // no empty columns
  for (const Image8* sheet : {&row, &column, &square}) {
    EXPECT_EQ(count_pixels(*sheet, 100), 40 * 30);
    EXPECT_EQ(count_pixels(*sheet, 150), 40 * 30);
    EXPECT_EQ(count_pixels(*sheet, 200), 20 * 10);
    EXPECT_GT(count_pixels(*sheet, 255), 30);  // the labels
  }
  const std::size_t first = (4 * static_cast<std::size_t>(row.width) + 4) * 3;  // beyond the margin
  EXPECT_EQ(row.data[first], 100);
  EXPECT_EQ(row.data[first - 3], 32);
  EXPECT_THROW(contact_sheet({{filled(100000, 1, 0), ""}, {filled(1, 1, 0), ""}}, 2), InputError);
}

TEST(DisplayReferred, LinearAndShownValues) {
  Image linear(2, 1, {"R", "G", "B"}), stored(1, 1, {"Y"});
  linear.data = {0.5f, 2.0f, -1.0f, 0.0f, 1.0f, kNotANumber};
  EXPECT_FALSE(is_display_referred(linear));
  EXPECT_EQ(linear_color(linear).data[1], 2.0f);
  const Image shown = display_color(linear), limited = shown_linear_color(linear);
  EXPECT_TRUE(is_display_referred(shown));
  EXPECT_NEAR(shown.data[0], 0.735357f, 1e-5f);
  for (const Image* image : {&shown, &limited}) {
    EXPECT_NEAR(image->data[1], 1.0f, 1e-6f);
    EXPECT_EQ(image->data[2], 0.0f);
    EXPECT_EQ(image->data[5], 0.0f);
  }
  EXPECT_EQ(limited.data[0], 0.5f);
  stored.data = {0.735357f};
  stored.metadata["encoding"] = "srgb8";
  EXPECT_EQ(display_color(stored).data, std::vector<float>(3, 0.735357f));
  EXPECT_NEAR(linear_color(stored).data[2], 0.5f, 1e-5f);
  EXPECT_FALSE(is_display_referred(linear_color(stored)));
}

TEST(SignedColor, BlueWhiteRed) {
  Image image(5, 1, {"Y"});
  image.data = {-2.0f, 0.0f, 1.0f, 9.0f, kNotANumber};
  const Image8 out = signed_color(image, 0, 2.0f);
  const auto pixel = [&](std::size_t p) {
    return std::vector<int>(out.data.begin() + 3 * static_cast<std::ptrdiff_t>(p),
                            out.data.begin() + 3 * static_cast<std::ptrdiff_t>(p) + 3);
  };
  EXPECT_EQ(pixel(1), (std::vector<int>{255, 255, 255}));
  EXPECT_GT(pixel(0)[2], 2 * pixel(0)[0]);
  EXPECT_EQ(pixel(2), (std::vector<int>{242, 128, 89}));
  EXPECT_GT(pixel(3)[0], 2 * pixel(3)[2]);
  EXPECT_EQ(pixel(4), (std::vector<int>{0, 255, 0}));
  EXPECT_THROW(signed_color(image, 0, 0.0f), InputError);
}

}  // namespace
}  // namespace octrad
