// Which camera samples a device takes: kept in device memory, so that a recorded graph can be replayed with another
// view or the next samples. And their results.
#pragma once

#include "octrad/scene/camera_math.h"
#include "octrad/transport/follow_math.h"
#include "octrad/transport/queue_math.h"

namespace octrad {

// Some pixels of a job's window, as numbers y * width + x in it, ascending. Both in device memory; null: all pixels.
struct ListedPixels {
  const std::uint32_t* numbers = nullptr;
  const std::uint32_t* places = nullptr;  // in `numbers`, by number; kNone: not listed
  std::uint32_t first = 0, count = 0;     // the part of the list that the job has
  static constexpr std::uint32_t kNone = ~0u;
};

// Samples [first, first + count) of every pixel of a window of the picture, or of those that are listed. Sample k of
// the job is sample first + k % count of pixel k / count: row after row, or, without a list, in tiles of 8 x 4 (less at
// the right and the lower edge), whose rays, hits and look-ups are near to each other, as a warp.
struct CameraJob {
  CameraView view;  // of the whole picture
  unsigned long long seed = 0;
  int x0 = 0, y0 = 0, width = 0, height = 0;
  int first = 0, count = 0;
  bool tiles = false;
  ListedPixels listed;

  static constexpr std::uint32_t kTileWidth = 8, kTileHeight = 4;
  struct Place {
    int x, y, i;
  };

  OCTRAD_HD std::uint32_t size() const {
    const std::uint32_t pixels = listed.numbers != nullptr
                                     ? listed.count
                                     : static_cast<std::uint32_t>(width) * static_cast<std::uint32_t>(height);
    return pixels * static_cast<std::uint32_t>(count);
  }
  OCTRAD_HD Place place(std::uint32_t k) const {
    const auto samples = static_cast<std::uint32_t>(count), columns = static_cast<std::uint32_t>(width);
    std::uint32_t pixel = k / samples;
    const int i = first + static_cast<int>(k % samples);
    if (listed.numbers != nullptr) pixel = listed.numbers[listed.first + pixel];
    if (!tiles || listed.numbers != nullptr)
      return {x0 + static_cast<int>(pixel % columns), y0 + static_cast<int>(pixel / columns), i};
    const std::uint32_t top = pixel / (kTileHeight * columns) * kTileHeight, tall = tall_at(top),
                        in_band = pixel - top * columns, left = in_band / (kTileWidth * tall) * kTileWidth,
                        wide = wide_at(left), in_tile = in_band - left * tall, row = in_tile / wide;
    return {x0 + static_cast<int>(left + in_tile - row * wide), y0 + static_cast<int>(top + row), i};
  }
  // Number of the pixel at x, y of the picture, inside the window: sample i of it is k = number * count + i - first.
  // ListedPixels::kNone where the job has no samples of it.
  OCTRAD_HD std::uint32_t pixel_number(int x, int y) const {
    const auto columns = static_cast<std::uint32_t>(width), column = static_cast<std::uint32_t>(x - x0),
               row = static_cast<std::uint32_t>(y - y0);
    if (listed.numbers != nullptr) {
      const std::uint32_t place = listed.places[row * columns + column];
      return place - listed.first < listed.count ? place - listed.first : ListedPixels::kNone;
    }
    if (!tiles) return row * columns + column;
    const std::uint32_t top = row / kTileHeight * kTileHeight, left = column / kTileWidth * kTileWidth;
    return top * columns + left * tall_at(top) + (row - top) * wide_at(left) + column - left;
  }
  OCTRAD_HD CameraSample sample(std::uint32_t k) const {
    const Place p = place(k);
    return camera_sample(view, seed, p.x, p.y, p.i);
  }

 private:
  // Size of the tiles from this row or column of the window on.
  OCTRAD_HD std::uint32_t tall_at(std::uint32_t top) const {
    const std::uint32_t left = static_cast<std::uint32_t>(height) - top;
    return left < kTileHeight ? left : kTileHeight;
  }
  OCTRAD_HD std::uint32_t wide_at(std::uint32_t left) const {
    const std::uint32_t more = static_cast<std::uint32_t>(width) - left;
    return more < kTileWidth ? more : kTileWidth;
  }
};

// Radiance 0..2 and the first hit's albedo 3..5, normal 6..8, depth 9 and roughness 10 of each sample.
inline constexpr int kSampleNumbers = 11;

struct SamplePlanes : FloatPlanes {
  OCTRAD_HD Vec3f radiance(std::size_t k) const { return get3(0, k); }
  OCTRAD_HD void set_radiance(std::size_t k, Vec3f v) const { set3(0, k, v); }
  OCTRAD_HD void set_first(std::size_t k, const FirstHit& first) const {
    set3(3, k, first.albedo);
    set3(6, k, first.normal);
    set(9, k, first.depth);
    set(10, k, first.roughness);
  }
};

}  // namespace octrad
