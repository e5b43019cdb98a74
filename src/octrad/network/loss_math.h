// The relative squared loss of method section 7 (paper equation 14), per point and channel, and the loss of colours
// without brightness. float or double.
#pragma once

#include <cmath>

#include "octrad/base/vec.h"

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

// How bright and dark weigh against each other: (T - L)^2 / D^power, with D in units of `unit`, a radiance. 2 is the
// paper's relative error. It asks for a mean of T / L of 1: a prediction that fluctuates by the share s around the
// truth is drawn to 1 + s^2 of it, which a right-hand side that asks the cache hands on from bounce to bounce. 1 asks
// for the mean of T itself, and hardly looks at dark places.
struct LossWeight {
  float power = 2.0f, unit = 1.0f;
};

// `prediction` and `target` are radiances >= 0, epsilon > 0.
template <typename T>
OCTRAD_HD inline LossTerm<T> relative_squared_loss(T prediction, T target, T epsilon, LossNormalizer normalizer,
                                                   LossWeight weight = {}) {
  const T denominator =
      (normalizer == LossNormalizer::symmetric ? (target + prediction) * T(0.5) : prediction) + epsilon;
  const T relative = (target - prediction) / denominator;
  const T scale = weight.power == 2.0f ? T(1) : std::pow(denominator / T(weight.unit), T(2) - T(weight.power));
  const T value = relative * relative * scale, gradient = T(-2) * relative / denominator * scale;
  if (!(std::isfinite(value) && std::isfinite(gradient))) return {T(0), T(0), false};
  return {value, gradient, true};
}

// Squared difference of two colours without their brightness (method section 9), summed over the channels: of L / (|L|
// + epsilon) and the same of the target, |.| being the length. With its gradient by L, u = L / (|L| + epsilon), e = u -
// u of the target:
//     2 (e - L (e . u) / |L|) / (|L| + epsilon)    because du/dL = (I - L u^T / |L|) / (|L| + epsilon).
template <typename T>
struct ChromaTerm {
  T value;
  Vec3<T> gradient;
};

template <typename T>
OCTRAD_HD inline ChromaTerm<T> chroma_loss(Vec3<T> prediction, Vec3<T> target, T epsilon) {
  const T size = length(prediction), norm = T(1) / (size + epsilon);
  const Vec3<T> u = prediction * norm, e = u - target * (T(1) / (length(target) + epsilon));
  const T along = size > T(0) ? dot(e, u) / size : T(0);
  return {dot(e, e), (e - prediction * along) * (T(2) * norm)};
}

}  // namespace octrad
