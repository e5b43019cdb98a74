// One Adam update of one parameter: the definition that the fast paths follow operation by operation, so that they
// give the same bits. Kingma & Ba, "Adam: A Method for Stochastic Optimization" (2015), algorithm 1.
#pragma once

#include <cmath>

#include "octrad/base/hd.h"

namespace octrad {

struct AdamConstants {
  float beta1, beta2;  // decay of the moments
  float rest1, rest2;  // 1 - beta1, 1 - beta2
  float epsilon;
};

OCTRAD_HD inline AdamConstants adam_constants(double beta1, double beta2, double epsilon) {
  return {static_cast<float>(beta1), static_cast<float>(beta2), static_cast<float>(1.0 - beta1),
          static_cast<float>(1.0 - beta2), static_cast<float>(epsilon)};
}

// Bias correction of moments that start at 0, after `count` >= 1 steps: first = 1 / (1 - beta1^count) multiplies the
// mean, second = 1 / sqrt(1 - beta2^count) the root of the squares.
struct AdamCorrection {
  float first, second;
};

OCTRAD_HD inline AdamCorrection adam_correction(double beta1, double beta2, double count) {
  return {static_cast<float>(1.0 / (1.0 - std::pow(beta1, count))),
          static_cast<float>(1.0 / std::sqrt(1.0 - std::pow(beta2, count)))};
}

// False for gradients that must not enter the moments: NaN, infinite, or with a square beyond float.
OCTRAD_HD inline bool adam_usable(float gradient) { return gradient * gradient <= 3.402823466e+38f; }

// The new value of a parameter; `scaled_rate` is the learning rate times correction.first. Updates m and v.
// `gradient` must be usable (see above) or 0.
OCTRAD_HD inline float adam_update(float parameter, float gradient, float& m, float& v, const AdamConstants& k,
                                   float scaled_rate, float second) {
  m = k.beta1 * m + k.rest1 * gradient;
  v = k.beta2 * v + k.rest2 * (gradient * gradient);
  return parameter - (scaled_rate * m) / (std::sqrt(v) * second + k.epsilon);
}

}  // namespace octrad
