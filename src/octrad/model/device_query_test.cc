// What `octrad query` prints, from a stream and from the CPU.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "octrad/base/error.h"
#include "octrad/device/stream_test_helper.h"
#include "octrad/model/device_query.h"
#include "octrad/model/field_test_helper.h"

namespace octrad {
namespace {

using testing::pattern, testing::random_points, testing::shell;

class DeviceQuery : public testing::StreamTest {};

Config small(const std::string& field) {
  Config config = preset("cpu");
  config.field = field;
  config.octree_levels = 2;
  config.octree_fine = 1;
  config.disparity_log2_table = 10;
  config.nr_log2_table = config.ncr_log2_table = config.ncr_cone_log2_table = 12;
  config.adam_warmup = 1;
  return config;
}

std::unique_ptr<RadianceField> trained(const Config& config) {
  auto field = make_field(config, config.field == "octaoctree" ? shell(3) : shell(0));
  field->set_target_scale(1.0f);
  for (int step = 0; step < 20; ++step) {
    const auto points = random_points(256, 100 + static_cast<unsigned long long>(step));
    std::vector<Vec3f> targets;
    for (const SurfacePoint& p : points) targets.push_back(pattern(p));
    field->train(points, targets, 0.05, 1.0);
  }
  return field;
}

TEST_P(DeviceQuery, SaysWhatTheCpuSays) {
  for (const char* name : {"octaoctree", "nr", "ncr"}) {
    const Config config = small(name);
    const auto field = trained(config);
    const auto width = static_cast<std::size_t>(field->feature_count());
    const auto points = random_points(700, 5);
    std::vector<float> features(points.size() * width), disparity(points.size());
    std::vector<Vec3f> radiance(points.size());
    field->inspect(points, features, disparity);
    field->radiance(points, radiance);
    const FieldAnswers got = ask_on_stream(*stream, *field, config, points, 0);
    ASSERT_EQ(got.features.size(), features.size());
    ASSERT_EQ(got.disparity.size(), disparity.size());
    ASSERT_EQ(got.radiance.size(), radiance.size());
    double brightness = 0.0;
    std::size_t off = 0;  // at a fold of the map or in another cell, after rounding of the disparity
    for (std::size_t i = 0; i < points.size(); ++i) {
      EXPECT_NEAR(got.disparity[i], disparity[i], 1e-2f * (1.0f + std::abs(disparity[i]))) << name << " " << i;
      bool far = false;
      for (std::size_t f = 0; f < width; ++f)
        far = far || std::abs(got.features[i * width + f] - features[i * width + f]) > 2e-3f;
      for (int c = 0; c < 3; ++c)
        far = far || std::abs(got.radiance[i][c] - radiance[i][c]) > 1e-2f * (0.1f + radiance[i][c]);
      off += far;
      brightness += static_cast<double>(luminance(radiance[i]));
    }
    EXPECT_LT(off, 15u) << name;
    EXPECT_GT(brightness / static_cast<double>(points.size()), 0.1) << name;
    EXPECT_EQ(std::any_of(disparity.begin(), disparity.end(), [](float d) { return d != 0.0f; }),
              config.field == "octaoctree");
  }
}

TEST_P(DeviceQuery, LittleMemoryMeansTurnsAndThenAnError) {
  const Config config = small("nr");
  const auto field = trained(config);
  const auto points = random_points(5000, 6);
  const FieldAnswers whole = ask_on_stream(*stream, *field, config, points, 0);
  const std::size_t most = stream->peak_bytes();
  const auto another = GetParam() ? make_cuda_stream(0) : make_host_stream();
  const FieldAnswers turns = ask_on_stream(*another, *field, config, points, most - most / 8);
  EXPECT_LT(another->peak_bytes(), most - most / 8);
  EXPECT_EQ(turns.features, whole.features);
  EXPECT_EQ(turns.radiance, whole.radiance);
  EXPECT_THROW(ask_on_stream(*another, *field, config, points, 1000), MemoryError);
  EXPECT_TRUE(ask_on_stream(*another, *field, config, {}, 1000).radiance.empty());
}

INSTANTIATE_TEST_SUITE_P(All, DeviceQuery, ::testing::Bool(), testing::stream_name);

}  // namespace
}  // namespace octrad
