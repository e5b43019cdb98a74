// Files of measured materials. The model itself is tested in shading/bsdf_test.cc and
// shading/mitsuba_scattering_test.cc, broken files in tests/cli/broken_inputs.py.
#include "octrad/scene/measured.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "octrad/base/folder_test_helper.h"
#include "octrad/scene/load.h"
#include "octrad/scene/sample_measured.h"
#include "octrad/scene/spectrum.h"

namespace octrad {
namespace {

// The values of each node's density add up to 1, and the last integrals are those of the rows.
void expect_density(const MeasuredMaterial& m, const MeasuredDensity& d) {
  const auto nodes = static_cast<std::size_t>(m.layout.phi_count * m.layout.theta_count);
  const auto width = static_cast<std::size_t>(d.width), height = static_cast<std::size_t>(d.height);
  for (std::size_t node = 0; node < nodes; ++node) {
    const float* const values = m.data.data() + d.values + node * width * height;
    double sum = 0.0;
    for (std::size_t y = 0; y + 1 < height; ++y) {
      for (std::size_t x = 0; x + 1 < width; ++x) {
        const float* const v = values + y * width + x;
        sum += 0.25 * static_cast<double>(v[0] + v[1] + v[width] + v[width + 1]);
      }
      EXPECT_NEAR(m.data[d.rows + node * height + y + 1], sum, 1e-5);
    }
    EXPECT_NEAR(sum, 1.0, 1e-5);
  }
}

TEST(Measured, Tables) {
  for (const int part : {0, 1, 2, 4, 8}) {
    const MeasuredMaterial m = parse_measured("m", testing::measured_sample_file(part));
    const bool isotropic = part == 0 || part == 8;
    EXPECT_EQ(m.layout.isotropic, isotropic);
    EXPECT_EQ(m.layout.symmetry, isotropic ? 1 : part);
    EXPECT_EQ(m.layout.is_density, part != 8);
    EXPECT_EQ(m.layout.phi_count, part == 0 ? 1 : part == 8 ? 2 : 5);
    EXPECT_EQ(m.layout.theta_count, 5);
    EXPECT_EQ(m.data[m.layout.theta + 2], 0.7f);
    EXPECT_EQ(m.layout.normals.width, 16);
    EXPECT_EQ(m.layout.normals.height, 9);
    EXPECT_NEAR(m.data[m.layout.normals.values], 1.0 / (3.14159265 * (isotropic ? 0.25 : 0.15)), 1e-5);
    expect_density(m, m.layout.visible_normals);
    expect_density(m, m.layout.luminance);
    // The last table, and its last value.
    const auto nodes = static_cast<std::size_t>(m.layout.phi_count * m.layout.theta_count);
    EXPECT_EQ(m.layout.rgb + nodes * 3 * 64, m.data.size());
    EXPECT_NEAR(m.data.back(), (part == 8 ? 0.1 : 1.0) * 0.4 * 1.2 * 2.15 / 1.775, 1e-6);
  }
}

// Noise may leave values below 0, and a direction in which nothing was measured.
TEST(Measured, NegativeAndDark) {
  std::string bytes = testing::measured_sample_file(0);
  const std::string before = bytes;
  const MeasuredMaterial whole = parse_measured("m", bytes);
  // The last tensors of the file: luminance and rgb, of 5 nodes.
  const std::size_t rgb = bytes.size() - 5 * 3 * 64 * sizeof(float), luminance = rgb - 5 * 64 * sizeof(float);
  const float minus = -0.25f;
  std::memcpy(bytes.data() + rgb, &minus, sizeof minus);
  std::memset(bytes.data() + luminance, 0, 64 * sizeof(float));
  const MeasuredMaterial m = parse_measured("m", bytes);
  EXPECT_EQ(m.data[m.layout.rgb], 0.0f);
  EXPECT_EQ(m.data[m.layout.rgb + 1], whole.data[whole.layout.rgb + 1]);
  expect_density(m, m.layout.luminance);
  EXPECT_EQ(m.data[m.layout.luminance.values], m.data[m.layout.luminance.values + 63]);
}

TEST(Measured, Spectra) {
  const MeasuredMaterial m = parse_measured("m", testing::measured_sample_file(0, true)),
                         colors = parse_measured("m", testing::measured_sample_file(0));
  ASSERT_EQ(m.data.size(), colors.data.size());
  EXPECT_EQ(m.layout.rgb, colors.layout.rgb);
  const Vec3f expected = spectrum_rgb({{400, 500, 600, 700}, {0.2, 0.4, 0.8, 0.6}}, SpectrumUse::index);
  // The first and the last texel of the first node, and the last of the last: its luminance before it was normalised.
  for (const auto& [texel, bright] : {std::pair(0u, 1.0f), {63u, 1.75f}, {4 * 3 * 64 + 63u, 2.15f}}) {
    for (unsigned c = 0; c < 3; ++c)
      EXPECT_NEAR(m.data[m.layout.rgb + texel + 64 * c], expected[static_cast<int>(c)] * bright, 1e-5f) << texel << c;
  }
}

TEST(Measured, InScenes) {
  const TestFolder folder;
  for (const int part : {0, 1}) folder.write("m" + std::to_string(part) + ".bsdf", testing::measured_sample_file(part));
  const auto scene = [&](const std::string& first, const std::string& second) {
    const auto shape = [](const std::string& file) {
      return "<shape type=\"sphere\"><bsdf type=\"measured\"><string name=\"filename\" value=\"" + file +
             "\"/></bsdf></shape>";
    };
    return load_scene(folder.write("s.xml", "<scene version=\"3.0.0\"><sensor type=\"perspective\"/>" + shape(first) +
                                                shape(second) + "</scene>"));
  };
  const Scene same = scene("m0.bsdf", "m0.bsdf"), two = scene("m0.bsdf", "m1.bsdf");
  EXPECT_EQ(same.measured.size(), 1u);  // read once
  EXPECT_EQ(two.measured.size(), 2u);
  EXPECT_EQ(two.other_files.size(), 2u);
  EXPECT_NE(same.fingerprint, two.fingerprint);
  EXPECT_EQ(two.materials.at(static_cast<std::size_t>(two.shapes.at(1).material)).measured, 1);
}

}  // namespace
}  // namespace octrad
