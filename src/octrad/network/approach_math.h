// One step of a running mean of weights (train.average; Polyak & Juditsky, "Acceleration of Stochastic Approximation by
// Averaging", 1992).
#pragma once

#include "octrad/base/hd.h"

namespace octrad {

// `value` moved by `share` of the way to `to`; from a share of 1 on `to` itself, bit for bit.
OCTRAD_HD inline float approached(float value, float to, float share) {
  return share < 1.0f ? value + (to - value) * share : to;
}

}  // namespace octrad
