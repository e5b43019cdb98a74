#include "octrad/image/io.h"

#include <ImfArray.h>
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <ImfTiledOutputFile.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <half.h>
#include <unistd.h>
#include <csignal>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <limits>

// After <cstdio>, which it needs and does not include.
#include <jpeglib.h>

#include "octrad/base/bytes.h"
#include "octrad/base/error.h"
#include "octrad/base/memory_limit.h"
#include "octrad/base/rng.h"
#include "octrad/image/tonemap.h"

namespace octrad {
namespace {

namespace fs = std::filesystem;

class IoTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("octrad_io_" + std::to_string(::getpid()) + "_" +
                                           ::testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  void write_bytes(const std::string& name, const std::string& bytes) const {
    std::ofstream(path(name), std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  }
  std::string read_bytes(const std::string& name) const {
    std::ifstream in(path(name), std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  // The message of the error that reading throws; "" when it does not.
  template <typename E>
  std::string error_of(const std::string& name) const {
    try {
      read_image(path(name));
    } catch (const E& e) {
      return e.what();
    }
    return "";
  }

 private:
  fs::path folder_;
};

Image test_image(int width, int height, std::vector<std::string> channels) {
  Image image(width, height, std::move(channels));
  Rng rng(1, RngPurpose::test, 0);
  for (float& v : image.data) v = rng.uniform() * 10.0f - 2.0f;
  return image;
}

// Last four bytes of a chunk of a PNG file (PNG specification, annex D).
std::string crc_of(const std::string& bytes) {
  std::uint32_t crc = 0xffffffffu;
  for (const char byte : bytes) {
    crc ^= static_cast<unsigned char>(byte);
    for (int i = 0; i < 8; ++i) crc = crc & 1 ? 0xedb88320u ^ (crc >> 1) : crc >> 1;
  }
  std::string out;
  for (int shift = 24; shift >= 0; shift -= 8) out += static_cast<char>(~crc >> shift);
  return out;
}

std::string png_chunk(const std::string& type, const std::string& body) {
  const std::string length{0, 0, static_cast<char>(body.size() >> 8), static_cast<char>(body.size())};
  return length + type + body + crc_of(type + body);
}

struct PngHeader {
  int width, height, depth, color, interlace = 0;
};

// `rows`: each begins with the byte of its filter, 0. `chunks` stand before the pixels.
std::string png(const PngHeader& h, const std::string& rows, const std::string& chunks = "") {
  const auto byte = [](auto v) { return static_cast<char>(v); };
  const auto n = rows.size();
  std::uint32_t a = 1, b = 0;  // Adler-32
  for (const char c : rows) {
    a = (a + static_cast<unsigned char>(c)) % 65521;
    b = (b + a) % 65521;
  }
  const std::string zlib = std::string("\x78\x01\x01", 3) +  // one stored block
                           std::string{byte(n), byte(n >> 8), byte(~n), byte(~n >> 8)} + rows +
                           std::string{byte(b >> 8), byte(b), byte(a >> 8), byte(a)};
  return "\x89PNG\r\n\x1a\n" +
         png_chunk("IHDR", std::string{0, 0, 0, byte(h.width), 0, 0, 0, byte(h.height), byte(h.depth), byte(h.color), 0,
                                       0, byte(h.interlace)}) +
         chunks + png_chunk("IDAT", zlib) + png_chunk("IEND", "");
}

// A JPEG of 8 x 8 pixels, grey, all coefficients 0 but the first: every value is 128 + 8 * 8 / 8 = 136.
std::string grey_jpeg() {
  std::string s("\xff\xd8", 2);
  s += std::string("\xff\xdb\x00\x43\x00", 5) + std::string(64, '\x08');         // quantisation: 8
  s += std::string("\xff\xc0\x00\x0b\x08\x00\x08\x00\x08\x01\x01\x11\x00", 13);  // 8 x 8, one component
  std::string counts(16, '\0');
  counts[1] = 2;                                                                      // two codes of 2 bits
  s += std::string("\xff\xc4\x00\x15\x00", 5) + counts + std::string("\x04\x00", 2);  // DC: 00 -> 4 bits
  s += std::string("\xff\xc4\x00\x15\x10", 5) + counts + std::string("\x00\x01", 2);  // AC: 00 -> end of block
  s += std::string("\xff\xda\x00\x08\x01\x01\x00\x00\x3f\x00", 10);
  s += std::string("\x20\x7f", 2);  // 00 1000 00 | padding of ones: DC difference 8, end of block
  return s + std::string("\xff\xd9", 2);
}

// "" where the picture can be read.
std::string error_of_bytes(const std::string& bytes) {
  try {
    parse_image("a", bytes);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST_F(IoTest, PicturesAboveTheMemoryBudgetAreRefused) {
  Image8 black(4000, 4000, 3);  // 14 kB as PNG
  write_image(path("bomb.png"), black);
  set_memory_limit(resident_bytes() + (100 << 20));
  EXPECT_THROW(read_image(path("bomb.png")), MemoryError);
  set_memory_limit(resident_bytes() + (300 << 20));
  EXPECT_EQ(read_image(path("bomb.png")).width, 4000);
  set_memory_limit(0);
}

TEST_F(IoTest, ExrAttributesLargerThanTheFileAreRefused) {
  write_exr(path("a.exr"), test_image(2, 2, {"Y"}));
  const std::string exr = read_bytes("a.exr");
  std::string bad = exr;
  const std::size_t at =
      bad.find("compression") + std::string("compression").size() + 1 + std::string("compression").size() + 1;
  bad.replace(at, 4, "\xff\xff\xff\x7f");
  EXPECT_NE(error_of_bytes(bad).find("broken EXR header"), std::string::npos);
  for (std::size_t cut = 4; cut < exr.size(); ++cut) EXPECT_NE(error_of_bytes(exr.substr(0, cut)), "") << cut;
}

TEST_F(IoTest, ExrRoundTripKeepsEveryBitChannelAndAttribute) {
  Image image = test_image(13, 7,
                           {"R", "G", "B", "albedo.R", "albedo.G", "albedo.B", "depth.Z", "normal.X", "normal.Y",
                            "normal.Z", "roughness.Y"});
  image.metadata = {{"config", "{\"octree\": 5}"}, {"octrad.version", "0.1.0"}};
  image.at(0, 0, 0) = std::numeric_limits<float>::infinity();
  write_exr(path("a.exr"), image);
  const Image back = read_image(path("a.exr"));
  EXPECT_EQ(back.width, 13);
  EXPECT_EQ(back.height, 7);
  EXPECT_EQ(back.channels, image.channels);
  EXPECT_EQ(back.data, image.data);
  EXPECT_EQ(back.metadata, image.metadata);
  EXPECT_FALSE(fs::exists(path("a.exr.tmp")));
}

TEST_F(IoTest, ExrChannelsComeBackInUsefulOrder) {
  write_exr(path("a.exr"), test_image(2, 2, {"b.Z", "A", "B", "G", "R", "a.Y", "a.X", "b.other"}));
  EXPECT_EQ(read_image(path("a.exr")).channels,
            (std::vector<std::string>{"R", "G", "B", "A", "a.X", "a.Y", "b.Z", "b.other"}));
}

TEST_F(IoTest, ExrKeepsTheWindowOfACrop) {
  Image image = test_image(3, 2, {"R", "G", "B"});
  image.metadata = {{"dataWindow.min", "5 -1"}, {"displayWindow", "20 10"}};
  write_exr(path("a.exr"), image);
  const Image back = read_image(path("a.exr"));
  EXPECT_EQ(back.data, image.data);
  EXPECT_EQ(back.metadata, image.metadata);
}

TEST_F(IoTest, ExrHalfRounds) {
  Image image(1, 1, {"R", "G", "B"});
  image.data = {1.0f, 0.1f, 1e6f};
  write_exr(path("a.exr"), image, {ExrPrecision::half});
  const Image back = read_image(path("a.exr"));
  EXPECT_EQ(back.data[0], 1.0f);
  EXPECT_NEAR(back.data[1], 0.1f, 5e-5f);
  EXPECT_NE(back.data[1], 0.1f);
  EXPECT_EQ(back.data[2], 65504.0f);  // the largest, not infinity
}

TEST_F(IoTest, ExrReadsAllCompressionsTypesAndTiles) {
  const int width = 37, height = 41;
  const Imath::Box2i window(Imath::V2i(-3, 4), Imath::V2i(-3 + width - 1, 4 + height - 1));
  std::vector<float> r(static_cast<std::size_t>(width * height));
  std::vector<half> g(r.size());
  std::vector<unsigned> id(r.size());
  for (std::size_t i = 0; i < r.size(); ++i) {
    r[i] = static_cast<float>(i) / 16.0f;
    g[i] = half(static_cast<float>(i / static_cast<std::size_t>(width)) / 4.0f);
    id[i] = static_cast<unsigned>(i % 7);
  }
  for (int compression = Imf::NO_COMPRESSION; compression < Imf::NUM_COMPRESSION_METHODS; ++compression) {
    for (const bool tiled : {false, true}) {
      SCOPED_TRACE("compression " + std::to_string(compression) + (tiled ? " tiled" : ""));
      Imf::Header header(window, window);
      header.compression() = static_cast<Imf::Compression>(compression);
      header.channels().insert("R", Imf::Channel(Imf::FLOAT));
      header.channels().insert("G", Imf::Channel(Imf::HALF));
      header.channels().insert("id", Imf::Channel(Imf::UINT));
      Imf::FrameBuffer buffer;
      const std::size_t w = static_cast<std::size_t>(width);
      buffer.insert("R", Imf::Slice::Make(Imf::FLOAT, r.data(), window, 4, 4 * w));
      buffer.insert("G", Imf::Slice::Make(Imf::HALF, g.data(), window, 2, 2 * w));
      buffer.insert("id", Imf::Slice::Make(Imf::UINT, id.data(), window, 4, 4 * w));
      if (tiled) {
        header.setTileDescription(Imf::TileDescription(16, 16, Imf::MIPMAP_LEVELS));
        Imf::TiledOutputFile out(path("a.exr").c_str(), header, 0);
        out.setFrameBuffer(buffer);
        out.writeTiles(0, out.numXTiles() - 1, 0, out.numYTiles() - 1);
        for (int level = 1; level < out.numLevels(); ++level) {  // content does not matter; the file must be complete
          Imf::FrameBuffer small;
          const std::vector<char> zeros(4 * r.size(), 0);
          const Imath::Box2i box = out.dataWindowForLevel(level);
          for (const auto& [name, type] :
               {std::pair{"R", Imf::FLOAT}, std::pair{"G", Imf::HALF}, std::pair{"id", Imf::UINT}}) {
            small.insert(name, Imf::Slice::Make(type, zeros.data(), box, 4, 4 * w));
          }
          out.setFrameBuffer(small);
          out.writeTiles(0, out.numXTiles(level) - 1, 0, out.numYTiles(level) - 1, level);
        }
      } else {
        Imf::OutputFile out(path("a.exr").c_str(), header, 0);
        out.setFrameBuffer(buffer);
        out.writePixels(height);
      }
      const Image image = read_image(path("a.exr"));
      ASSERT_EQ(image.width, width);
      ASSERT_EQ(image.height, height);
      ASSERT_EQ(image.channels, (std::vector<std::string>{"R", "G", "id"}));
      const bool lossy = compression == Imf::PXR24_COMPRESSION || compression >= Imf::B44_COMPRESSION;
      double worst = 0.0;
      for (std::size_t i = 0; i < r.size(); ++i) {
        worst = std::max(worst,
                         std::abs(static_cast<double>(image.data[3 * i]) - static_cast<double>(r[i])) / (1.0 + r[i]));
        worst = std::max(
            worst, std::abs(static_cast<double>(image.data[3 * i + 1]) - static_cast<double>(g[i])) / (1.0 + g[i]));
        ASSERT_EQ(image.data[3 * i + 2], static_cast<float>(id[i]));
      }
      EXPECT_LE(worst, lossy ? 0.2 : 0.0);
    }
  }
}

TEST_F(IoTest, BrokenExrFilesAreRefused) {
  write_exr(path("a.exr"), test_image(40, 40, {"R", "G", "B"}));
  const std::string good = read_bytes("a.exr");
  for (std::size_t cut = 4; cut + 1 < good.size(); cut += good.size() / 23) {
    write_bytes("cut.exr", good.substr(0, cut));
    EXPECT_NE(error_of<InputError>("cut.exr").find("cut.exr: "), std::string::npos) << "cut at " << cut;
  }
  // Any single broken byte: an error or a picture, never a crash.
  Rng rng(2, RngPurpose::test, 0);
  for (int i = 0; i < 300; ++i) {
    std::string bad = good;
    const std::size_t at = i < 200 ? 4 + rng.below(500) : 4 + rng.below(static_cast<std::uint32_t>(good.size() - 4));
    bad[at] = static_cast<char>(rng.below(256));
    write_bytes("bad.exr", bad);
    try {
      read_image(path("bad.exr"));
    } catch (const InputError&) {
    }
  }
}

TEST_F(IoTest, HugeSizesAreRefusedBeforeAllocation) {
  write_exr(path("a.exr"), test_image(4, 4, {"R", "G", "B"}));
  std::string bytes = read_bytes("a.exr");
  const std::size_t window =
      bytes.find("dataWindow") + std::string("dataWindow").size() + 1 + std::string("box2i").size() + 1 + 4;
  const std::int32_t box[4] = {0, 0, 0x3ffffff, 0x3ffffff};
  bytes.replace(window, 16, reinterpret_cast<const char*>(box), 16);
  write_bytes("huge.exr", bytes);
  EXPECT_NE(error_of<InputError>("huge.exr").find("huge.exr"), std::string::npos);

  write_bytes("huge.hdr", "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 100000 +X 100000\n");
  EXPECT_NE(error_of<InputError>("huge.hdr").find("too large"), std::string::npos);

  Image8 small(2, 2, 3);
  write_image(path("a.png"), small);
  std::string png = read_bytes("a.png");
  const auto resize = [&](const std::string& size) {
    png.replace(16, 8, size);
    png.replace(29, 4, crc_of(png.substr(12, 17)));
  };
  resize(std::string("\x00\x01\x00\x00\x00\x01\x00\x00", 8));  // 65536 x 65536
  write_bytes("huge.png", png);
  EXPECT_NE(error_of<InputError>("huge.png").find("too large"), std::string::npos);
  resize(std::string("\x00\x00\x40\x00\x00\x00\x40\x00", 8));  // 16384 x 16384: allowed, but not in 70 bytes
  write_bytes("hollow.png", png);
  EXPECT_NE(error_of<InputError>("hollow.png").find("truncated"), std::string::npos);
}

TEST_F(IoTest, PngRoundTrip) {
  for (const int channels : {1, 3, 4}) {
    Image8 image(5, 3, channels);
    for (std::size_t i = 0; i < image.data.size(); ++i) image.data[i] = static_cast<std::uint8_t>(i * 4);
    write_image(path("a.png"), image);
    const Image back = read_image(path("a.png"));
    EXPECT_EQ(back.width, 5);
    EXPECT_EQ(back.height, 3);
    const std::vector<std::string> rgba = {"R", "G", "B", "A"};
    EXPECT_EQ(back.channels, channels == 1 ? std::vector<std::string>{"Y"}
                                           : std::vector<std::string>(rgba.begin(), rgba.begin() + channels));
    EXPECT_EQ(back.metadata.at("encoding"), "srgb8");
    for (std::size_t i = 0; i < image.data.size(); ++i)
      EXPECT_FLOAT_EQ(back.data[i], static_cast<float>(image.data[i]) / 255.0f);
  }
}

TEST_F(IoTest, ReadsSixteenBitPng) {
  // 2 x 1 grey, 16 bits: 0x0102 and 0xffff.
  write_bytes("a.png", png({2, 1, 16, 0}, std::string("\x00\x01\x02\xff\xff", 5)));
  const Image image = read_image(path("a.png"));
  ASSERT_EQ(image.channels, std::vector<std::string>{"Y"});
  EXPECT_FLOAT_EQ(image.data[0], 258.0f / 65535.0f);
  EXPECT_FLOAT_EQ(image.data[1], 1.0f);
}

TEST_F(IoTest, ReadsEveryLayoutOfPng) {
  const auto values = [&](const std::string& bytes) {
    const Image image = parse_image("a.png", bytes);
    std::vector<int> out;
    for (const float v : image.data) out.push_back(static_cast<int>(std::lround(v * 255.0f)));
    return std::pair(image.channels, out);
  };
  using ChannelNames = std::vector<std::string>;
  using Values = std::vector<int>;
  const std::string none;
  // One bit of grey: 1, 0. Two bits: 3, 1.
  EXPECT_EQ(values(png({2, 1, 1, 0}, std::string("\0\x80", 2))), std::pair(ChannelNames{"Y"}, Values({255, 0})));
  EXPECT_EQ(values(png({2, 1, 2, 0}, std::string("\0\xd0", 2))), std::pair(ChannelNames{"Y"}, Values({255, 85})));
  EXPECT_EQ(values(png({1, 1, 8, 4}, std::string("\0\x10\x20", 3))),
            std::pair(ChannelNames{"Y", "A"}, Values({16, 32})));
  // A palette of two colours, then with one of them transparent.
  const std::string palette = png_chunk("PLTE", "\x01\x02\x03\x04\x05\x06");
  const std::string indices("\0\x40", 2);  // 0, 1
  EXPECT_EQ(values(png({2, 1, 1, 3}, indices, palette)),
            std::pair(ChannelNames{"R", "G", "B"}, Values({1, 2, 3, 4, 5, 6})));
  EXPECT_EQ(values(png({2, 1, 1, 3}, indices, palette + png_chunk("tRNS", "\x07"))),
            std::pair(ChannelNames{"R", "G", "B", "A"}, Values({1, 2, 3, 7, 4, 5, 6, 255})));
  EXPECT_THROW(values(png({2, 1, 1, 3}, indices)), InputError) << "no palette";
  // What is said of gamma changes nothing.
  EXPECT_EQ(values(png({1, 1, 8, 0}, std::string("\0\x64", 2), png_chunk("gAMA", std::string("\0\x01\x86\xa0", 4)))),
            std::pair(ChannelNames{"Y"}, Values({100})));
  // Interlaced, 2 x 2: the passes hold (0, 0), (1, 0) and the second row.
  EXPECT_EQ(values(png({2, 2, 8, 0, 1}, std::string("\0\x01\0\x02\0\x03\x04", 7))),
            std::pair(ChannelNames{"Y"}, Values({1, 2, 3, 4})));
}

// 16 x 16 pixels of one colour: 1 value grey, 3 RGB, 4 CMYK, as Adobe's programs store it (inverted) or not.
std::string flat_jpeg(const std::vector<JSAMPLE>& color, bool progressive, bool adobe = true) {
  jpeg_compress_struct jpeg;
  jpeg_error_mgr errors;
  jpeg.err = jpeg_std_error(&errors);
  jpeg_create_compress(&jpeg);
  unsigned char* data = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&jpeg, &data, &size);
  jpeg.image_width = jpeg.image_height = 16;
  jpeg.input_components = static_cast<int>(color.size());
  jpeg.in_color_space = color.size() == 1 ? JCS_GRAYSCALE : color.size() == 3 ? JCS_RGB : JCS_CMYK;
  jpeg_set_defaults(&jpeg);
  jpeg_set_quality(&jpeg, 100, TRUE);
  if (progressive) jpeg_simple_progression(&jpeg);
  if (!adobe) jpeg.write_Adobe_marker = FALSE;
  jpeg_start_compress(&jpeg, TRUE);
  std::vector<JSAMPLE> row;
  for (int i = 0; i < 16; ++i) row.insert(row.end(), color.begin(), color.end());
  JSAMPROW line = row.data();
  for (int y = 0; y < 16; ++y) jpeg_write_scanlines(&jpeg, &line, 1);
  jpeg_finish_compress(&jpeg);
  jpeg_destroy_compress(&jpeg);
  std::string bytes(reinterpret_cast<const char*>(data), size);
  std::free(data);
  return bytes;
}

TEST_F(IoTest, ReadsProgressiveJpegAndInks) {
  const Image image = parse_image("a.jpg", flat_jpeg({200, 100, 50}, true));
  EXPECT_EQ(image.channels, (std::vector<std::string>{"R", "G", "B"}));
  EXPECT_NEAR(image.rgb(3, 9).x * 255.0f, 200.0f, 1.5f);
  EXPECT_NEAR(image.rgb(3, 9).z * 255.0f, 50.0f, 1.5f);
  EXPECT_EQ(parse_image("a.jpg", flat_jpeg({100}, true)).channels, std::vector<std::string>{"Y"});
  // A picture of inks: cyan 102 of 255, key 51 of 255.
  const Vec3f expected(0.6f * 0.8f, 0.8f, 0.8f);
  const Image inverted = parse_image("a.jpg", flat_jpeg({153, 255, 255, 204}, false)),
              plain = parse_image("a.jpg", flat_jpeg({102, 0, 0, 51}, false, false));
  for (const Image& inks : {inverted, plain}) {
    EXPECT_EQ(inks.channels, (std::vector<std::string>{"R", "G", "B"}));
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(inks.rgb(8, 8)[c], expected[c], 0.01f);
  }
  const std::string whole = flat_jpeg({200, 100, 50}, true);
  for (std::size_t cut = 3; cut < whole.size(); ++cut) EXPECT_NE(error_of_bytes(whole.substr(0, cut)), "") << cut;
}

TEST_F(IoTest, JpegOfTooManyHuffmanCodesIsRefused) {
  std::string jpeg = grey_jpeg();
  const std::size_t table = jpeg.find(std::string("\xff\xc4\x00\x15\x00", 5));
  for (std::size_t i = 0; i < 16; ++i) jpeg[table + 5 + i] = '\xff';
  EXPECT_NE(error_of_bytes(jpeg).find("JPEG"), std::string::npos);
}

TEST_F(IoTest, ReadsJpegAndRefusesATruncatedOne) {
  const std::string jpeg = grey_jpeg();
  write_bytes("a.jpg", jpeg);
  const Image image = read_image(path("a.jpg"));
  ASSERT_EQ(image.channels, std::vector<std::string>{"Y"});
  ASSERT_EQ(image.pixel_count(), 64u);
  for (const float v : image.data) EXPECT_FLOAT_EQ(v, 136.0f / 255.0f);
  std::string zeros = jpeg;  // where a scan says that it has all numbers: of no use in a sequential file
  zeros[zeros.find(std::string("\x00\x3f\x00", 3)) + 1] = '\0';
  EXPECT_EQ(parse_image("a", zeros).data, image.data);
  for (std::size_t cut = 3; cut < jpeg.size(); ++cut) {
    write_bytes("cut.jpg", jpeg.substr(0, cut));
    EXPECT_NE(error_of<InputError>("cut.jpg"), "") << cut;
  }
}

TEST_F(IoTest, ReadsHdrInBothForms) {
  const std::string header = "#?RADIANCE\n# comment\nFORMAT=32-bit_rle_rgbe\n\n";
  write_bytes("flat.hdr", header + "-Y 1 +X 3\n" + std::string("\x80\x40\x20\x81\x01\x01\x01\x01\x00\x00\x00\x00", 12));
  const Image flat = read_image(path("flat.hdr"));  // mantissa / 256 * 2^(exponent - 128), a repeat, black
  EXPECT_EQ(flat.metadata.at("encoding"), "linear");
  EXPECT_EQ(flat.rgb(0, 0), Vec3f(1.0f, 0.5f, 0.25f));
  EXPECT_EQ(flat.rgb(1, 0), Vec3f(1.0f, 0.5f, 0.25f));
  EXPECT_EQ(flat.rgb(2, 0), Vec3f(0.0f));

  std::string rle = header + "-Y 2 +X 8\n";
  for (int y = 0; y < 2; ++y) {
    rle += std::string("\x02\x02\x00\x08", 4) + std::string("\x88\x80", 2);  // red: run of 8
    rle += std::string("\x04\x10\x20\x30\x40\x84\x50", 7);                   // green: 4 literals, run of 4
    rle += std::string("\x88\x00", 2) + std::string("\x88\x82", 2);          // blue 0, exponent +2
  }
  write_bytes("rle.hdr", rle);
  const Image image = read_image(path("rle.hdr"));
  EXPECT_EQ(image.rgb(2, 1), Vec3f(2.0f, 0.75f, 0.0f));
  EXPECT_EQ(image.rgb(7, 0), Vec3f(2.0f, 1.25f, 0.0f));
  for (std::size_t cut = 2; cut < rle.size(); ++cut) {
    write_bytes("cut.hdr", rle.substr(0, cut));
    EXPECT_NE(error_of<InputError>("cut.hdr"), "") << cut;
  }
  Rng rng(3, RngPurpose::test, 0);
  for (int i = 0; i < 500; ++i) {
    std::string bad = rle;
    bad[2 + rng.below(static_cast<std::uint32_t>(bad.size() - 2))] = static_cast<char>(rng.below(256));
    write_bytes("bad.hdr", bad);
    try {
      read_image(path("bad.hdr"));
    } catch (const InputError&) {
    }
  }
}

TEST_F(IoTest, BrokenPngAndJpegNeverCrash) {
  Image8 image(40, 30, 3);
  Rng rng(4, RngPurpose::test, 0);
  for (std::uint8_t& v : image.data) v = static_cast<std::uint8_t>(rng.below(8));
  write_image(path("a.png"), image);
  const std::string png = read_bytes("a.png"), jpeg = grey_jpeg();
  for (std::size_t cut = 8; cut < png.size() - 12; cut += 29) {
    write_bytes("cut.png", png.substr(0, cut));
    EXPECT_NE(error_of<InputError>("cut.png").find("cut.png: "), std::string::npos) << cut;
  }
  for (int i = 0; i < 400; ++i) {
    std::string bad = i % 2 == 0 ? png : jpeg;
    bad[3 + rng.below(static_cast<std::uint32_t>(bad.size() - 3))] = static_cast<char>(rng.below(256));
    write_bytes("bad", bad);
    try {
      read_image(path("bad"));
    } catch (const InputError&) {
    }
  }
}

TEST_F(IoTest, TheEndingSaysWhatIsWritten) {
  Image image = test_image(9, 5, {"R", "G", "B", "depth.Z"});
  for (float& v : image.data) v = std::abs(v);
  const Image rgb = extract_rgb(image);
  for (const auto& [name, magic] : {std::pair{"a.exr", "\x76\x2f\x31\x01"},
                                    {"a.HDR", "#?RADIANCE"},
                                    {"a.pfm", "PF\n9 5\n-1"},
                                    {"a.png", "\x89PNG"},
                                    {"a.jpg", "\xff\xd8\xff"},
                                    {"a.b.JPEG", "\xff\xd8\xff"}}) {
    SCOPED_TRACE(name);
    write_image(path(name), image);
    EXPECT_EQ(read_bytes(name).rfind(magic, 0), 0u);
    EXPECT_FALSE(fs::exists(path(name) + ".tmp"));
    const Image back = read_image(path(name));
    EXPECT_EQ(back.width, 9);
    EXPECT_EQ(back.height, 5);
    EXPECT_EQ(back.channels.size(), picture_format(name) == PictureFormat::exr ? 4u : 3u);
  }
  EXPECT_EQ(read_image(path("a.exr")).data, image.data);
  EXPECT_EQ(read_image(path("a.pfm")).data, rgb.data);
  // RGBE: 8 bits of the largest channel's exponent.
  const Image hdr = read_image(path("a.HDR"));
  for (int y = 0; y < 5; ++y) {
    for (int x = 0; x < 9; ++x) {
      for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(hdr.rgb(x, y)[c], rgb.rgb(x, y)[c], max_component(rgb.rgb(x, y)) / 256.0f) << x << " " << y;
    }
  }
  // What the screen shows: the same bytes as tonemap(), nearly so after the losses of JPEG.
  ToneMapping mapping;
  mapping.exposure = -2.0f;
  write_image(path("b.png"), image, mapping);
  const Image8 shown = tonemap(image, mapping);
  const Image png = read_image(path("b.png"));
  for (std::size_t i = 0; i < shown.data.size(); ++i)
    ASSERT_FLOAT_EQ(png.data[i], static_cast<float>(shown.data[i]) / 255.0f);
  Image flat(16, 16, {"R", "G", "B"});
  for (std::size_t i = 0; i < flat.data.size(); ++i) flat.data[i] = i % 3 == 0 ? 0.5f : 0.1f;
  write_image(path("flat.jpg"), flat);
  const Image jpg = read_image(path("flat.jpg"));
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(jpg.rgb(7, 9)[c], encode_srgb(flat.rgb(7, 9)[c]), 3.0f / 255.0f);

  for (const char* name : {"a.tiff", "exr", "a", ".exr", "a.png "}) {
    try {
      write_image(path(name), image);
      ADD_FAILURE() << name << " was written";
    } catch (const UsageError& e) {
      EXPECT_NE(std::string(e.what()).find(".exr, .hdr or .pfm"), std::string::npos) << e.what();
    }
    EXPECT_FALSE(fs::exists(path(name)));
  }
  EXPECT_EQ(picture_format("/dev/null"), PictureFormat::exr);
  EXPECT_THROW(write_image(path("c.hdr"), shown), UsageError);
  EXPECT_THROW(write_image(path("c.png"), Image(1, 1, {"depth.Z"})), InputError);
}

TEST_F(IoTest, HdrHoldsWhatRgbeCan) {
  const float huge = std::numeric_limits<float>::max(), inf = std::numeric_limits<float>::infinity();
  Image image(8, 1, {"R", "G", "B"});
  const Vec3f values[8] = {{1.0f, 0.5f, 0.25f},  {0.999f, 0.0f, 0.0f},  {-1.0f, std::nanf(""), 2.0f},
                           {huge, inf, 1.0f},    {1e-42f, 0.0f, 0.0f},  {0.0f, 0.0f, 0.0f},
                           {255.5f, 0.4f, 0.6f}, {3e-38f, 1e-38f, 0.0f}};
  for (int x = 0; x < 8; ++x) image.set_rgb(x, 0, values[x]);
  write_image(path("a.hdr"), image);
  const Image back = read_image(path("a.hdr"));
  EXPECT_EQ(back.rgb(0, 0), Vec3f(1.0f, 0.5f, 0.25f));
  EXPECT_EQ(back.rgb(1, 0), Vec3f(1.0f, 0.0f, 0.0f));  // rounds up into the next exponent
  EXPECT_EQ(back.rgb(2, 0), Vec3f(0.0f, 0.0f, 2.0f));
  EXPECT_EQ(back.rgb(3, 0), Vec3f(0x0.ffp127f, 0x0.ffp127f, 0.0f));
  EXPECT_EQ(back.rgb(4, 0), Vec3f(0.0f));
  EXPECT_EQ(back.rgb(5, 0), Vec3f(0.0f));
  EXPECT_EQ(back.rgb(6, 0), Vec3f(256.0f, 0.0f, 0.0f));
  EXPECT_NEAR(back.rgb(7, 0).x, 3e-38f, 1e-40f);
}

TEST_F(IoTest, ReadsPfmInBothByteOrdersAndRefusesBrokenOnes) {
  const auto floats = [](std::initializer_list<std::uint32_t> words, bool big) {
    std::string out;
    for (const std::uint32_t w : words) {
      for (int b = 0; b < 4; ++b) out += static_cast<char>(w >> 8 * (big ? 3 - b : b));
    }
    return out;
  };
  const std::uint32_t one = 0x3f800000, two = 0x40000000, half = 0x3f000000;
  write_bytes("grey.pfm", "Pf\n1 2\n1.0\n" + floats({one, two}, true));  // the first row is the lower one
  const Image grey = read_image(path("grey.pfm"));
  EXPECT_EQ(grey.channels, std::vector<std::string>{"Y"});
  EXPECT_EQ(grey.data, (std::vector<float>{2.0f, 1.0f}));
  EXPECT_EQ(grey.metadata.at("encoding"), "linear");
  const std::string good = "PF 1 1 -1\n" + floats({one, two, half}, false);
  write_bytes("colour.pfm", good);
  EXPECT_EQ(read_image(path("colour.pfm")).data, (std::vector<float>{1.0f, 2.0f, 0.5f}));
  write_bytes("scaled.pfm", "PF 1 1 -4\n" + good.substr(good.size() - 12));
  EXPECT_EQ(read_image(path("scaled.pfm")).data, (std::vector<float>{4.0f, 8.0f, 2.0f}));
  for (std::size_t cut = 2; cut < good.size(); ++cut) {
    write_bytes("cut.pfm", good.substr(0, cut));
    EXPECT_NE(error_of<InputError>("cut.pfm").find("cut.pfm: "), std::string::npos) << cut;
  }
  for (const char* header : {"PF\n-1 1\n-1\n", "PF\n1 1\n0\n", "PF\n1 1\nnan\n", "PX\n1 1\n-1\n",
                             "PF\n9999999 9999999\n-1\n", "PF\n1e9 1\n-1\n", "PF\n99999999999999999999 1\n-1\n"}) {
    write_bytes("bad.pfm", header + std::string(12, 'x'));
    EXPECT_NE(error_of<InputError>("bad.pfm"), "") << header;
  }
}

TEST_F(IoTest, ErrorsNameTheFileAndTheReason) {
  EXPECT_NE(error_of<IoError>("missing.exr").find("missing.exr: No such file"), std::string::npos);
  write_bytes("text.exr", "hello");
  EXPECT_NE(error_of<InputError>("text.exr")
                .find("text.exr: not a picture that can be read (EXR, PNG, JPEG, HDR, PFM, BMP, TGA and WebP can)"),
            std::string::npos);
  write_bytes("empty.png", "");
  EXPECT_NE(error_of<InputError>("empty.png"), "");
  EXPECT_NE(error_of<IoError>(""), "");  // the folder itself

  const Image image = test_image(2, 2, {"R", "G", "B"});
  EXPECT_THROW(write_exr(path("no/such/folder/a.exr"), image), IoError);
  EXPECT_THROW(write_image(path("no/such/folder/a.png"), Image8(2, 2, 3)), IoError);
}

TEST_F(IoTest, AFailedWriteLeavesTheOldFile) {
  write_exr(path("a.exr"), test_image(2, 2, {"R", "G", "B"}));
  const std::string before = read_bytes("a.exr");
  Image bad = test_image(2, 2, {"R", "G", "B"});
  bad.metadata["dataWindow.min"] = "not numbers";
  EXPECT_THROW(write_exr(path("a.exr"), bad), InputError);
  bad.metadata = {{"compression", "a text under a name that the format reserves"}};
  EXPECT_THROW(write_exr(path("a.exr"), bad), IoError);
  EXPECT_EQ(read_bytes("a.exr"), before);
  EXPECT_FALSE(fs::exists(path("a.exr.tmp")));
}

// The library's own file would swallow the error when it is closed.
TEST_F(IoTest, ADiskThatFillsLeavesTheOldFile) {
  write_exr(path("a.exr"), test_image(2, 2, {"R", "G", "B"}));
  const std::string before = read_bytes("a.exr");
  signal(SIGXFSZ, SIG_IGN);
  rlimit usual{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &usual), 0);
  for (const rlim_t bytes : {0, 100, 1000, 4000}) {
    rlimit limit = usual;
    limit.rlim_cur = bytes;
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &limit), 0);
    EXPECT_THROW(write_exr(path("a.exr"), test_image(64, 64, {"R", "G", "B"})), IoError) << bytes;
    setrlimit(RLIMIT_FSIZE, &usual);
    EXPECT_EQ(read_bytes("a.exr"), before) << bytes;
  }
  write_exr(path("a.exr"), test_image(64, 64, {"R", "G", "B"}));
  EXPECT_EQ(read_image(path("a.exr")).width, 64);
}

TEST(Image, ChannelsAndLayers) {
  Image image(2, 1, {"R", "G", "B", "normal.X", "normal.Y", "normal.Z", "roughness.Y"});
  for (std::size_t i = 0; i < image.data.size(); ++i) image.data[i] = static_cast<float>(i);
  EXPECT_EQ(image.channel("normal.Y"), 4);
  EXPECT_EQ(image.channel("alpha"), -1);
  EXPECT_EQ(extract_rgb(image).rgb(1, 0), Vec3f(7, 8, 9));
  EXPECT_EQ(extract_rgb(image, "normal").rgb(0, 0), Vec3f(3, 4, 5));
  EXPECT_EQ(extract_rgb(image, "roughness").rgb(1, 0), Vec3f(13, 13, 13));
  try {
    extract_rgb(image, "albedo");
    FAIL();
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("albedo.R"), std::string::npos);
    EXPECT_NE(std::string(e.what()).find("roughness.Y"), std::string::npos);
  }
}

}  // namespace
}  // namespace octrad
