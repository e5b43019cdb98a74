// What views of a field have in common on the CPU and on a stream.
#pragma once

#include <algorithm>
#include <vector>

#include "octrad/base/memory_limit.h"
#include "octrad/image/image.h"
#include "octrad/model/radiance_field.h"
#include "octrad/render/view.h"

namespace octrad {

// A stable colour for a cell of a level, by a position in the unit cube.
Vec3f cell_color(Vec3f normalised, int level);

// How many features a level of `field` has.
inline std::size_t level_width(const RadianceField& field) {
  return static_cast<std::size_t>(field.feature_count() / std::max(1, field.levels()));
}

// One level's features over a picture, one sample a pixel: principal components need all of them at once.
class FeaturePicture {
 public:
  FeaturePicture() = default;
  // Shows the part of `view` that is returned; `features` numbers a pixel.
  FeaturePicture(const View& view, std::size_t features)
      : rect_(view.part()),
        features_(features),
        seen_(static_cast<std::size_t>(rect_.width()) * static_cast<std::size_t>(rect_.height())) {
    // paint() keeps a copy of what was seen, and colours.
    ask_memory(seen_.size() * (2 * features * sizeof(float) + sizeof(Vec3f) + 2 * sizeof(float)),
               "a picture of features");
    values_.resize(seen_.size() * features);
  }

  // The place for the features of pixel (x, y) of the whole picture, which count as seen; null outside of the part.
  // Pixels may be set from several threads.
  float* pixel(int x, int y) {
    if (x < rect_.x0 || x >= rect_.x1 || y < rect_.y0 || y >= rect_.y1) return nullptr;
    const std::size_t p = static_cast<std::size_t>(y - rect_.y0) * static_cast<std::size_t>(rect_.width()) +
                          static_cast<std::size_t>(x - rect_.x0);
    seen_[p] = 1;
    return &values_[p * features_];
  }
  // Colours of the first three principal components, into a picture of the part.
  void paint(Image& image) const;

 private:
  PixelRect rect_;
  std::size_t features_ = 0;
  std::vector<unsigned char> seen_;
  std::vector<float> values_;
};

}  // namespace octrad
