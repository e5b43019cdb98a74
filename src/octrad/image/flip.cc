#include "octrad/image/flip.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "octrad/base/error.h"
#include "octrad/base/threads.h"
#include "octrad/image/flip_simd.h"

namespace octrad {
namespace {

// Contrast sensitivity (section 4.1.1): a1 sqrt(pi / b1) exp(-pi^2 x^2 / b1) + a2 ..., x in degrees.
struct Sensitivity {
  double a, b;
};
constexpr Sensitivity kAchromatic = {1.0, 0.0047}, kRedGreen = {1.0, 0.0053},
                      kBlueYellow[2] = {{34.1, 0.04}, {13.5, 0.025}};
constexpr double kFeatureWidth = 0.082;  // degrees (section 4.2)

// ACES (Narkowicz's fit) of 0.6 x, and the level that the exposures are chosen for (2021, section 3).
constexpr double kAces[5] = {0.6 * 0.6 * 2.51, 0.6 * 0.03, 0.6 * 0.6 * 2.43, 0.6 * 0.59, 0.14};
constexpr double kExposureLevel = 0.85;

// Linear sRGB to XYZ (IEC 61966-2-1), as ratios of whole numbers.
constexpr double kXyz[3][3] = {{10135552.0 / 24577794.0, 8788810.0 / 24577794.0, 4435075.0 / 24577794.0},
                               {2613072.0 / 12288897.0, 8788810.0 / 12288897.0, 887015.0 / 12288897.0},
                               {1425312.0 / 73733382.0, 8788810.0 / 73733382.0, 70074185.0 / 73733382.0}};

// The taps of f(0), f(1) ... f(radius), divided by `sum`.
template <typename F>
FlipFilter taps_of(int radius, double sum, F f) {
  FlipFilter filter;
  for (int x = 0; x <= radius; ++x) filter.taps.push_back(static_cast<float>(f(x) / sum));
  return filter;
}

template <typename F>
double sum_of(int radius, F f) {
  double sum = 0.0;
  for (int x = -radius; x <= radius; ++x) sum += f(x);
  return sum;
}

double lab_curve(double t) {
  constexpr double kDelta = 6.0 / 29.0;
  return t > kDelta * kDelta * kDelta ? std::cbrt(t) : t / (3.0 * kDelta * kDelta) + 4.0 / 29.0;
}

FlipConstants constants_of(double pixels_per_degree) {
  if (!(pixels_per_degree >= 1.0 && pixels_per_degree <= 1000.0))
    throw InputError("FLIP needs 1 to 1000 pixels per degree");
  FlipConstants k;
  // Three standard deviations of the widest Gaussian, which is blue-yellow's.
  const int spatial = static_cast<int>(
      std::ceil(3.0 * std::sqrt(kBlueYellow[0].b / (2.0 * std::numbers::pi * std::numbers::pi)) * pixels_per_degree));
  const double deviation = 0.5 * kFeatureWidth * pixels_per_degree;
  const int feature = static_cast<int>(std::ceil(3.0 * deviation));
  k.radius = std::max(spatial, feature);
  const auto sensitivity = [&](Sensitivity s, FlipFilter& to) {
    const auto g = [&](int x) {
      return std::exp(-std::numbers::pi * std::numbers::pi * x * x / (pixels_per_degree * pixels_per_degree * s.b));
    };
    const double sum = sum_of(spatial, g);
    to = taps_of(spatial, sum, g);
    return s.a * std::sqrt(std::numbers::pi / s.b) * sum * sum;  // of the product along x and y
  };
  sensitivity(kAchromatic, k.achromatic);
  sensitivity(kRedGreen, k.red_green);
  const double first = sensitivity(kBlueYellow[0], k.blue_yellow[0]),
               second = sensitivity(kBlueYellow[1], k.blue_yellow[1]);
  k.share[0] = static_cast<float>(first / (first + second));
  k.share[1] = static_cast<float>(second / (first + second));

  // Positive taps sum to 1, negative ones to -1.
  const auto g = [&](int x) { return std::exp(-x * x / (2.0 * deviation * deviation)); };
  const auto slope = [&](int x) { return x * g(x); };
  const auto curvature = [&](int x) { return (x * x / (deviation * deviation) - 1.0) * g(x); };
  const double above = sum_of(feature, [&](int x) { return std::max(curvature(x), 0.0); });
  const double below = -sum_of(feature, [&](int x) { return std::min(curvature(x), 0.0); });
  k.gaussian = taps_of(feature, sum_of(feature, g), g);
  k.edge = taps_of(feature, sum_of(feature, [&](int x) { return std::max(slope(x), 0.0); }), slope);
  k.point = taps_of(feature, 1.0, [&](int x) { return curvature(x) / (curvature(x) > 0.0 ? above : below); });

  double m[3][3];
  for (int row = 0; row < 3; ++row) {
    const double white = kXyz[row][0] + kXyz[row][1] + kXyz[row][2];
    for (int c = 0; c < 3; ++c) k.to_xyz[row][c] = static_cast<float>(m[row][c] = kXyz[row][c] / white);
  }
  const auto minor = [&](int r, int c) {
    const int r1 = (r + 1) % 3, r2 = (r + 2) % 3, c1 = (c + 1) % 3, c2 = (c + 2) % 3;
    return m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1];
  };
  const double determinant = m[0][0] * minor(0, 0) + m[0][1] * minor(0, 1) + m[0][2] * minor(0, 2);
  for (int row = 0; row < 3; ++row) {
    for (int c = 0; c < 3; ++c) k.to_rgb[row][c] = static_cast<float>(minor(c, row) / determinant);
  }

  double lab[2][3];  // of green and blue
  for (int which = 0; which < 2; ++which) {
    const double x = lab_curve(m[0][1 + which]), y = lab_curve(m[1][1 + which]), z = lab_curve(m[2][1 + which]);
    const double lightness = 116.0 * y - 16.0;
    lab[which][0] = lightness;
    lab[which][1] = 0.01 * lightness * 500.0 * (x - y);
    lab[which][2] = 0.01 * lightness * 200.0 * (y - z);
  }
  k.largest_color = static_cast<float>(
      std::pow(std::abs(lab[0][0] - lab[1][0]) + std::hypot(lab[0][1] - lab[1][1], lab[0][2] - lab[1][2]), 0.7));
  return k;
}

void add_error(const FlipConstants& constants, const Image& reference, const Image& image, std::vector<float>& error) {
  const std::size_t columns = (static_cast<std::size_t>(reference.width) + kFlipTile - 1) / kFlipTile;
  const std::size_t rows = (static_cast<std::size_t>(reference.height) + kFlipTileRows - 1) / kFlipTileRows;
  parallel_for(columns * rows, [&](std::size_t tile) {
    flip_tile(constants, reference, image, static_cast<int>(tile % columns * kFlipTile),
              static_cast<int>(tile / columns * kFlipTileRows), error);
  });
}

}  // namespace

FlipExposures flip_exposures(const Image& reference) {
  // The white of the curve is where it reaches 0.85: a x^2 + b x + c = 0.
  const double a = kAces[0] - kExposureLevel * kAces[2], b = kAces[1] - kExposureLevel * kAces[3],
               c = -kExposureLevel * kAces[4];
  const double half = -0.5 * b / a, white = half + std::sqrt(half * half - c / a);
  std::vector<float> bright;
  bright.reserve(reference.pixel_count());
  for (std::size_t p = 0; p < reference.pixel_count(); ++p) {
    const float* v = &reference.data[3 * p];
    const float y = 0.2126f * v[0] + 0.7152f * v[1] + 0.0722f * v[2];
    bright.push_back(std::max(y, 0.0f));
  }
  std::sort(bright.begin(), bright.end());
  if (bright.empty() || !(bright.back() > 0.0f)) return {};
  const auto median = [](std::span<const float> sorted) {
    const std::size_t n = sorted.size();
    return n < 2 ? static_cast<double>(sorted[0])
                 : 0.5 * (static_cast<double>(sorted[n / 2 - 1]) + static_cast<double>(sorted[n / 2]));
  };
  double middle = median(bright);
  if (!(middle > 0.0)) middle = median(std::span(std::upper_bound(bright.begin(), bright.end(), 0.0f), bright.end()));
  FlipExposures exposures;
  exposures.first = std::log2(white / static_cast<double>(bright.back()));
  exposures.last = std::log2(white / middle);
  exposures.count = std::max(2, static_cast<int>(std::ceil(exposures.last - exposures.first)));
  return exposures;
}

Image flip_ldr(const Image& reference, const Image& image, double pixels_per_degree) {
  Image out(reference.width, reference.height, {"Y"});
  add_error(constants_of(pixels_per_degree), reference, image, out.data);
  return out;
}

Image flip_hdr(const Image& reference, const Image& image, const FlipExposures& exposures, double pixels_per_degree) {
  Image out(reference.width, reference.height, {"Y"});
  FlipConstants constants = constants_of(pixels_per_degree);
  constants.tone_map = true;
  for (int i = 0; i < 5; ++i) constants.curve[i] = static_cast<float>(kAces[i]);
  for (int step = 0; step < exposures.count; ++step) {
    const double stops = exposures.first + (exposures.last - exposures.first) * step / (exposures.count - 1);
    constants.scale = static_cast<float>(std::exp2(stops));
    add_error(constants, reference, image, out.data);
  }
  return out;
}

}  // namespace octrad
