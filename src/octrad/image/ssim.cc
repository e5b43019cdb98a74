#include "octrad/image/ssim.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "octrad/base/threads.h"

namespace octrad {
namespace {

constexpr int kRadius = kSsimWindow / 2;
constexpr double kSigma = 1.5, kC1 = 0.01 * 0.01, kC2 = 0.03 * 0.03;
constexpr int kMoments = 5;  // windowed means of R, I, R^2, I^2 and R I
constexpr int kRows = 32;    // rows of the result that are made together

std::array<double, kSsimWindow> window() {
  std::array<double, kSsimWindow> w{};
  double sum = 0.0;
  for (int k = 0; k < kSsimWindow; ++k) {
    const double x = k - kRadius;
    sum += w[static_cast<std::size_t>(k)] = std::exp(-x * x / (2.0 * kSigma * kSigma));
  }
  for (double& v : w) v /= sum;
  return w;
}

double similarity(const double* m) {
  const double mean_r = m[0], mean_i = m[1];
  const double var_r = m[2] - mean_r * mean_r, var_i = m[3] - mean_i * mean_i, covariance = m[4] - mean_r * mean_i;
  return (2.0 * mean_r * mean_i + kC1) * (2.0 * covariance + kC2) /
         ((mean_r * mean_r + mean_i * mean_i + kC1) * (var_r + var_i + kC2));
}

// Rows [begin, end) of the result: rows are filtered along x, kept, and filtered along y.
void rows_of(const Image& reference, const Image& image, int begin, int end, Image& out) {
  static const std::array<double, kSsimWindow> w = window();
  const std::size_t inner = static_cast<std::size_t>(reference.width - 2 * kRadius);
  const std::size_t kept = static_cast<std::size_t>(end - begin + 2 * kRadius);
  const std::size_t width = static_cast<std::size_t>(reference.width);
  std::vector<double> values(kMoments * width), rows(kept * kMoments * inner), sums(kMoments * inner);
  for (std::size_t channel = 0; channel < 3; ++channel) {
    for (std::size_t row = 0; row < kept; ++row) {
      const std::size_t y = static_cast<std::size_t>(begin - kRadius) + row;
      for (std::size_t x = 0; x < width; ++x) {
        const double r = static_cast<double>(reference.data[3 * (y * width + x) + channel]);
        const double i = static_cast<double>(image.data[3 * (y * width + x) + channel]);
        const double moments[kMoments] = {r, i, r * r, i * i, r * i};
        for (std::size_t m = 0; m < kMoments; ++m) values[m * width + x] = moments[m];
      }
      for (std::size_t m = 0; m < kMoments; ++m) {
        double* to = &rows[(row * kMoments + m) * inner];
        std::fill_n(to, inner, 0.0);
        for (std::size_t k = 0; k < kSsimWindow; ++k) {
          const double* from = &values[m * width + k];
          for (std::size_t x = 0; x < inner; ++x) to[x] += w[k] * from[x];
        }
      }
    }
    for (int y = begin; y < end; ++y) {
      std::fill(sums.begin(), sums.end(), 0.0);
      for (std::size_t k = 0; k < kSsimWindow; ++k) {
        const double* from = &rows[(static_cast<std::size_t>(y - begin) + k) * kMoments * inner];
        for (std::size_t x = 0; x < kMoments * inner; ++x) sums[x] += w[k] * from[x];
      }
      for (std::size_t x = 0; x < inner; ++x) {
        double m[kMoments];
        for (std::size_t k = 0; k < kMoments; ++k) m[k] = sums[k * inner + x];
        float& at = out.at(static_cast<int>(x) + kRadius, y, 0);
        at = (channel == 0 ? 0.0f : at) + static_cast<float>(similarity(m) / 3.0);
      }
    }
  }
}

}  // namespace

Image ssim_image(const Image& reference, const Image& image) {
  Image out(reference.width, reference.height, {"Y"});
  std::fill(out.data.begin(), out.data.end(), std::numeric_limits<float>::quiet_NaN());
  const int inner = reference.height - 2 * kRadius;
  if (reference.width < kSsimWindow || inner < 1) return out;
  parallel_blocks(static_cast<std::size_t>(inner), kRows, [&](std::size_t begin, std::size_t end) {
    rows_of(reference, image, kRadius + static_cast<int>(begin), kRadius + static_cast<int>(end), out);
  });
  return out;
}

}  // namespace octrad
