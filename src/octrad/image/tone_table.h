// Tone mapping of many pictures with the same settings, for pictures that must be quick.
#pragma once

#include <cstdint>
#include <vector>

#include "octrad/image/image.h"
#include "octrad/image/tonemap_math.h"

namespace octrad {

// tonemap() of tonemap_math.h for every half float, in three tables. A value is rounded to a half first, which moves
// the result by one step of 255 at most; what is above kLargestHalf is white.
class ToneTable {
 public:
  // `white`: linear factors of R, G and B before everything else (a white point).
  explicit ToneTable(const ToneMapping& mapping, Vec3f white = Vec3f(1.0f));
  // Channels `first` ... `first` + 2 of the picture, which hold linear values.
  Image8 operator()(const Image& image, int first = 0) const;

 private:
  std::vector<std::uint8_t> table_;  // [3][65536]
};

}  // namespace octrad
