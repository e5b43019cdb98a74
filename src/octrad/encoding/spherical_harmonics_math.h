// Real spherical harmonics up to degree 3 (four bands, 16 values: "degree 4" in the neural-graphics literature).
//
// Y_lm(w) = sqrt(2) N_l|m| P_l^|m|(z) * (cos m phi for m > 0, sin |m| phi for m < 0), Y_l0 = N_l0 P_l(z), with
// N_lm = sqrt((2l + 1)/(4 pi) (l - m)!/(l + m)!) and the Condon-Shortley phase (-1)^m inside P_l^m. Index l (l + 1) +
// m, the order and the signs of common practice. Orthonormal over the unit sphere.
#pragma once

#include "octrad/base/vec.h"

namespace octrad {

inline constexpr int kSphericalHarmonics = 16;

// w: unit direction. out[i * stride], i = 0 .. 15.
template <typename T>
OCTRAD_HD inline void spherical_harmonics(Vec3<T> w, T* out, int stride = 1) {
  const T x = w.x, y = w.y, z = w.z;
  const T xx = x * x, yy = y * y, zz = z * z, xy = x * y, yz = y * z, xz = x * z;
  const auto set = [&](int i, T value) { out[i * stride] = value; };
  set(0, T(0.28209479177387814));       // 1 / (2 sqrt(pi))
  set(1, T(-0.48860251190291992) * y);  // sqrt(3 / (4 pi))
  set(2, T(0.48860251190291992) * z);
  set(3, T(-0.48860251190291992) * x);
  set(4, T(1.0925484305920792) * xy);  // sqrt(15 / pi) / 2
  set(5, T(-1.0925484305920792) * yz);
  set(6, T(0.31539156525252001) * (T(3) * zz - T(1)));  // sqrt(5 / pi) / 4
  set(7, T(-1.0925484305920792) * xz);
  set(8, T(0.54627421529603959) * (xx - yy));                 // sqrt(15 / pi) / 4
  set(9, T(-0.59004358992664352) * y * (T(3) * xx - yy));     // sqrt(35 / (2 pi)) / 4
  set(10, T(2.8906114426405538) * xy * z);                    // sqrt(105 / pi) / 2
  set(11, T(-0.45704579946446577) * y * (T(5) * zz - T(1)));  // sqrt(21 / (2 pi)) / 4
  set(12, T(0.37317633259011540) * z * (T(5) * zz - T(3)));   // sqrt(7 / pi) / 4
  set(13, T(-0.45704579946446577) * x * (T(5) * zz - T(1)));
  set(14, T(1.4453057213202769) * z * (xx - yy));  // sqrt(105 / pi) / 4
  set(15, T(-0.59004358992664352) * x * (xx - T(3) * yy));
}

}  // namespace octrad
