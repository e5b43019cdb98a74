// Accumulates samples into a picture: reconstruction filter, first-hit layers, double precision.
#pragma once

#include <string>
#include <vector>

#include "octrad/image/image.h"
#include "octrad/render/film_math.h"
#include "octrad/scene/scene.h"

namespace octrad {

// R, G, B, albedo.R ..., normal.X ..., depth.Z, roughness.Y
const std::vector<std::string>& picture_channels();

// Some of these, side by side: all, or one layer.
struct ChannelRange {
  int first = 0, count = kPictureChannelCount;
  bool contains(const ChannelRange& b) const { return first <= b.first && b.first + b.count <= first + count; }
  std::vector<std::string> names() const;
};
// "" (the colour), "albedo", "normal", "depth" or "roughness"; all for any other name.
ChannelRange channels_of(const std::string& layer);

// A reconstruction filter along one axis. The picture's is the product over both; weights are normalised per pixel, as
// Mitsuba's hdrfilm does: pixel = sum f(d) v / sum f(d) over the samples within the radius. Where the weights of a few
// samples sum up to 0 or less, which negative lobes can do, the pixel is 0 until there are more.
class ReconstructionFilter {
 public:
  // Radius 0 means the type's usual one: box 1/2, tent 1, gaussian 4 standard deviations, cubic 2, lanczos 3.
  explicit ReconstructionFilter(const Film& film);
  float radius() const { return shape_.radius; }
  // How many pixels around its own a sample counts for; 0: exactly its own.
  int reach() const { return reach_; }
  const FilterShape& shape() const { return shape_; }

 private:
  FilterShape shape_;
  int reach_;
};

// Sums of filtered samples over a window of the picture.
class FilmBuffer {
 public:
  FilmBuffer() = default;
  // Window [x0, x0 + width) x [y0, y0 + height) of the picture's pixels.
  FilmBuffer(int x0, int y0, int width, int height);
  int x0() const { return x0_; }
  int y0() const { return y0_; }
  int width() const { return width_; }
  int height() const { return height_; }
  void clear();

  // Adds a sample at continuous picture position `p` to every pixel of the window within the filter's reach.
  void add(const ReconstructionFilter& filter, Vec2f p, const PixelSample& sample);
  // Adds a sample to one pixel with weight 1 (box filter). The pixel must be inside the window.
  void add_to_pixel(int x, int y, const PixelSample& sample);
  // Adds another window's sums where the two overlap.
  void add(const FilmBuffer& other);

  // Weighted means; pixels without samples are 0.
  Image image(const ChannelRange& channels = {}) const;
  // The sums, kFilmNumbers a pixel.
  std::vector<double>& sums() { return sums_; }

 private:
  static constexpr std::size_t kStride = kFilmNumbers;
  double* pixel(int x, int y) {
    return sums_.data() +
           (static_cast<std::size_t>(y - y0_) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x - x0_)) *
               kStride;
  }
  const double* pixel(int x, int y) const { return const_cast<FilmBuffer*>(this)->pixel(x, y); }

  int x0_ = 0, y0_ = 0, width_ = 0, height_ = 0;
  std::vector<double> sums_;
};

}  // namespace octrad
