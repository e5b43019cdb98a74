// The relative squared loss of method section 7 (paper equation 14), per point and channel. float or double.
#pragma once

#include <cmath>

#include "octrad/base/hd.h"

namespace octrad {

// The denominator D of ((T - L) / D)^2. It and the target T are constants to the gradient (detached).
//   symmetric:  D = (T + L) / 2 + epsilon. Dark-biased while T is noisy: a high T also enlarges its own denominator.
//   prediction: D = L + epsilon. Does not depend on T: where the expected gradient is 0, L is the mean of T.
enum class LossNormalizer { symmetric, prediction };

template <typename T>
struct LossTerm {
  T value;      // the loss
  T gradient;   // d value / d prediction
  bool finite;  // false: something was not finite, value and gradient are 0; count it
};

// `prediction` and `target` are radiances >= 0, epsilon > 0.
template <typename T>
OCTRAD_HD inline LossTerm<T> relative_squared_loss(T prediction, T target, T epsilon, LossNormalizer normalizer) {
  const T denominator =
      (normalizer == LossNormalizer::symmetric ? (target + prediction) * T(0.5) : prediction) + epsilon;
  const T relative = (target - prediction) / denominator;
  const T value = relative * relative, gradient = T(-2) * relative / denominator;
  if (!(std::isfinite(value) && std::isfinite(gradient))) return {T(0), T(0), false};
  return {value, gradient, true};
}

}  // namespace octrad
