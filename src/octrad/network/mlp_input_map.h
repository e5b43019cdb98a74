// How a network on a device is given positions: halves hold few digits. Plain data, for host and device.
#pragma once

#include "octrad/base/vec.h"

namespace octrad {

// Three inputs, from number `first` on, that come as x * scale + offset instead of x, because halves hold that better:
// a coordinate far from 0 loses what distinguishes its neighbours. The network stays the one of x: scale and offset are
// folded into the first layer's packed weights, sum_k W_k x_k = sum_k (W_k / scale_k) (x_k scale_k + offset_k) -
// sum_k W_k offset_k / scale_k, where the last sum is the weight of one more input, number `inputs`, which is 1.
struct MlpInputMap {
  int first = -1;  // below 0: all inputs come as they are
  Vec3f scale{1.0f, 1.0f, 1.0f}, offset;

  OCTRAD_HD bool any() const { return first >= 0; }
  OCTRAD_HD bool maps(int input) const { return any() && input >= first && input < first + 3; }
};

}  // namespace octrad
