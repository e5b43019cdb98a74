// Structural similarity (Wang, Bovik, Sheikh, Simoncelli: "Image Quality Assessment: From Error Visibility to
// Structural Similarity", IEEE Transactions on Image Processing 13(4), 2004).
#pragma once

#include "octrad/image/image.h"

namespace octrad {

inline constexpr int kSsimWindow = 11;  // pixels a side

// SSIM at every pixel whose window lies inside the picture, mean over R, G and B, as a picture with the channel "Y";
// NaN at the others, five pixels at each side. Window: Gaussian, sigma 1.5 pixels, 11 x 11, sum 1; variances are
// population variances; C1 = 0.01^2, C2 = 0.03^2 for values in [0, 1]. Inputs: what a screen shows (display_color()),
// of one size, finite. All values are NaN where a side is shorter than the window.
Image ssim_image(const Image& reference, const Image& image);

}  // namespace octrad
