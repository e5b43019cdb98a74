// Evaluation and importance sampling of a latitude-longitude environment.
//
// Layout as Mitsuba 3's `envmap`: direction (in the map's own space, +Y up) -> u = atan2(x, -z) / 2 pi, v = acos(y) / pi.
// Pixel column i is centred at u = (i + 1/2) / width and periodic; pixel row j lies at v = j / (height - 1), so that the
// first and last rows are the poles. Radiance is bilinear in between, and so is the sampling density in (u, v):
// luminance times sin(theta) at the pixels.
#pragma once

#include <vector>

#include "base/vec.h"
#include "scene/scene.h"

namespace octrad {

class EnvironmentMap {
 public:
  explicit EnvironmentMap(const Environment& environment);

  Vec3f radiance(Vec3f direction) const;
  // Solid-angle density of sample().
  float pdf(Vec3f direction) const;
  // Both at once.
  Vec3f radiance(Vec3f direction, float& density) const;
  struct Sample {
    Vec3f direction;
    Vec3f radiance;
    float pdf = 0.0f;
  };
  Sample sample(Vec2f u) const;
  // Start loading what sample(u) will read: first the table entry, then (once that is there) the pixels.
  void prefetch_table(Vec2f u) const;
  void prefetch_pixels(Vec2f u) const;
  // Mean radiance luminance over the sphere.
  float mean_luminance() const { return mean_; }

 private:
  struct Cell {
    int x, y;       // lower corner
    float fx, fy;   // position inside, [0, 1]
  };
  // An entry of an alias table (Walker 1977): itself with probability `keep`, otherwise `other`.
  struct Alias {
    float keep;
    int other;
  };
  static void build_alias(const double* weights, int count, Alias* out);
  // Draws an index below `count`; `u` is replaced by its uniform remainder.
  static int pick(const Alias* table, int count, float& u);

  Cell cell(Vec2f uv) const;
  Vec3f texel(int x, int y) const { return map_.pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x)]; }
  // Luminance times sin(theta) at a pixel.
  float weight(int x, int y) const {
    const float l = luminance(texel(x, y));
    return l > 0.0f ? l * sines_[static_cast<std::size_t>(y)] : 0.0f;
  }
  float bilinear_weight(const Cell& c) const;
  Vec3f bilinear_radiance(const Cell& c) const;
  Vec3f to_world(Vec3f v) const;
  Vec3f to_map(Vec3f v) const;

  const Environment& map_;
  int width_, height_;
  std::vector<float> sines_;       // sin(theta) of the rows of pixels
  std::vector<Alias> rows_;        // of cells, [height - 1]
  std::vector<Alias> cells_;       // of each row, [height - 1][width]
  float inv_integral_ = 0.0f;      // density in (u, v) = weight x inv_integral_
  float mean_ = 0.0f;
};

}  // namespace octrad
