// Pictures against converged ones of an earlier version (tests/images), pixel by pixel: a change of the light transport
// by a percent is seen, wherever it is made. OCTRAD_WRITE_IMAGES=1 writes the stored pictures instead, for when scenes
// or film change on purpose.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "octrad/base/version.h"
#include "octrad/image/io.h"
#include "octrad/render/constant_field_test_helper.h"
#include "octrad/render/renderer.h"
#include "octrad/scene/load.h"

namespace octrad {
namespace {

constexpr int kWidth = 48, kHeight = 32;

// Pictures of several seeds: mean and variance of the mean of each pixel and channel, and how many there were.
struct Pictures {
  Image image{kWidth, kHeight, {"R", "G", "B", "variance.R", "variance.G", "variance.B"}};
  double count = 0.0;
};

Pictures render_pictures(const std::string& scene_name, int max_depth, const std::string& integrator, int seeds,
                         int first_seed, int spp) {
  const PreparedScene scene(load_scene("scenes/" + scene_name + "/scene.xml"));
  testing::ConstantField black(Vec3f(0.0f));
  Pictures out;
  out.count = seeds;
  std::vector<double> sum(kWidth * kHeight * 3), squares(sum.size());
  for (int s = 0; s < seeds; ++s) {
    RenderSettings settings;
    settings.film.filter = Film::Filter::box;  // pixels share no samples
    settings.max_depth = max_depth;
    settings.seed = static_cast<unsigned long long>(first_seed + s);
    const auto renderer = make_renderer(scene, integrator, settings, &black, preset("cpu"));
    renderer->set_view({scene.scene().cameras[0], kWidth, kHeight});
    const Image image = render(*renderer, {spp}).image;
    for (std::size_t i = 0; i < sum.size(); ++i) {
      const auto v = static_cast<double>(image.data[i / 3 * image.channels.size() + i % 3]);
      sum[i] += v;
      squares[i] += v * v;
    }
  }
  for (std::size_t i = 0; i < sum.size(); ++i) {
    const double mean = sum[i] / seeds;
    out.image.data[i / 3 * 6 + i % 3] = static_cast<float>(mean);
    out.image.data[i / 3 * 6 + 3 + i % 3] =
        static_cast<float>(std::fmax(0.0, squares[i] / seeds - mean * mean) / (seeds - 1));
  }
  return out;
}

// Welch's t of two means, as the normal variable of the same probability (Wallace 1959).
double standard_normal(double difference, double variance_a, double count_a, double variance_b, double count_b) {
  const double variance = variance_a + variance_b;
  if (variance <= 0.0) return difference == 0.0 ? 0.0 : std::copysign(1e3, difference);
  const double freedom =
      variance * variance / (variance_a * variance_a / (count_a - 1.0) + variance_b * variance_b / (count_b - 1.0));
  const double t = difference / std::sqrt(variance);
  return std::copysign((8.0 * freedom + 1.0) / (8.0 * freedom + 3.0), t) *
         std::sqrt(freedom * std::log1p(t * t / freedom));
}

struct Case {
  const char* name;  // of the stored picture
  const char* scene;
  int max_depth;
  const char* integrator = "path";
};

class ReferenceImages : public ::testing::TestWithParam<Case> {};

TEST_P(ReferenceImages, AreMatched) {
  constexpr int kStoredSeeds = 64, kStoredSpp = 128, kSeeds = 16, kSpp = 32;
  const Case c = GetParam();
  const std::string file = std::string("tests/images/") + c.name + ".exr";
  if (std::getenv("OCTRAD_WRITE_IMAGES")) {
    if (std::string(c.integrator) != "path") GTEST_SKIP() << "compared with a picture of the path tracer";
    Pictures stored = render_pictures(c.scene, c.max_depth, c.integrator, kStoredSeeds, 1, kStoredSpp);
    stored.image.metadata = {{"octrad.version", kVersion},
                             {"octrad.seeds", "1 to " + std::to_string(kStoredSeeds)},
                             {"octrad.spp", std::to_string(kStoredSpp) + " for each seed"}};
    write_exr(file, stored.image, ExrPrecision::half);
    return;
  }
  if (std::getenv("OCTRAD_SANITIZED")) GTEST_SKIP() << "takes minutes under the sanitizers";
  const Image stored = read_image(file);
  ASSERT_EQ(stored.pixel_count() * stored.channels.size(), std::size_t{kWidth * kHeight * 6});
  const Pictures found = render_pictures(c.scene, c.max_depth, c.integrator, kSeeds, 1001, kSpp);
  Image z(kWidth, kHeight, {"R", "G", "B"});
  double largest = 0.0, beyond3 = 0.0;
  const auto n = static_cast<double>(z.data.size());
  for (int channel = 0; channel < 3; ++channel) {
    double difference = 0.0, variance = 0.0;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        // Means are stored with 11 bits, so they are off by up to 2^-12, evenly distributed.
        const double expected = stored.at(x, y, channel), d = found.image.at(x, y, channel) - expected,
                     rounding = expected / 4096.0 * expected / 4096.0 / 3.0, a = found.image.at(x, y, channel + 3),
                     b = stored.at(x, y, channel + 3) + rounding;
        const double v = standard_normal(d, a, kSeeds, b, kStoredSeeds);
        z.at(x, y, channel) = static_cast<float>(v);
        largest = std::fmax(largest, std::fabs(v));
        beyond3 += std::fabs(v) > 3.0;
        difference += d;
        variance += a + b;
      }
    }
    // The whole picture: pixels are independent. 4 sigma: 1 of 16,000.
    const double whole = difference / std::sqrt(variance);
    RecordProperty("whole_" + z.channels[static_cast<std::size_t>(channel)], std::to_string(whole));
    EXPECT_LT(std::fabs(whole), 4.0) << "channel " << channel << ": the mean is off by " << difference / n * 3.0;
  }
  RecordProperty("largest", std::to_string(largest));
  RecordProperty("beyond3", std::to_string(beyond3 / n));
  // Each pixel: 5.3 sigma is 1 of 1,000 for all 4608 values together. Of all, 0.27 % lie beyond 3.
  EXPECT_LT(largest, 5.3);
  EXPECT_LT(beyond3 / n, 0.01);
  if (HasFailure()) {
    const auto folder = std::filesystem::canonical("/proc/self/exe").parent_path() / "failed-images";
    std::filesystem::create_directories(folder);
    const std::string stem = (folder / c.name).string() + "-" + c.integrator;
    write_exr(stem + ".exr", extract_rgb(found.image));
    write_exr(stem + "-expected.exr", extract_rgb(stored));
    write_exr(stem + "-z.exr", z);
    ADD_FAILURE() << "pictures and their differences in standard deviations: " << stem << "*.exr";
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
