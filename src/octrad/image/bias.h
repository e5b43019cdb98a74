// Whether and where a picture is wrong on average, as far as the noise of its reference lets one tell. The reference is
// two independent pictures of the same view, a and b, with n_a and n_b samples a pixel; `share`: n_b / (n_a + n_b).
// Their weighted mean is R = (1 - share) a + share b.
#pragma once

#include <cstdint>
#include <span>

#include "octrad/image/image.h"

namespace octrad {

// Mean over the pixels of the mask and RGB of (I - a)(I - b) / (R^2 + 0.01^2). The noise of a and that of b are
// independent, so the product has none on average: this estimates mean (I - truth)^2 / (truth^2 + 0.01^2), and may be
// negative where the error is smaller than what the noise leaves visible. Only R in the denominator still has
// noise, and the same as the numerator: with a standard deviation s the result is about 1 + 4 s^2 / (d R) + 3 s^2 / R^2
// times what it estimates where the error is d (more where the picture is too bright, less where it is too dark), and
// where s is as large as R, single dark pixels count for much. compare()'s relmse divides by R^2 + 0.01 instead.
// Pixels that are not finite: as in compare(). Throws as compare() does.
double noise_free_error(const Image& a, const Image& b, double share, const Image& image,
                        std::span<const std::uint8_t> mask = {});

// (I - R) / (max(R, 0) + 0.01), mean over RGB, of `reference` alone, as a picture with the channel "Y": positive where
// the picture is too bright. 0 outside the mask and where the reference is not finite. Throws as compare() does.
Image signed_error_image(const Image& reference, const Image& image, std::span<const std::uint8_t> mask = {});

struct BlockScores {
  Image z;  // channel "Y": each pixel has the score of its block; NaN for blocks with less than two pixels
  long long blocks = 0;
  double rms = 0.0;       // about 1 without bias
  double beyond_3 = 0.0;  // share of the blocks with |z| > 3: 0.3 % without bias
};
// Blocks of `size` x `size` pixels: the mean of d = luminance of I - R over its standard error. Its square is the
// larger of what the difference of a and b says of the noise of R, and the scatter of d in the block, which has the
// noise of I too, times what filters that correlate neighbouring pixels add to the variance of a mean, measured from
// the difference of a and b over all blocks. Scores are limited to +-1000. Throws as compare() does, and InputError
// unless size >= 2.
BlockScores block_scores(const Image& a, const Image& b, double share, const Image& image, int size = 8,
                         std::span<const std::uint8_t> mask = {});

}  // namespace octrad
