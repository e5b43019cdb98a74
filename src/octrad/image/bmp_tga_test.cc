// BMP and TGA: every layout, from bytes that are made here.
#include <gtest/gtest.h>

#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

#include "octrad/base/error.h"
#include "octrad/image/io.h"

namespace octrad {
namespace {

// Bytes of a file, numbers low byte first.
std::string little(std::initializer_list<std::pair<long long, int>> numbers) {
  std::string out;
  for (const auto& [value, bytes] : numbers) {
    for (int i = 0; i < bytes; ++i) out += static_cast<char>(value >> (8 * i) & 0xff);
  }
  return out;
}

std::string bmp_header(int width, int height, int depth, int compression, int palette) {
  return "BM" + little({{0, 4},
                        {0, 4},
                        {54 + palette, 4},
                        {40, 4},
                        {width, 4},
                        {height, 4},
                        {1, 2},
                        {depth, 2},
                        {compression, 4},
                        {0, 4},
                        {0, 4},
                        {0, 4},
                        {0, 4},
                        {0, 4}});
}

// Two by two pixels: red, green / blue, white.
void expect_four_colors(const Image& image, const std::string& what) {
  ASSERT_EQ(image.width, 2) << what;
  ASSERT_EQ(image.height, 2) << what;
  EXPECT_EQ(image.metadata.at("encoding"), "srgb8") << what;
  EXPECT_EQ(image.rgb(0, 0), Vec3f(1, 0, 0)) << what;
  EXPECT_EQ(image.rgb(1, 0), Vec3f(0, 1, 0)) << what;
  EXPECT_EQ(image.rgb(0, 1), Vec3f(0, 0, 1)) << what;
  EXPECT_EQ(image.rgb(1, 1), Vec3f(1, 1, 1)) << what;
}

TEST(Bmp, Layouts) {
  const std::string red("\x00\x00\xff", 3), green("\x00\xff\x00", 3), blue("\xff\x00\x00", 3), white("\xff\xff\xff", 3),
      pad(2, '\0'), one(1, '\0');
  const std::string top = red + green + pad, bottom = blue + white + pad;
  expect_four_colors(parse_image("a", bmp_header(2, 2, 24, 0, 0) + bottom + top), "24 bits");
  expect_four_colors(parse_image("a", bmp_header(2, -2, 24, 0, 0) + top + bottom), "from the top");
  expect_four_colors(parse_image("a", bmp_header(2, 2, 32, 0, 0) + blue + one + white + one + red + one + green + one),
                     "32 bits");
  expect_four_colors(
      parse_image("a", bmp_header(2, 2, 16, 0, 0) + little({{0x1f, 2}, {0x7fff, 2}, {0x7c00, 2}, {0x3e0, 2}})),
      "16 bits");
  const std::string palette = red + one + green + one + blue + one + white + one;
  expect_four_colors(
      parse_image("a", bmp_header(2, 2, 8, 0, 16) + palette + std::string("\x02\x03\x00\x00\x00\x01\x00\x00", 8)),
      "8 bits");
  expect_four_colors(
      parse_image("a", bmp_header(2, 2, 4, 0, 16) + palette + std::string("\x23\x00\x00\x00\x01\x00\x00\x00", 8)),
      "4 bits");
  expect_four_colors(
      parse_image(
          "a",
          bmp_header(2, 2, 32, 3, 12) +
              little({{0xff, 4}, {0xff00, 4}, {0xff0000, 4}, {0xff0000, 4}, {0xffffff, 4}, {0xff, 4}, {0xff00, 4}})),
      "masks");
  const std::string whole = bmp_header(2, 2, 24, 0, 0) + bottom + top;
  for (std::size_t size = 2; size < whole.size(); ++size)
    EXPECT_THROW(parse_image("a", whole.substr(0, size)), InputError) << size;
  EXPECT_THROW(parse_image("a", bmp_header(2, 2, 8, 1, 0) + std::string(64, '\0')), InputError);  // run-length encoded
  EXPECT_THROW(parse_image("a", bmp_header(2, 2, 7, 0, 0) + std::string(64, '\0')), InputError);
  EXPECT_THROW(parse_image("a", bmp_header(1 << 20, 1, 24, 0, 0) + std::string(64, '\0')), InputError);
  EXPECT_THROW(parse_image("a", bmp_header(-2, 2, 24, 0, 0) + std::string(64, '\0')), InputError);
}

std::string tga_header(int type, int width, int height, int depth, int descriptor, int map = 0) {
  return little({{0, 1},
                 {map > 0, 1},
                 {type, 1},
                 {0, 2},
                 {map, 2},
                 {map > 0 ? 24 : 0, 1},
                 {0, 4},
                 {width, 2},
                 {height, 2},
                 {depth, 1},
                 {descriptor, 1}});
}

TEST(Tga, Layouts) {
  const std::string red("\x00\x00\xff", 3), green("\x00\xff\x00", 3), blue("\xff\x00\x00", 3), white("\xff\xff\xff", 3),
      one(1, '\0');
  const std::string top = red + green, bottom = blue + white;
  expect_four_colors(parse_image("a.tga", tga_header(2, 2, 2, 24, 0) + bottom + top), "24 bits");
  expect_four_colors(parse_image("a.TGA", tga_header(2, 2, 2, 24, 0x20) + top + bottom), "from the top");
  expect_four_colors(parse_image("a.tga", tga_header(2, 2, 2, 24, 0x30) + green + red + white + blue),
                     "from the right");
  expect_four_colors(
      parse_image("a.tga", tga_header(2, 2, 2, 32, 0x20) + red + one + green + one + blue + one + white + one),
      "32 bits");
  expect_four_colors(
      parse_image("a.tga", tga_header(2, 2, 2, 16, 0x20) + little({{0x7c00, 2}, {0x3e0, 2}, {0x1f, 2}, {0x7fff, 2}})),
      "16 bits");
  expect_four_colors(parse_image("a.tga", tga_header(1, 2, 2, 8, 0x20, 4) + red + green + blue + white +
                                              std::string("\x00\x01\x02\x03", 4)),
                     "palette");
  expect_four_colors(parse_image("a.tga", tga_header(10, 2, 2, 24, 0x20) + std::string("\x80", 1) + red +
                                              std::string("\x02", 1) + green + blue + white),
                     "runs");
  expect_four_colors(parse_image("a", tga_header(2, 2, 2, 24, 0) + bottom + top + std::string(8, '\0') +
                                          std::string("TRUEVISION-XFILE.\0", 18)),
                     "by its footer");
  const Image runs = parse_image("a.tga", tga_header(11, 3, 1, 8, 0x20) + std::string("\x82\xff", 2));
  ASSERT_EQ(runs.channel_count(), 1);
  const Image alpha = parse_image("a.tga", tga_header(3, 2, 1, 16, 0x28) + std::string("\xff\x80\x00\x80", 4));
  EXPECT_EQ(alpha.data, (std::vector<float>{1.0f, 0.0f}));
  for (int x = 0; x < 3; ++x) EXPECT_EQ(runs.at(x, 0, 0), 1.0f);
  const std::string whole = tga_header(2, 2, 2, 24, 0) + bottom + top;
  for (std::size_t size = 0; size < whole.size(); ++size)
    EXPECT_THROW(parse_image("a.tga", whole.substr(0, size)), InputError) << size;
  EXPECT_THROW(parse_image("a.tga", tga_header(1, 2, 2, 8, 0x20, 1) + red + std::string("\x00\x01\x02\x03", 4)),
               InputError);  // outside of the palette
  EXPECT_THROW(parse_image("a.tga", tga_header(4, 2, 2, 24, 0) + std::string(64, '\0')), InputError);
  EXPECT_THROW(parse_image("a.tga", tga_header(10, 60000, 60000, 24, 0) + std::string(64, '\0')), InputError);
}

}  // namespace
}  // namespace octrad
