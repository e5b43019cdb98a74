// FLIP: the difference that an observer sees when he alternates between two pictures.
//   Andersson, Nilsson, Akenine-Moeller, Oskarsson, Astrom, Fairchild: "FLIP: A Difference Evaluator for Alternating
//   Images", Proceedings of the ACM on Computer Graphics and Interactive Techniques 3(2), 2020 (HPG).
//   Andersson, Nilsson, Shirley, Akenine-Moeller: "Visualizing Errors in Rendered High Dynamic Range Images",
//   Eurographics Short Papers, 2021.
#pragma once

#include "octrad/image/image.h"

namespace octrad {

// Pixels a degree of the observer's view: 67 for 0.7 m before a display of 3840 pixels on 0.7 m.
inline constexpr double kFlipPixelsPerDegree = 67.0;

// Stops from the lowest to the highest exposure at which HDR-FLIP looks: at `first` the brightest pixel of the
// reference reaches 0.85 of white through the tone mapping (ACES), at `last` the median does; `count` steps, at least
// two, about one stop apart.
struct FlipExposures {
  double first = 0.0, last = 0.0;
  int count = 0;
};
// The median is that of the pixels that are not black where half of the reference is. count 0 for a black reference.
FlipExposures flip_exposures(const Image& reference);

// Error in [0, 1] at each pixel, as a picture with the channel "Y". Inputs have the channels R, G, B, one size, finite
// values; the border is continued by its pixels. flip_ldr(): linear values in [0, 1] (shown_linear_color()).
// flip_hdr(): linear radiance; the largest error over the exposures, 0 where there are none. Throws InputError unless
// 1 <= pixels_per_degree <= 1000.
Image flip_ldr(const Image& reference, const Image& image, double pixels_per_degree = kFlipPixelsPerDegree);
Image flip_hdr(const Image& reference, const Image& image, const FlipExposures& exposures,
               double pixels_per_degree = kFlipPixelsPerDegree);

}  // namespace octrad
