// EXR files as other programs write them: several parts, names of channels; and what is written by choice.
#include <ImfArray.h>
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfMultiPartOutputFile.h>
#include <ImfOutputFile.h>
#include <ImfOutputPart.h>
#include <ImfPartType.h>
#include <ImfRgbaFile.h>
#include <ImfStandardAttributes.h>
#include <gtest/gtest.h>

#include <cmath>

#include "octrad/base/error.h"
#include "octrad/base/folder_test_helper.h"
#include "octrad/base/input_file.h"
#include "octrad/image/io.h"

namespace octrad {
namespace {

// A picture of 3 x 2 pixels whose channel i holds 10 i, 10 i + 1, ...
Image numbered(std::vector<std::string> names, int first = 0) {
  Image image(3, 2, std::move(names));
  const std::size_t n = image.channels.size();
  for (std::size_t i = 0; i < image.pixel_count(); ++i) {
    for (std::size_t c = 0; c < n; ++c)
      image.data[i * n + c] = static_cast<float>(10 * (static_cast<std::size_t>(first) + c) + i);
  }
  return image;
}

void add_channels(const Image& image, Imf::Header& header, Imf::FrameBuffer& buffer) {
  const std::size_t stride = image.channels.size() * sizeof(float);
  for (std::size_t c = 0; c < image.channels.size(); ++c) {
    header.channels().insert(image.channels[c], Imf::Channel(Imf::FLOAT));
    buffer.insert(image.channels[c], Imf::Slice::Make(Imf::FLOAT, image.data.data() + c, header.dataWindow(), stride,
                                                      stride * static_cast<std::size_t>(image.width)));
  }
}

class ExrTest : public ::testing::Test {
 protected:
  struct Part {
    std::string name;
    Image image;
  };
  Image read_parts(const std::vector<Part>& parts) {
    std::vector<Imf::Header> headers;
    std::vector<Imf::FrameBuffer> buffers(parts.size());
    for (std::size_t i = 0; i < parts.size(); ++i) {
      const Imath::Box2i display({0, 0}, {parts[0].image.width - 1, parts[0].image.height - 1});
      headers.emplace_back(display, Imath::Box2i({0, 0}, {parts[i].image.width - 1, parts[i].image.height - 1}));
      headers.back().setName(parts[i].name);
      headers.back().setType(Imf::SCANLINEIMAGE);
      add_channels(parts[i].image, headers.back(), buffers[i]);
    }
    const std::string file = folder_.file("parts.exr");
    {
      Imf::MultiPartOutputFile out(file.c_str(), headers.data(), static_cast<int>(headers.size()));
      for (std::size_t i = 0; i < parts.size(); ++i) {
        Imf::OutputPart part(out, static_cast<int>(i));
        part.setFrameBuffer(buffers[i]);
        part.writePixels(parts[i].image.height);
      }
    }
    return read_image(file);
  }
  // Channels as read of a file that has these, and that the first three are the file's numbers 0, 1, 2 of `colors`.
  std::vector<std::string> read_names(const std::vector<std::string>& names, const std::vector<int>& colors = {}) {
    const std::string file = folder_.file("names.exr");
    const Image written = numbered(names);
    write_exr(file, written);
    const Image image = read_image(file);
    for (std::size_t c = 0; c < colors.size(); ++c) EXPECT_EQ(image.data[c], 10.0f * static_cast<float>(colors[c]));
    return image.channels;
  }
  TestFolder folder_;
};

using Names = std::vector<std::string>;

TEST_F(ExrTest, PartsOfOneSizeAreLayers) {
  const Image image = read_parts({{"rgba", numbered({"R", "G", "B", "A"})},
                                  {"depth", numbered({"Z"}, 4)},
                                  {"small", Image(2, 2, {"R"})},
                                  {"lights", numbered({"key.R", "key.G", "key.B"}, 5)}});
  EXPECT_EQ(image.channels, (Names{"R", "G", "B", "A", "depth.Z", "key.R", "key.G", "key.B"}));
  for (int c = 0; c < 8; ++c) EXPECT_EQ(image.at(2, 1, c), static_cast<float>(10 * c + 5));
  EXPECT_EQ(image.metadata.count("name"), 0u);
}

TEST_F(ExrTest, NamesOfOtherPrograms) {
  // Blender's layers, Mitsuba's with and without the name of an integrator, pbrt's.
  EXPECT_EQ(read_names({"ViewLayer.Combined.R", "ViewLayer.Combined.G", "ViewLayer.Combined.B", "ViewLayer.Combined.A",
                        "ViewLayer.DiffCol.R", "ViewLayer.DiffCol.G", "ViewLayer.DiffCol.B", "ViewLayer.Depth.Z"},
                       {0, 1, 2}),
            (Names{"R", "G", "B", "A", "ViewLayer.Depth.Z", "ViewLayer.DiffCol.R", "ViewLayer.DiffCol.G",
                   "ViewLayer.DiffCol.B"}));
  EXPECT_EQ(read_names({"R", "G", "B", "image.R", "image.G", "image.B"}, {0, 1, 2}),
            (Names{"R", "G", "B", "image.R", "image.G", "image.B"}));
  EXPECT_EQ(read_names({"my_image.R", "my_image.G", "my_image.B", "dd.y"}, {0, 1, 2}), (Names{"R", "G", "B", "dd.y"}));
  EXPECT_EQ(read_names({"R", "G", "B", "Albedo.R", "Albedo.G", "Albedo.B", "Ns.X", "Ns.Y", "Ns.Z"}, {0, 1, 2}).size(),
            9u);
  EXPECT_EQ(read_names({"r", "g", "b"}, {0, 1, 2}), (Names{"R", "G", "B"}));
  EXPECT_EQ(
      read_names({"beauty.red", "beauty.green", "beauty.blue", "albedo.red", "albedo.green", "albedo.blue"}, {0, 1, 2})
          .front(),
      "R");
  EXPECT_EQ(read_names({"Y"}, {0}), Names{"Y"});
  EXPECT_EQ(read_names({"V"}, {0}), Names{"Y"});
  // Which of two is the picture, nobody can know.
  EXPECT_EQ(read_names({"a.R", "a.G", "a.B", "b.R", "b.G", "b.B"}).front(), "a.R");
}

TEST_F(ExrTest, OwnLayersKeepTheirNames) {
  Image image = numbered({"albedo.R", "albedo.G", "albedo.B"});
  image.metadata["octrad.version"] = "0";
  write_exr(folder_.file("a.exr"), image);
  EXPECT_EQ(read_image(folder_.file("a.exr")).channels, image.channels);
}

TEST_F(ExrTest, OtherPrimariesBecomeRec709) {
  const std::string file = folder_.file("primaries.exr");
  const auto read = [&](const Names& channels, const std::vector<float>& color, const Imf::Chromaticities* primaries) {
    Image image(1, 1, channels);
    image.data = color;
    Imf::Header header(1, 1);
    if (primaries != nullptr) Imf::addChromaticities(header, *primaries);
    Imf::FrameBuffer buffer;
    add_channels(image, header, buffer);
    {
      Imf::OutputFile out(file.c_str(), header);
      out.setFrameBuffer(buffer);
      out.writePixels(1);
    }
    return read_image(file);
  };
  // ITU-R BT.2087, its matrix from Rec. 2020 inverted; alpha and other channels stay.
  const Imf::Chromaticities rec2020({0.708f, 0.292f}, {0.17f, 0.797f}, {0.131f, 0.046f}, {0.3127f, 0.329f});
  const Image wide = read({"R", "G", "B", "A"}, {1.0f, 0.5f, 0.25f, 0.5f}, &rec2020);
  EXPECT_EQ(wide.channels, (Names{"R", "G", "B", "A"}));
  const float expected[4] = {1.3485f, 0.4398f, 0.2112f, 0.5f};
  for (int c = 0; c < 4; ++c) EXPECT_NEAR(wide.at(0, 0, c), expected[c], 2e-3f) << c;
  // X, Y and Z of the white of Rec. 709 (D65).
  const Image xyz = read({"X", "Y", "Z"}, {0.9505f, 1.0f, 1.0891f}, nullptr);
  EXPECT_EQ(xyz.channels, (Names{"R", "G", "B"}));
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(xyz.at(0, 0, c), 1.0f, 2e-3f) << c;
  // Nothing to do: the same bits. Primaries on one line span no colours.
  const std::vector<float> color{0.1f, 0.2f, 0.3f};
  const Imf::Chromaticities rec709, line({0.1f, 0.1f}, {0.2f, 0.2f}, {0.3f, 0.3f}, {0.3f, 0.3f});
  EXPECT_EQ(read({"R", "G", "B"}, color, &rec709).data, color);
  EXPECT_EQ(read({"R", "G", "B"}, color, &line).data, color);
}

TEST_F(ExrTest, LuminanceAndChromaAreRefusedByName) {
  const std::string file = folder_.file("yc.exr");
  {
    Imf::RgbaOutputFile out(file.c_str(), 4, 4, Imf::WRITE_YC);
    const Imf::Array2D<Imf::Rgba> pixels(4, 4);
    out.setFrameBuffer(&pixels[0][0], 1, 4);
    out.writePixels(4);
  }
  try {
    read_image(file);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("luminance/chroma file (Y, RY, BY)"), std::string::npos) << e.what();
  }
}

TEST_F(ExrTest, WrittenByChoice) {
  Image image(64, 64, {"R", "G", "B"});
  for (std::size_t i = 0; i < image.data.size(); ++i)
    image.data[i] = 0.5f + 0.25f * std::sin(0.01f * static_cast<float>(i));
  const std::string file = folder_.file("a.exr");
  std::size_t uncompressed = 0;
  ASSERT_EQ(exr_compressions().size(), 10u);
  for (const std::string& compression : exr_compressions()) {
    for (const ExrPrecision precision : {ExrPrecision::float32, ExrPrecision::half}) {
      write_exr(file, image, {precision, compression});
      const std::size_t size = read_file(file).size();
      if (compression == "none" && precision == ExrPrecision::float32) uncompressed = size;
      EXPECT_LE(size, uncompressed) << compression;
      const Image back = read_image(file);
      const bool lossy = compression == "pxr24" || compression.starts_with("b44") || compression.starts_with("dwa");
      for (std::size_t i = 0; i < image.data.size(); ++i) {
        const float exact = precision == ExrPrecision::half ? 4e-4f : 0.0f;
        ASSERT_NEAR(back.data[i], image.data[i], lossy ? 0.03f : exact) << compression;
      }
    }
  }
}

}  // namespace
}  // namespace octrad
