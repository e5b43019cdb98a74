// Pictures against converged ones of an earlier version (tests/images), pixel by pixel: a change of the light transport
// by a percent is seen, wherever it is made. OCTRAD_WRITE_IMAGES=1 writes the stored pictures instead, for when scenes
// or film change on purpose.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "octrad/base/sanitized_test_helper.h"
#include "octrad/base/version.h"
#include "octrad/image/io.h"
#include "octrad/render/constant_field_test_helper.h"
#include "octrad/render/renderer.h"
#include "octrad/scene/load.h"

namespace octrad {
namespace {

constexpr int kWidth = 48, kHeight = 32;

// Pictures of several seeds, their mean and its standard error.
struct Sampling {
  int first_seed, seeds, spp;
  double samples() const { return double(seeds) * spp; }
};
constexpr Sampling kStored{1, 64, 128}, kFound{1001, 16, 32};

// Cache integrators get a cache that is black everywhere.
Image mean_picture(const PreparedScene& scene, const std::string& integrator, int max_depth, const Sampling& sampling) {
  testing::ConstantField black(Vec3f(0.0f));
  std::vector<double> sum(kWidth * kHeight * 3), squares(sum.size());
  for (int s = 0; s < sampling.seeds; ++s) {
    RenderSettings settings;
    settings.film.filter = Film::Filter::box;  // pixels share no samples
    settings.max_depth = max_depth;
    settings.seed = static_cast<unsigned long long>(sampling.first_seed + s);
    const auto renderer = make_renderer(scene, integrator, settings, &black, preset("cpu"));
    renderer->set_view({scene.scene().cameras[0], kWidth, kHeight});
    const Image image = extract_rgb(render(*renderer, {sampling.spp}).image);
    for (std::size_t i = 0; i < sum.size(); ++i) {
      const auto v = static_cast<double>(image.data[i]);
      sum[i] += v;
      squares[i] += v * v;
    }
  }
  Image out(kWidth, kHeight, {"R", "G", "B", "error.R", "error.G", "error.B"});
  for (std::size_t i = 0; i < sum.size(); ++i) {
    const double mean = sum[i] / sampling.seeds, variance = std::fmax(0.0, squares[i] / sampling.seeds - mean * mean);
    out.data[i / 3 * 6 + i % 3] = static_cast<float>(mean);
    out.data[i / 3 * 6 + 3 + i % 3] = static_cast<float>(std::sqrt(variance / (sampling.seeds - 1)));
  }
  out.metadata = {{"octrad.version", kVersion},
                  {"octrad.first_seed", std::to_string(sampling.first_seed)},
                  {"octrad.seeds", std::to_string(sampling.seeds)},
                  {"octrad.spp", std::to_string(sampling.spp)}};
  return out;
}

// The difference of the sums over a block of pixels, in standard deviations: Welch's t, as the normal variable of the
// same probability (Wallace 1959). A pixel of `found` has at least the variance that the stored error gives for as few
// samples: where light comes rarely none may have come, and then nothing varies.
double standard_difference(const Image& found, const Image& stored, int x0, int y0, int width, int height,
                           int channel) {
  const auto square = [](double v) { return v * v; };
  double difference = 0.0, variance = 0.0, uncertainty = 0.0;
  for (int y = y0; y < y0 + height; ++y) {
    for (int x = x0; x < x0 + width; ++x) {
      const double expected = stored.at(x, y, channel), a = square(stored.at(x, y, channel + 3)),
                   least = a * kStored.samples() / kFound.samples(), seen = square(found.at(x, y, channel + 3)),
                   b = std::fmax(seen, least);
      difference += found.at(x, y, channel) - expected;
      // Half floats have 11 bits: stored means are off by up to 2^-12, evenly distributed.
      variance += a + b + square(expected / 4096.0) / 3.0;
      uncertainty += seen > least ? square(a) / (kStored.seeds - 1) + square(b) / (kFound.seeds - 1)
                                  : square(a + b) / (kStored.seeds - 1);
    }
  }
  if (difference == 0.0) return 0.0;
  const double t = difference / std::sqrt(variance), freedom = std::fmin(1e6, square(variance) / uncertainty);
  return std::copysign((8.0 * freedom + 1.0) / (8.0 * freedom + 3.0), t) *
         std::sqrt(freedom * std::log1p(t * t / freedom));
}

// Blocks of pixels of one size: the largest difference among them, and what is tolerated. Both pictures of an unchanged
// renderer are random: 4.5 standard deviations in one of 72 blocks have a probability of 5e-4, and 4.2 of the whole
// picture of 1e-4. Pixels have heavier tails than the normal distribution. Found: 3.3, 3.1 and 1.8.
struct Blocks {
  const char* name;
  int width, height;
  double limit, largest = 0.0;
  std::string place = {};
};

struct Comparison {
  Blocks blocks[3] = {{"pixel", 1, 1, 5.0}, {"block", 8, 8, 4.5}, {"picture", kWidth, kHeight, 4.2}};
  Image z{kWidth, kHeight, {"R", "G", "B"}};  // of the pixels
  double beyond3 = 0.0;                       // share of them; 0.27 % of a normal distribution

  Comparison(const Image& found, const Image& stored) {
    for (Blocks& b : blocks) {
      for (int y = 0; y < kHeight; y += b.height) {
        for (int x = 0; x < kWidth; x += b.width) {
          for (int channel = 0; channel < 3; ++channel) {
            const double v = standard_difference(found, stored, x, y, b.width, b.height, channel);
            if (b.width == 1) z.at(x, y, channel) = static_cast<float>(v);
            if (b.width == 1 && std::fabs(v) > 3.0) beyond3 += 1.0 / static_cast<double>(z.data.size());
            if (std::fabs(v) <= b.largest) continue;
            b.largest = std::fabs(v);
            b.place = std::to_string(x) + "," + std::to_string(y) + " " + z.channels[static_cast<std::size_t>(channel)];
          }
        }
      }
    }
  }
};

Image stored_picture(const std::string& name) { return read_image("tests/images/" + name + ".exr"); }

struct Case {
  const char* name;  // of the stored picture
  const char* scene;
  int max_depth;
  const char* integrator = "path";
};

class ReferenceImages : public ::testing::TestWithParam<Case> {};

TEST_P(ReferenceImages, AreMatched) {
  if (testing::sanitized()) GTEST_SKIP() << "takes minutes under the sanitizers";
  const Case c = GetParam();
  const PreparedScene scene(load_scene("scenes/" + std::string(c.scene) + "/scene.xml"));
  if (std::getenv("OCTRAD_WRITE_IMAGES")) {
    if (std::string(c.integrator) != "path") GTEST_SKIP() << "compared with a picture of the path tracer";
    write_exr("tests/images/" + std::string(c.name) + ".exr", mean_picture(scene, "path", c.max_depth, kStored),
              {ExrPrecision::half});
    return;
  }
  const Image stored = stored_picture(c.name), found = mean_picture(scene, c.integrator, c.max_depth, kFound);
  ASSERT_EQ(stored.data.size(), found.data.size());
  const Comparison comparison(found, stored);
  for (const Blocks& b : comparison.blocks) {
    RecordProperty(b.name, std::to_string(b.largest));
    EXPECT_LT(b.largest, b.limit) << "standard deviations, " << b.name << " at " << b.place;
  }
  EXPECT_LT(comparison.beyond3, 0.005);
  if (!HasFailure()) return;
  const auto folder = std::filesystem::canonical("/proc/self/exe").parent_path() / "failed-images";
  std::filesystem::create_directories(folder);
  const std::string stem = (folder / c.name).string() + "-" + c.integrator;
  write_exr(stem + ".exr", extract_rgb(found));
  write_exr(stem + "-expected.exr", extract_rgb(stored));
  write_exr(stem + "-z.exr", comparison.z);
  ADD_FAILURE() << "pictures and their differences in standard deviations: " << stem << "*.exr";
}

// The walls (22 standard deviations in a block and in the picture) or a block of steel (13 in a block of pixels, 0.8 in
// the picture) that scatter 5 % too much.
TEST(ReferenceImage, MaterialFivePercentTooBrightIsSeen) {
  if (testing::sanitized()) GTEST_SKIP() << "takes minutes under the sanitizers";
  const Image stored = stored_picture("cornell-box-direct");
  for (const char* name : {"white", "steel"}) {
    Scene scene = load_scene("scenes/cornell-box/scene.xml");
    int changed = 0;
    for (Material& m : scene.materials) {
      if (m.id != name) continue;
      for (int* texture : {&m.reflectance, &m.specular_reflectance}) {
        Texture brighter;
        if (*texture >= 0) brighter = scene.textures[static_cast<std::size_t>(*texture)];
        else brighter.color0 = Vec3f(1.0f);
        brighter.color0 = brighter.color0 * 1.05f;
        *texture = static_cast<int>(scene.textures.size());
        scene.textures.push_back(brighter);
      }
      ++changed;
    }
    ASSERT_EQ(changed, 1) << name;
    const Comparison comparison(mean_picture(PreparedScene(std::move(scene)), "path", 2, kFound), stored);
    double most = 0.0;
    for (const Blocks& b : comparison.blocks) {
      RecordProperty(std::string(name) + "_" + b.name, std::to_string(b.largest));
      most = std::fmax(most, b.largest / b.limit);
    }
    EXPECT_GT(most, 1.0) << name;
  }
}

// The right-hand side over a cache that is black is light after one bounce. (The box has no mirrors, which "rhs"
// follows.)
INSTANTIATE_TEST_SUITE_P(All, ReferenceImages,
                         ::testing::Values(Case{"cornell-box-direct", "cornell-box", 2},
                                           Case{"cornell-box-direct", "cornell-box", 2, "rhs"},
                                           Case{"cornell-box", "cornell-box", -1},
                                           Case{"glossy-room-direct", "glossy-room", 2},
                                           Case{"glossy-room", "glossy-room", -1}, Case{"furnace", "furnace", -1}),
                         [](const auto& test) {
                           std::string name = std::string(test.param.name) + "_" + test.param.integrator;
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

}  // namespace
}  // namespace octrad
