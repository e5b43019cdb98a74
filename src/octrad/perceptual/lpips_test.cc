// LPIPS is compared with numpy and with the authors' package in tests/test_metrics.py; here, networks with a known
// answer.
#include "octrad/perceptual/lpips.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <filesystem>

#include "octrad/base/error.h"
#include "octrad/base/folder_test_helper.h"
#include "octrad/base/rng.h"
#include "octrad/base/threads.h"
#include "octrad/model/safetensors.h"

namespace octrad {
namespace {

// Weights of a network, zero where a test does not set them.
class Weights {
 public:
  explicit Weights(LpipsNet net) : net_(net) {
    if (net == LpipsNet::alex) {
      const int layers[5][4] = {{0, 3, 64, 11}, {3, 64, 192, 5}, {6, 192, 384, 3}, {8, 384, 256, 3}, {10, 256, 256, 3}};
      for (const auto& l : layers) convolution("features." + std::to_string(l[0]), l[1], l[2], l[3]);
      for (const int channels : {64, 192, 384, 256, 256}) linear(channels);
    } else {
      convolution("features.0", 3, 64, 3);
      const int fires[8][4] = {{3, 64, 16, 64},   {4, 128, 16, 64},   {6, 128, 32, 128},  {7, 256, 32, 128},
                               {9, 256, 48, 192}, {10, 384, 48, 192}, {11, 384, 64, 256}, {12, 512, 64, 256}};
      for (const auto& f : fires) {
        const std::string name = "features." + std::to_string(f[0]);
        convolution(name + ".squeeze", f[1], f[2], 1);
        convolution(name + ".expand1x1", f[2], f[3], 1);
        convolution(name + ".expand3x3", f[2], f[3], 3);
      }
      for (const int channels : {64, 128, 256, 384, 384, 512, 512}) linear(channels);
    }
  }

  std::vector<float>& operator[](const std::string& name) {
    return std::find_if(tensors_.begin(), tensors_.end(), [&](const Tensor& t) { return t.name == name; })->values;
  }
  void randomize() {
    Rng rng(1, RngPurpose::test, 0);
    for (Tensor& t : tensors_) {
      const float size =
          t.shape.size() == 1 ? 0.1f : std::sqrt(6.0f / static_cast<float>(t.shape[1] * t.shape[2] * t.shape[3]));
      const bool is_linear = t.name.compare(0, 3, "lin") == 0;
      for (float& v : t.values) v = is_linear ? rng.uniform() : size * (2.0f * rng.uniform() - 1.0f);
    }
  }
  Lpips load() const {
    TensorWriter writer;
    for (const Tensor& t : tensors_) writer.add(t.name, DType::f32, t.shape, t.values.data());
    writer.write(file());
    return Lpips(folder(), net_);
  }
  std::string file() const { return folder_.file(lpips_file_name(net_)); }
  std::string folder() const { return folder_.path().string(); }

 private:
  struct Tensor {
    std::string name;
    std::vector<std::int64_t> shape;
    std::vector<float> values;
  };
  void add(const std::string& name, std::vector<std::int64_t> shape) {
    std::size_t count = 1;
    for (const std::int64_t side : shape) count *= static_cast<std::size_t>(side);
    tensors_.push_back({name, std::move(shape), std::vector<float>(count, 0.0f)});
  }
  void convolution(const std::string& name, int inputs, int outputs, int kernel) {
    add(name + ".weight", {outputs, inputs, kernel, kernel});
    add(name + ".bias", {outputs});
  }
  void linear(int channels) { add("lin" + std::to_string(linears_++) + ".model.1.weight", {1, channels, 1, 1}); }

  LpipsNet net_;
  TestFolder folder_;
  std::deque<Tensor> tensors_;
  int linears_ = 0;
};

Image random_picture(int width, int height, std::uint64_t seed) {
  Image image(width, height, {"R", "G", "B"});
  Rng rng(seed, RngPurpose::test, 1);
  for (float& v : image.data) v = rng.uniform();
  return image;
}

TEST(Lpips, AFirstLayerThatPicksAPixel) {
  // Channel 0 is the red value in the middle of each window, channel 1 is 1: the vector (r, 1) / |(r, 1)|.
  Weights weights(LpipsNet::alex);
  weights["features.0.weight"][5 * 11 + 5] = 1.0f;
  weights["features.0.bias"][1] = 1.0f;
  weights["lin0.model.1.weight"][0] = 1.0f;
  const Lpips lpips = weights.load();
  const Image a = random_picture(50, 43, 1), b = random_picture(50, 43, 2);
  const auto unit = [](const Image& image, int x, int y) {
    const double r = std::max((2.0 * image.at(x, y, 0) - 1.0 + 0.030) / 0.458, 0.0);
    return r / std::sqrt(r * r + 1.0);
  };
  double expected = 0.0;
  const int columns = (50 + 4 - 11) / 4 + 1, rows = (43 + 4 - 11) / 4 + 1;
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) {
      const double d = unit(a, 4 * x + 3, 4 * y + 3) - unit(b, 4 * x + 3, 4 * y + 3);
      expected += d * d / (rows * columns);
    }
  }
  const Lpips::Features fa = lpips.features(a), fb = lpips.features(b);
  EXPECT_NEAR(lpips.distance(fa, fb), expected, 1e-6);
  EXPECT_EQ(lpips.distance(fa, fa), 0.0);
  EXPECT_EQ(fa.taps[0].width, columns);
  EXPECT_EQ(fa.taps[0].height, rows);
}

TEST(Lpips, SizesOfTheStages) {
  for (const LpipsNet net : {LpipsNet::alex, LpipsNet::squeeze}) {
    Weights weights(net);
    weights.randomize();
    const Lpips lpips = weights.load();
    const int least = lpips.smallest_side();
    EXPECT_EQ(least, net == LpipsNet::alex ? 31 : 25);
    for (const int width : {least, 64, 77}) {
      const Image a = random_picture(width, least, 1), b = random_picture(width, least, 2);
      EXPECT_GT(lpips.distance(lpips.features(a), lpips.features(b)), 0.0);
    }
    EXPECT_THROW(lpips.features(random_picture(100, least - 1, 1)), InputError);
  }
}

TEST(Lpips, SameBitsAtAnyNumberOfThreadsAndMasks) {
  Weights weights(LpipsNet::squeeze);
  weights.randomize();
  const Lpips lpips = weights.load();
  const Image a = random_picture(90, 70, 1), b = random_picture(90, 70, 2);
  const double one = lpips.distance(lpips.features(a), lpips.features(b));
  set_thread_count(1);
  EXPECT_EQ(lpips.distance(lpips.features(a), lpips.features(b)), one);
  set_thread_count(0);
  // A map enlarged to the picture has nearly its own mean.
  const std::vector<std::uint8_t> all(a.pixel_count(), 1);
  EXPECT_NEAR(lpips.distance(lpips.features(a), lpips.features(b), all), one, 0.05 * one);
}

TEST(Lpips, MissingAndBrokenFiles) {
  Weights weights(LpipsNet::alex);
  EXPECT_THROW(Lpips(weights.folder(), LpipsNet::alex), IoError);
  weights["features.3.bias"][7] = NAN;
  EXPECT_THROW(weights.load(), InputError);
  weights["features.3.bias"][7] = 0.0f;
  weights.load();
  std::filesystem::resize_file(weights.file(), std::filesystem::file_size(weights.file()) - 1);
  EXPECT_THROW(Lpips(weights.folder(), LpipsNet::alex), InputError);
}

}  // namespace
}  // namespace octrad
