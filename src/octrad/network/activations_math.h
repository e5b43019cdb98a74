// What follows the linear output of a network, with derivatives (method sections 5 and 9). float or double.
#pragma once

#include <cmath>

#include "octrad/base/hd.h"

namespace octrad {

enum class Activation { identity, squareplus, exp, abs, softplus };

// A value and its derivative with respect to the linear output x.
template <typename T>
struct Activated {
  T value, derivative;
};

// y = (K x + sqrt(K^2 x^2 + 4)) / (2 K), K = 10: positive, y(0) = 0.1, y -> x for large x (Barron 2021, with scale).
// For x < 0 the same with the difference of two near-equal numbers rationalised away: 2 / (K (sqrt(..) - K x)).
// y' = K y / sqrt(K^2 x^2 + 4).
template <typename T>
OCTRAD_HD inline Activated<T> squareplus(T x) {
  const T k = T(10), kx = k * x, root = std::sqrt(kx * kx + T(4));
  const T y = x >= T(0) ? (kx + root) / (T(2) * k) : T(2) / (k * (root - kx));
  return {y, k * y / root};
}

// e^x up to x = 4, continued linearly: e^4 (1 + x - 4). A step that overshoots cannot overflow.
template <typename T>
OCTRAD_HD inline Activated<T> exp_linear(T x) {
  if (x > T(4)) {
    const T e4 = T(54.598150033144236);
    return {e4 * (T(1) + (x - T(4))), e4};
  }
  const T y = std::exp(x);  // NaN takes this branch and stays NaN
  return {y, y};
}

// |x|; the derivative at 0 is taken as 1, so that an output that starts at exactly 0 can leave it.
template <typename T>
OCTRAD_HD inline Activated<T> absolute(T x) {
  return x < T(0) ? Activated<T>{-x, T(-1)} : Activated<T>{x, T(1)};
}

// log(1 + e^x).
template <typename T>
OCTRAD_HD inline Activated<T> softplus(T x) {
  const T e = std::exp(-std::fabs(x)), y = std::log1p(e);
  return x > T(0) ? Activated<T>{x + y, T(1) / (T(1) + e)} : Activated<T>{y, e / (T(1) + e)};
}

template <typename T>
OCTRAD_HD inline Activated<T> activate(Activation kind, T x) {
  switch (kind) {
    case Activation::squareplus: return squareplus(x);
    case Activation::exp: return exp_linear(x);
    case Activation::abs: return absolute(x);
    case Activation::softplus: return softplus(x);
    case Activation::identity: break;
  }
  return {x, T(1)};
}

}  // namespace octrad
