// Evaluation and importance sampling of a latitude-longitude environment.
//
// Layout as Mitsuba 3's `envmap`: direction (in the map's own space, +Y up) -> u = atan2(x, -z) / 2 pi, v = acos(y) /
// pi. Pixel column i is centred at u = (i + 1/2) / width and periodic; pixel row j lies at v = j / (height - 1), so
// that the first and last rows are the poles. Radiance is bilinear in between, and so is the sampling density in (u,
// v): luminance times sin(theta) at the pixels, times a factor of the part of the map (set_factors()).
#pragma once

#include <array>
#include <span>
#include <vector>

#include "octrad/scene/scene.h"
#include "octrad/shading/environment_math.h"

namespace octrad {

// The environment must outlive this object.
class EnvironmentMap {
 public:
  explicit EnvironmentMap(const Environment& environment);
  EnvironmentMap(const EnvironmentMap&) = delete;
  EnvironmentMap& operator=(const EnvironmentMap&) = delete;

  // Makes sample() draw directions of each part of the map (EnvironmentView::part()) that many times as often, beside
  // the others; 1 at first. [kEnvironmentParts], above 0. For maps of one row nothing changes.
  void set_factors(std::span<const float> factors);

  using Sample = EnvironmentSample;
  Vec3f radiance(Vec3f direction) const { return environment_radiance(view_, direction); }
  // Solid-angle density of sample().
  float pdf(Vec3f direction) const { return environment_pdf(view_, direction); }
  // Both at once.
  Vec3f radiance(Vec3f direction, float& density) const { return environment_radiance(view_, direction, density); }
  Sample sample(Vec2f u) const { return sample_environment(view_, u); }
  // Start loading what sample(u) will read: first the table entry, then (once that is there) the pixels.
  void prefetch_table(Vec2f u) const;
  void prefetch_pixels(Vec2f u) const;
  // The tables as environment_math.h reads them.
  const EnvironmentView& view() const { return view_; }

 private:
  void build_tables();
  static void build_alias(const double* weights, int count, AliasEntry* out);

  std::vector<float> sines_;
  std::array<float, kEnvironmentParts> factors_;
  std::vector<AliasEntry> rows_, cells_;
  EnvironmentView view_;
};

}  // namespace octrad
