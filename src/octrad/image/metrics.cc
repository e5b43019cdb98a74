#include "octrad/image/metrics.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "octrad/base/error.h"

namespace octrad {
namespace {

constexpr double kRelativeOffset = 0.01;

struct PixelError {
  double mape = 0.0, squared = 0.0, relative = 0.0;  // means over RGB
};

PixelError pixel_error(Vec3f reference, Vec3f image) {
  PixelError e;
  for (int c = 0; c < 3; ++c) {
    const double r = reference[c], d = static_cast<double>(image[c]) - r;
    // A (wrong) negative reference must not turn the sign of an error or divide by 0.
    e.mape += std::abs(d) / (std::max(r, 0.0) + kMapeOffset) / 3.0;
    e.squared += d * d / 3.0;
    e.relative += d * d / (r * r + kRelativeOffset) / 3.0;
  }
  return e;
}

double displayed_squared(Vec3f reference, Vec3f image) {
  double sum = 0.0;
  for (int c = 0; c < 3; ++c) {
    const double d = static_cast<double>(encode_srgb(std::clamp(image[c], 0.0f, 1.0f))) -
                     static_cast<double>(encode_srgb(std::clamp(reference[c], 0.0f, 1.0f)));
    sum += d * d / 3.0;
  }
  return sum;
}

}  // namespace

void check_comparable(const Image& reference, const Image& image, std::span<const std::uint8_t> mask) {
  const auto size = [](const Image& i) { return std::to_string(i.width) + " x " + std::to_string(i.height); };
  if (reference.width != image.width || reference.height != image.height) {
    throw InputError("pictures differ in size: the reference has " + size(reference) + " pixels, the other " +
                     size(image));
  }
  if (!mask.empty() && mask.size() != reference.pixel_count())
    throw InputError("the mask does not have the size of the reference");
}

Metrics compare(const Image& reference_file, const Image& image_file, std::span<const std::uint8_t> mask) {
  check_comparable(reference_file, image_file, mask);
  const Image reference = extract_rgb(reference_file), image = extract_rgb(image_file);
  Metrics m;
  std::vector<double> mapes;
  mapes.reserve(reference.pixel_count());
  double displayed = 0.0, luminance_image = 0.0, luminance_reference = 0.0;
  for (int y = 0; y < reference.height; ++y) {
    for (int x = 0; x < reference.width; ++x) {
      const std::size_t p =
          static_cast<std::size_t>(y) * static_cast<std::size_t>(reference.width) + static_cast<std::size_t>(x);
      if (!mask.empty() && mask[p] == 0) continue;
      const Vec3f r = reference.rgb(x, y);
      Vec3f i = image.rgb(x, y);
      if (!is_finite(r)) {
        ++m.non_finite_reference;
        continue;
      }
      if (!is_finite(i)) {
        ++m.non_finite_image;
        i = Vec3f(0.0f);
      }
      const PixelError e = pixel_error(r, i);
      mapes.push_back(e.mape);
      m.mse += e.squared;
      m.relmse += e.relative;
      displayed += displayed_squared(r, i);
      luminance_image += static_cast<double>(luminance(i));
      luminance_reference += static_cast<double>(luminance(r));
    }
  }
  if (mapes.empty()) throw InputError("no pixel to compare: the mask or non-finite values of the reference leave none");
  m.pixels = static_cast<long long>(mapes.size());
  const double n = static_cast<double>(mapes.size());
  for (const double e : mapes) m.mape += e;
  m.mape /= n;
  m.mse /= n;
  m.relmse /= n;
  m.psnr = displayed > 0.0 ? -10.0 * std::log10(displayed / n) : std::numeric_limits<double>::infinity();
  m.mean_ratio =
      luminance_reference != 0.0 ? luminance_image / luminance_reference : std::numeric_limits<double>::quiet_NaN();

  std::sort(mapes.begin(), mapes.end());
  const std::size_t kept = mapes.size() - mapes.size() / 1000;
  for (std::size_t k = 0; k < kept; ++k) m.mape_trimmed += mapes[k];
  m.mape_trimmed /= static_cast<double>(kept);
  return m;
}

Metrics reference_noise(const Image& reference, const Image& other, double share, std::span<const std::uint8_t> mask) {
  Metrics m = compare(reference, other, mask);
  m.mse *= share;
  m.relmse *= share;
  m.mape *= std::sqrt(share);
  m.mape_trimmed *= std::sqrt(share);
  return m;
}

std::vector<std::uint8_t> picture_mask(const Image& image) {
  const Image rgb = extract_rgb(image);
  std::vector<std::uint8_t> mask(rgb.pixel_count());
  for (std::size_t p = 0; p < mask.size(); ++p) {
    const float* v = &rgb.data[3 * p];
    mask[p] = v[0] + v[1] + v[2] >= 1.5f ? 1 : 0;
  }
  return mask;
}

std::vector<std::uint8_t> roughness_mask(const Image& layers, float from, float below) {
  const int roughness = layers.channel("roughness.Y");
  if (roughness < 0) {
    throw InputError("no layer \"roughness.Y\" to select pixels by (every picture that octrad render writes has one)");
  }
  const int normal[3] = {layers.channel("normal.X"), layers.channel("normal.Y"), layers.channel("normal.Z")};
  const bool has_normal = normal[0] >= 0 && normal[1] >= 0 && normal[2] >= 0;
  std::vector<std::uint8_t> mask(layers.pixel_count(), 0);
  std::size_t p = 0;
  for (int y = 0; y < layers.height; ++y) {
    for (int x = 0; x < layers.width; ++x, ++p) {
      const float r = layers.at(x, y, roughness);
      bool hit = true;
      if (has_normal)
        hit = layers.at(x, y, normal[0]) != 0.0f || layers.at(x, y, normal[1]) != 0.0f ||
              layers.at(x, y, normal[2]) != 0.0f;
      mask[p] = hit && r >= from && r < below ? 1 : 0;
    }
  }
  return mask;
}

Image error_image(const Image& reference_file, const Image& image_file, ErrorKind kind,
                  std::span<const std::uint8_t> mask) {
  check_comparable(reference_file, image_file, mask);
  const Image reference = extract_rgb(reference_file), image = extract_rgb(image_file);
  Image out(reference.width, reference.height, {"Y"});
  std::size_t p = 0;
  for (int y = 0; y < reference.height; ++y) {
    for (int x = 0; x < reference.width; ++x, ++p) {
      const Vec3f r = reference.rgb(x, y), i = image.rgb(x, y);
      if ((!mask.empty() && mask[p] == 0) || !is_finite(r)) continue;
      const PixelError e = pixel_error(r, is_finite(i) ? i : Vec3f(0.0f));
      out.data[p] = static_cast<float>(kind == ErrorKind::mape      ? e.mape
                                       : kind == ErrorKind::squared ? e.squared
                                                                    : e.relative);
    }
  }
  return out;
}

}  // namespace octrad
