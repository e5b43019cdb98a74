// Evaluation and importance sampling of a latitude-longitude environment.
//
// Layout as Mitsuba 3's `envmap`: direction (in the map's own space, +Y up) -> u = atan2(x, -z) / 2 pi, v = acos(y) /
// pi. Pixel column i is centred at u = (i + 1/2) / width and periodic; pixel row j lies at v = j / (height - 1), so
// that the first and last rows are the poles. Radiance is bilinear in between, and so is the sampling density in (u,
// v) inside each of 16 x 8 parts of the map: luminance times sin(theta) at the pixels. How likely a part is depends on
// the place that is lit (set_places()).
#pragma once

#include <vector>

#include "octrad/scene/scene.h"
#include "octrad/shading/environment_math.h"

namespace octrad {

// Probabilities of the parts of the map for each place.
struct EnvironmentPlaces {
  PlaceGrid grid;
  // [grid.count()][kEnvironmentParts], not negative; those of a place need not sum to 1. Parts without light have none,
  // and a place that is left without any has the integrals.
  std::vector<float> shares;
};

// The environment must outlive this object.
class EnvironmentMap {
 public:
  // `of`: a file that messages name.
  explicit EnvironmentMap(const Environment& environment, const std::string& of = "");
  EnvironmentMap(const EnvironmentMap&) = delete;
  EnvironmentMap& operator=(const EnvironmentMap&) = delete;

  // The probabilities of the parts from now on; before, they are in proportion to the parts' integrals everywhere. For
  // maps of one row nothing changes.
  void set_places(const EnvironmentPlaces& places);
  // Integrals of the parts, [kEnvironmentParts]; all 0 for a black map, empty for maps of one row.
  const std::vector<float>& integrals() const { return integrals_; }

  using Sample = EnvironmentSample;
  Vec3f radiance(Vec3f direction) const { return environment_radiance(view_, direction); }
  // Solid-angle density of sample() for light that arrives at `p`.
  float pdf(Vec3f p, Vec3f direction) const { return environment_pdf(view_, p, direction); }
  // Both at once.
  Vec3f radiance(Vec3f p, Vec3f direction, float& density) const {
    return environment_radiance(view_, p, direction, density);
  }
  Sample sample(Vec3f p, Vec2f u) const { return sample_environment(view_, p, u); }
  // Start loading what pick_column() will read of a picked row, and sample_cell() of a cell.
  void prefetch_table(const EnvironmentPick& pick) const;
  void prefetch_pixels(const EnvironmentPick& pick) const;
  // The tables as environment_math.h reads them.
  const EnvironmentView& view() const { return view_; }

 private:
  static void build_alias(const double* weights, int count, AliasEntry* out);

  std::vector<float> sines_, integrals_, densities_;
  std::vector<AliasEntry> rows_, cells_, parts_;
  EnvironmentView view_;
};

}  // namespace octrad
