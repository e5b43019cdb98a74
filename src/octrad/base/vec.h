// Small vectors of float and double, usable on host and device.
#pragma once

#include <cmath>
#include <type_traits>

#include "octrad/base/hd.h"

namespace octrad {

inline constexpr float kPi = 3.14159265358979323846f;
inline constexpr float kInvPi = 0.31830988618379067154f;

// The smaller and the larger of two numbers, for inner loops: one instruction on host and device. `b` where `a` is NaN;
// `b` must not be NaN. Where both are zero, the sign of the result is unspecified: devices differ.
template <typename T>
OCTRAD_HD constexpr T lesser(T a, T b) {
#if defined(__CUDA_ARCH__)
  if constexpr (std::is_floating_point_v<T>) {
    if (!__builtin_is_constant_evaluated()) return ::fmin(a, b);
  }
#endif
  return a < b ? a : b;  // std::fmin is a call on the host
}
template <typename T>
OCTRAD_HD constexpr T greater(T a, T b) {
#if defined(__CUDA_ARCH__)
  if constexpr (std::is_floating_point_v<T>) {
    if (!__builtin_is_constant_evaluated()) return ::fmax(a, b);
  }
#endif
  return a > b ? a : b;
}

template <typename T>
struct Vec2 {
  T x{}, y{};
  OCTRAD_HD constexpr T operator[](int i) const { return i == 0 ? x : y; }
  OCTRAD_HD constexpr T& operator[](int i) { return i == 0 ? x : y; }
  OCTRAD_HD constexpr bool operator==(const Vec2& b) const { return x == b.x && y == b.y; }
};
template <typename T>
OCTRAD_HD constexpr Vec2<T> operator+(Vec2<T> a, Vec2<T> b) {
  return {a.x + b.x, a.y + b.y};
}
template <typename T>
OCTRAD_HD constexpr Vec2<T> operator-(Vec2<T> a, Vec2<T> b) {
  return {a.x - b.x, a.y - b.y};
}
template <typename T>
OCTRAD_HD constexpr Vec2<T> operator*(Vec2<T> a, T s) {
  return {a.x * s, a.y * s};
}
template <typename T>
OCTRAD_HD constexpr Vec2<T> operator*(T s, Vec2<T> a) {
  return a * s;
}

// Three numbers: a position, a direction or a linear RGB triple. Arithmetic is component-wise.
template <typename T>
struct Vec3 {
  T x{}, y{}, z{};
  constexpr Vec3() = default;
  OCTRAD_HD constexpr Vec3(T x_, T y_, T z_) : x(x_), y(y_), z(z_) {}
  OCTRAD_HD constexpr explicit Vec3(T s) : x(s), y(s), z(s) {}
  template <typename U>
  OCTRAD_HD constexpr explicit Vec3(const Vec3<U>& v)
      : x(static_cast<T>(v.x)),
        y(static_cast<T>(v.y)),
        z(static_cast<T>(v.z)) {}
  OCTRAD_HD constexpr T operator[](int i) const { return i == 0 ? x : (i == 1 ? y : z); }
  OCTRAD_HD constexpr T& operator[](int i) { return i == 0 ? x : (i == 1 ? y : z); }
  OCTRAD_HD constexpr bool operator==(const Vec3& b) const { return x == b.x && y == b.y && z == b.z; }
  OCTRAD_HD constexpr Vec3& operator+=(const Vec3& b) {
    x += b.x;
    y += b.y;
    z += b.z;
    return *this;
  }
  OCTRAD_HD constexpr Vec3& operator-=(const Vec3& b) {
    x -= b.x;
    y -= b.y;
    z -= b.z;
    return *this;
  }
  OCTRAD_HD constexpr Vec3& operator*=(const Vec3& b) {
    x *= b.x;
    y *= b.y;
    z *= b.z;
    return *this;
  }
  OCTRAD_HD constexpr Vec3& operator*=(T s) {
    x *= s;
    y *= s;
    z *= s;
    return *this;
  }
};
template <typename T>
OCTRAD_HD constexpr Vec3<T> operator+(Vec3<T> a, Vec3<T> b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <typename T>
OCTRAD_HD constexpr Vec3<T> operator-(Vec3<T> a, Vec3<T> b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <typename T>
OCTRAD_HD constexpr Vec3<T> operator-(Vec3<T> a) {
  return {-a.x, -a.y, -a.z};
}
template <typename T>
OCTRAD_HD constexpr Vec3<T> operator*(Vec3<T> a, Vec3<T> b) {
  return {a.x * b.x, a.y * b.y, a.z * b.z};
}
template <typename T>
OCTRAD_HD constexpr Vec3<T> operator/(Vec3<T> a, Vec3<T> b) {
  return {a.x / b.x, a.y / b.y, a.z / b.z};
}
template <typename T>
OCTRAD_HD constexpr Vec3<T> operator*(Vec3<T> a, T s) {
  return {a.x * s, a.y * s, a.z * s};
}
template <typename T>
OCTRAD_HD constexpr Vec3<T> operator*(T s, Vec3<T> a) {
  return a * s;
}
template <typename T>
OCTRAD_HD constexpr Vec3<T> operator/(Vec3<T> a, T s) {
  return {a.x / s, a.y / s, a.z / s};
}

template <typename T>
OCTRAD_HD constexpr T dot(Vec3<T> a, Vec3<T> b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <typename T>
OCTRAD_HD constexpr Vec3<T> cross(Vec3<T> a, Vec3<T> b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <typename T>
OCTRAD_HD inline T length(Vec3<T> a) {
  return std::sqrt(dot(a, a));
}
template <typename T>
OCTRAD_HD inline Vec3<T> normalize(Vec3<T> a) {
  return a / length(a);
}
template <typename T>
OCTRAD_HD constexpr T min_component(Vec3<T> a) {
  const T xy = a.x < a.y ? a.x : a.y;
  return xy < a.z ? xy : a.z;
}
template <typename T>
OCTRAD_HD constexpr T max_component(Vec3<T> a) {
  const T xy = a.x > a.y ? a.x : a.y;
  return xy > a.z ? xy : a.z;
}
template <typename T>
OCTRAD_HD constexpr Vec3<T> min(Vec3<T> a, Vec3<T> b) {
  return {a.x < b.x ? a.x : b.x, a.y < b.y ? a.y : b.y, a.z < b.z ? a.z : b.z};
}
template <typename T>
OCTRAD_HD constexpr Vec3<T> max(Vec3<T> a, Vec3<T> b) {
  return {a.x > b.x ? a.x : b.x, a.y > b.y ? a.y : b.y, a.z > b.z ? a.z : b.z};
}
template <typename T>
OCTRAD_HD constexpr T lerp(T a, T b, T t) {
  return a + (b - a) * t;
}

// 1 / b and a / b; on a device with the GPU's reciprocal, wrong by 2 units in the last place at most, for 1e-37 < |b| <
// 1e37.
template <typename T>
OCTRAD_HD inline T reciprocal(T b) {
#if defined(__CUDA_ARCH__)
  if constexpr (std::is_same_v<T, float>) {
    float r;
    asm("rcp.approx.ftz.f32 %0, %1;" : "=f"(r) : "f"(b));
    return r;
  }
#endif
  return T(1) / b;
}
template <typename T>
OCTRAD_HD inline T divide(T a, T b) {
#if defined(__CUDA_ARCH__)
  return a * reciprocal(b);
#else
  return a / b;
#endif
}
template <typename T>
OCTRAD_HD inline Vec3<T> divide(Vec3<T> a, Vec3<T> b) {
  return {divide(a.x, b.x), divide(a.y, b.y), divide(a.z, b.z)};
}

using Vec2f = Vec2<float>;
using Vec2i = Vec2<int>;
using Vec3f = Vec3<float>;
using Vec3d = Vec3<double>;
using Vec3i = Vec3<int>;

// Luminance of linear sRGB (Rec. 709 primaries).
OCTRAD_HD constexpr float luminance(Vec3f c) { return 0.212671f * c.x + 0.715160f * c.y + 0.072169f * c.z; }

OCTRAD_HD inline bool is_finite(Vec3f v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

// Mirror direction of `wo` about the unit normal `n`: 2 (wo.n) n - wo.
OCTRAD_HD constexpr Vec3f reflect(Vec3f wo, Vec3f n) { return n * (2.0f * dot(wo, n)) - wo; }

// Axis-aligned box. Empty until extended.
struct Bounds3f {
  Vec3f lower{1e30f, 1e30f, 1e30f}, upper{-1e30f, -1e30f, -1e30f};
  OCTRAD_HD void extend(Vec3f p) {
    lower = min(lower, p);
    upper = max(upper, p);
  }
  OCTRAD_HD void extend(const Bounds3f& b) {
    lower = min(lower, b.lower);
    upper = max(upper, b.upper);
  }
  OCTRAD_HD Vec3f extent() const { return upper - lower; }
  OCTRAD_HD Vec3f center() const { return (lower + upper) * 0.5f; }
  OCTRAD_HD bool empty() const { return lower.x > upper.x; }
};

}  // namespace octrad
