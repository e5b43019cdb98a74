#include "octrad/scene/transform.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace octrad {

Transform Transform::translate(Vec3d v) {
  Transform t;
  t(0, 3) = v.x;
  t(1, 3) = v.y;
  t(2, 3) = v.z;
  return t;
}

Transform Transform::scale(Vec3d v) {
  Transform t;
  t(0, 0) = v.x;
  t(1, 1) = v.y;
  t(2, 2) = v.z;
  return t;
}

// Rodrigues' formula.
Transform Transform::rotate(Vec3d axis, double degrees) {
  const Vec3d a = normalize(axis);
  const double radians = degrees * (std::numbers::pi / 180.0);
  const double s = std::sin(radians), c = std::cos(radians), k = 1.0 - c;
  Transform t;
  t(0, 0) = c + a.x * a.x * k;
  t(0, 1) = a.x * a.y * k - a.z * s;
  t(0, 2) = a.x * a.z * k + a.y * s;
  t(1, 0) = a.y * a.x * k + a.z * s;
  t(1, 1) = c + a.y * a.y * k;
  t(1, 2) = a.y * a.z * k - a.x * s;
  t(2, 0) = a.z * a.x * k - a.y * s;
  t(2, 1) = a.z * a.y * k + a.x * s;
  t(2, 2) = c + a.z * a.z * k;
  return t;
}

std::optional<Transform> Transform::look_at(Vec3d origin, Vec3d target, Vec3d up) {
  const Vec3d forward = target - origin;
  const Vec3d left = cross(up, forward);
  if (!(length(forward) > 0.0) || !(length(left) > 1e-9 * length(up) * length(forward))) return std::nullopt;
  const Vec3d z = normalize(forward), x = normalize(left), y = cross(z, x);
  Transform t;
  for (int row = 0; row < 3; ++row) {
    t(row, 0) = x[row];
    t(row, 1) = y[row];
    t(row, 2) = z[row];
    t(row, 3) = origin[row];
  }
  return t;
}

Vec3d Transform::point(Vec3d p) const { return vector(p) + column(3); }

Vec3d Transform::vector(Vec3d v) const { return column(0) * v.x + column(1) * v.y + column(2) * v.z; }

double Transform::determinant() const { return dot(column(0), cross(column(1), column(2))); }

std::array<double, 9> Transform::normal_matrix() const {
  const double sign = determinant() < 0.0 ? -1.0 : 1.0;
  // Columns of the cofactor matrix are the cross products of the other two columns.
  const Vec3d x = cross(column(1), column(2)) * sign, y = cross(column(2), column(0)) * sign,
              z = cross(column(0), column(1)) * sign;
  return {x.x, y.x, z.x, x.y, y.y, z.y, x.z, y.z, z.z};
}

Transform Transform::inverse() const {
  Transform t;
  const double scale = determinant();
  for (int i = 0; i < 3; ++i) {
    const Vec3d row = cross(column((i + 1) % 3), column((i + 2) % 3)) / scale;
    for (int k = 0; k < 3; ++k) t(i, k) = row[k];
    t(i, 3) = -dot(row, column(3));
  }
  return t;
}

bool Transform::is_affine() const {
  for (double v : m) {
    if (!std::isfinite(v)) return false;
  }
  return m[12] == 0.0 && m[13] == 0.0 && m[14] == 0.0 && m[15] == 1.0;
}

bool Transform::is_singular(double least) const {
  const double scale = std::max({length(column(0)), length(column(1)), length(column(2))});
  return !is_affine() || !(std::fabs(determinant()) > least * scale * scale * scale);
}

Transform operator*(const Transform& a, const Transform& b) {
  Transform t;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) {
      double sum = 0.0;
      for (int k = 0; k < 4; ++k) sum += a(row, k) * b(k, column);
      t(row, column) = sum;
    }
  }
  return t;
}

}  // namespace octrad
