// What views have in common on the CPU and on a stream. Internal to the module.
#pragma once

#include <string>
#include <vector>

#include "octrad/model/radiance_field.h"
#include "octrad/render/render_loop.h"

namespace octrad {

struct ViewKind {
  enum { disparity, traced, features, occupancy } kind;
  int level = 0;
};

// Throws UsageError for a view that the field does not have.
ViewKind parse_view(const RadianceField& field, const std::string& view);

// A stable colour for a cell of a level, by a position in the unit cube.
Vec3f cell_color(Vec3f normalised, int level);

// One level's features of the whole picture, one sample a pixel: principal components need all of them (of the crop) at
// once.
class FeaturePicture {
 public:
  FeaturePicture() = default;
  FeaturePicture(int width, int height, std::size_t features)
      : width_(width),
        features_(features),
        values_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * features),
        seen_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {}

  // The place for the pixel's features, which count as seen. Pixels may be set from several threads.
  float* pixel(int x, int y) {
    const std::size_t p = static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
    seen_[p] = 1;
    return &values_[p * features_];
  }
  // Colours of the first three principal components.
  void paint(const Crop& crop, Image& image) const;

 private:
  int width_ = 0;
  std::size_t features_ = 0;
  std::vector<float> values_;
  std::vector<unsigned char> seen_;
};

}  // namespace octrad
