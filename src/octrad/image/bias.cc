#include "octrad/image/bias.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "octrad/base/error.h"
#include "octrad/image/metrics.h"

namespace octrad {
namespace {

constexpr double kLargestScore = 1000.0;

// Calls body(x, y, pixel, a, b, i) for the pixels of the mask where both references are finite.
template <typename Body>
void each_pixel(const Image& a_file, const Image& b_file, const Image& image_file, std::span<const std::uint8_t> mask,
                Body body) {
  check_comparable(a_file, b_file, mask);
  check_comparable(a_file, image_file, mask);
  const Image a = extract_rgb(a_file), b = extract_rgb(b_file), image = extract_rgb(image_file);
  std::size_t p = 0;
  for (int y = 0; y < a.height; ++y) {
    for (int x = 0; x < a.width; ++x, ++p) {
      const Vec3f va = a.rgb(x, y), vb = b.rgb(x, y), i = image.rgb(x, y);
      if ((!mask.empty() && mask[p] == 0) || !is_finite(va) || !is_finite(vb)) continue;
      body(x, y, p, va, vb, is_finite(i) ? i : Vec3f(0.0f));
    }
  }
}

}  // namespace

double noise_free_error(const Image& a, const Image& b, double share, const Image& image,
                        std::span<const std::uint8_t> mask) {
  double sum = 0.0;
  long long pixels = 0;
  each_pixel(a, b, image, mask, [&](int, int, std::size_t, Vec3f ra, Vec3f rb, Vec3f i) {
    ++pixels;
    for (int c = 0; c < 3; ++c) {
      const double va = ra[c], vb = rb[c], v = i[c], r = (1.0 - share) * va + share * vb;
      sum += (v - va) * (v - vb) / (r * r + 0.01 * 0.01) / 3.0;
    }
  });
  if (pixels == 0) throw InputError("no pixel to compare: the mask or non-finite values of the references leave none");
  return sum / static_cast<double>(pixels);
}

Image signed_error_image(const Image& reference, const Image& image, std::span<const std::uint8_t> mask) {
  Image out(reference.width, reference.height, {"Y"});
  each_pixel(reference, reference, image, mask, [&](int, int, std::size_t p, Vec3f r, Vec3f, Vec3f i) {
    double error = 0.0;
    for (int c = 0; c < 3; ++c)
      error += (static_cast<double>(i[c]) - static_cast<double>(r[c])) /
               (std::max(static_cast<double>(r[c]), 0.0) + kMapeOffset) / 3.0;
    out.data[p] = static_cast<float>(error);
  });
  return out;
}

BlockScores block_scores(const Image& a, const Image& b, double share, const Image& image, int size,
                         std::span<const std::uint8_t> mask) {
  if (size < 2) throw InputError("blocks need two pixels a side or more");
  struct Sums {
    double n = 0.0, d = 0.0, d_squared = 0.0, noise = 0.0;
    double halves = 0.0, halves_squared = 0.0;  // of the difference of a and b
  };
  const int columns = (a.width + size - 1) / size, rows = (a.height + size - 1) / size;
  const auto block_of = [&](int x, int y) { return static_cast<std::size_t>(y / size * columns + x / size); };
  std::vector<Sums> blocks(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
  each_pixel(a, b, image, mask, [&](int x, int y, std::size_t, Vec3f ra, Vec3f rb, Vec3f i) {
    const double la = luminance(ra), lb = luminance(rb);
    const double d = luminance(i) - ((1.0 - share) * la + share * lb);
    Sums& s = blocks[block_of(x, y)];
    s.n += 1.0;
    s.d += d;
    s.d_squared += d * d;
    s.noise += (la - lb) * (la - lb) * share * (1.0 - share);
    s.halves += la - lb;
    s.halves_squared += (la - lb) * (la - lb);
  });

  // Filters that reach over several pixels correlate them: the variance of a block's mean, where that of its pixels
  // over their number is 1.
  double correlated = 0.0, counted = 0.0;
  for (const Sums& s : blocks) {
    if (s.n < 2.0 || s.halves_squared <= 0.0) continue;
    correlated += s.halves * s.halves / s.halves_squared;
    counted += 1.0;
  }
  correlated = counted > 0.0 ? std::max(1.0, correlated / counted) : 1.0;

  BlockScores scores;
  std::vector<double> z(blocks.size(), std::numeric_limits<double>::quiet_NaN());
  for (std::size_t k = 0; k < blocks.size(); ++k) {
    const Sums& s = blocks[k];
    if (s.n < 2.0) continue;
    const double mean = s.d / s.n;
    const double scatter = std::max(s.d_squared - s.n * mean * mean, 0.0) / (s.n - 1.0);
    const double error = std::sqrt(correlated * std::max(s.noise / s.n, scatter) / s.n);
    z[k] = std::abs(mean) >= kLargestScore * error ? (mean == 0.0 ? 0.0 : std::copysign(kLargestScore, mean))
                                                   : mean / error;
    ++scores.blocks;
    scores.rms += z[k] * z[k];
    scores.beyond_3 += std::abs(z[k]) > 3.0 ? 1.0 : 0.0;
  }
  if (scores.blocks > 0) {
    scores.rms = std::sqrt(scores.rms / static_cast<double>(scores.blocks));
    scores.beyond_3 /= static_cast<double>(scores.blocks);
  }
  scores.z = Image(a.width, a.height, {"Y"});
  for (int y = 0; y < a.height; ++y) {
    for (int x = 0; x < a.width; ++x) scores.z.at(x, y, 0) = static_cast<float>(z[block_of(x, y)]);
  }
  return scores;
}

}  // namespace octrad
