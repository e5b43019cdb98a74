// The inner part of FLIP, one tile of a picture, chosen for the processor at run time.
#pragma once

#include <cstddef>
#include <vector>

#include "octrad/image/image.h"

namespace octrad {

inline constexpr std::size_t kFlipTile = 128;  // columns of a tile: whole vectors on every processor
inline constexpr std::size_t kFlipTileRows = 64;

// A filter of 2 radius + 1 taps that is even or odd around its centre: the taps from the centre outwards.
struct FlipFilter {
  std::vector<float> taps;
};

struct FlipConstants {
  int radius = 0;  // of all filters (shorter ones end with zeros)
  // Spatial filters: the achromatic and red-green ones are one Gaussian each, the blue-yellow one is the sum of two
  // products of Gaussians, with these shares. Feature filters: Gaussian, its first (odd) and second derivative.
  FlipFilter achromatic, red_green, blue_yellow[2], gaussian, edge, point;
  float share[2] = {};
  float to_xyz[3][3] = {};     // linear RGB to XYZ over that of white
  float to_rgb[3][3] = {};     // back
  float largest_color = 0.0f;  // the colour difference that becomes 1: green to blue, to the power q_c
  // Tone mapping (k0 x^2 + k1 x) / (k2 x^2 + k3 x + k4) of 2^exposure * x, then limited to [0, 1]; without, as it is.
  bool tone_map = false;
  float curve[5] = {};
  float scale = 1.0f;
};

// `error` [height][width]: becomes max(error, FLIP) in the tile whose first pixel is (x0, y0).
void flip_tile(const FlipConstants& constants, const Image& reference, const Image& image, int x0, int y0,
               std::vector<float>& error);

}  // namespace octrad
