// How far a picture is from a reference (method section 10). Both hold linear radiance; sums are in double and in pixel
// order, so that results do not depend on threads.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "octrad/image/image.h"

namespace octrad {

inline constexpr double kMapeOffset = 0.01;

// I: picture, R: reference, per pixel and RGB channel; means are over the pixels of the mask.
struct Metrics {
  double mape = 0.0;          // mean |I - R| / (R + 0.01)
  double mape_trimmed = 0.0;  // the same without the worst 0.1 % of the pixels (rounded down)
  double mse = 0.0;           // mean (I - R)^2
  double relmse = 0.0;        // mean (I - R)^2 / (R^2 + 0.01) (Rousselle et al. 2011)
  double psnr = 0.0;          // dB, as displayed: both clamped to [0, 1] and sRGB-encoded, peak 1; infinite when equal
  double mean_ratio = 1.0;    // mean luminance of I / mean luminance of R; NaN when R is black
  long long pixels = 0;       // compared
  long long non_finite_image = 0;      // pixels of I with a NaN or infinite value; they count as black
  long long non_finite_reference = 0;  // pixels of R with one; they are left out
};

// `mask`: one byte a pixel, 0 leaves it out; empty: all pixels. Throws InputError when sizes differ, a picture has no
// colour, or no pixel is left.
Metrics compare(const Image& reference, const Image& image, std::span<const std::uint8_t> mask = {});

// Throws InputError when the pictures, or the picture and the mask (empty: none), differ in size.
void check_comparable(const Image& reference, const Image& image, std::span<const std::uint8_t> mask);

// The errors of `reference` itself, estimated from its difference to `other`, a picture of the same view with other
// random numbers. `share`: of the variance of that difference, what the reference's own is: n_b / (n_a + n_b) for
// independent pictures with n_a and n_b samples a pixel. Squared errors are scaled by it, mape by its root; psnr and
// mean_ratio are those of the difference. Throws as compare() does.
Metrics reference_noise(const Image& reference, const Image& other, double share,
                        std::span<const std::uint8_t> mask = {});

// Mask of the pixels whose mean over the colour channels is at least half. Throws InputError when it has no colour.
std::vector<std::uint8_t> picture_mask(const Image& image);

// Mask of the pixels whose first hit has a roughness in [from, below), from the layer "roughness.Y" of `layers`.
// Pixels that hit nothing (a normal of length 0, where there is a "normal" layer) are left out. Throws InputError when
// there is no such layer.
std::vector<std::uint8_t> roughness_mask(const Image& layers, float from, float below);

enum class ErrorKind { mape, squared, relative_squared };

// Per-pixel error (mean over RGB of the term of the metric) as a picture with the channel "Y"; 0 outside the mask and
// where the reference is not finite.
Image error_image(const Image& reference, const Image& image, ErrorKind kind = ErrorKind::mape,
                  std::span<const std::uint8_t> mask = {});

}  // namespace octrad
