// WebP against pictures that libwebp's encoder made.
#include <gtest/gtest.h>
#include <webp/encode.h>

#include <string>
#include <vector>

#include "octrad/base/error.h"
#include "octrad/image/io.h"

namespace octrad {
namespace {

constexpr int kWidth = 24, kHeight = 17;

// Smooth colours; every value of alpha, where there is one, is above 0, as the encoder clears what cannot be seen.
std::vector<std::uint8_t> pixels(int channels) {
  std::vector<std::uint8_t> result;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const int values[4] = {10 * x, 15 * y, 5 * (x + y), 1 + 10 * y};
      for (int c = 0; c < channels; ++c) result.push_back(static_cast<std::uint8_t>(values[c]));
    }
  }
  return result;
}

std::string webp(int channels, bool lossless) {
  const std::vector<std::uint8_t> data = pixels(channels);
  std::uint8_t* out = nullptr;
  const int stride = kWidth * channels;
  const std::size_t size =
      lossless
          ? (channels == 4 ? WebPEncodeLosslessRGBA : WebPEncodeLosslessRGB)(data.data(), kWidth, kHeight, stride, &out)
          : (channels == 4 ? WebPEncodeRGBA : WebPEncodeRGB)(data.data(), kWidth, kHeight, stride, 95.0f, &out);
  std::string bytes(reinterpret_cast<const char*>(out), size);
  WebPFree(out);
  return bytes;
}

TEST(WebpTest, ColoursAndAlpha) {
  for (const int channels : {3, 4}) {
    for (const bool lossless : {true, false}) {
      const Image image = parse_image("a", webp(channels, lossless));
      ASSERT_EQ(image.width, kWidth);
      ASSERT_EQ(image.height, kHeight);
      EXPECT_EQ(image.channels, channels == 4 ? (std::vector<std::string>{"R", "G", "B", "A"})
                                              : (std::vector<std::string>{"R", "G", "B"}));
      EXPECT_EQ(image.metadata.at("encoding"), "srgb8");
      const std::vector<std::uint8_t> expected = pixels(channels);
      for (std::size_t i = 0; i < expected.size(); ++i)
        ASSERT_NEAR(image.data[i], static_cast<float>(expected[i]) / 255.0f, lossless ? 1e-6 : 0.09)
            << channels << " " << i;
    }
  }
}

TEST(WebpTest, BrokenFiles) {
  for (const bool lossless : {true, false}) {
    const std::string good = webp(4, lossless);
    for (std::size_t cut = 0; cut + 2 < good.size(); ++cut)
      EXPECT_THROW(parse_image("a", good.substr(0, cut)), InputError) << cut;
  }
  // The extended header of an animation, and of a picture of 16 M pixels a side.
  const std::string header("RIFF\x16\0\0\0WEBPVP8X\x0a\0\0\0", 20);
  try {
    parse_image("a", header + std::string("\x02\0\0\0\x07\0\0\x07\0\0", 10));
    FAIL();
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("a: animated WebP is not supported"), std::string::npos) << e.what();
  }
  EXPECT_THROW(parse_image("a", header + std::string("\0\0\0\0\xff\xff\xff\xff\xff\xff", 10)), InputError);
}

}  // namespace
}  // namespace octrad
