// 4x4 transforms in double precision; points are columns, the leftmost matrix is applied last.
#pragma once

#include <array>
#include <optional>

#include "octrad/base/vec.h"

namespace octrad {

struct Transform {
  std::array<double, 16> m{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};  // row-major

  double operator()(int row, int column) const { return m[static_cast<std::size_t>(row * 4 + column)]; }
  double& operator()(int row, int column) { return m[static_cast<std::size_t>(row * 4 + column)]; }

  static Transform translate(Vec3d v);
  static Transform scale(Vec3d v);
  // Right-handed rotation about `axis` (any length but zero), in degrees.
  static Transform rotate(Vec3d axis, double degrees);
  // Camera to world: +z towards the target, +x = up x z. nullopt when the points or directions do not span a frame.
  static std::optional<Transform> look_at(Vec3d origin, Vec3d target, Vec3d up);

  Vec3d point(Vec3d p) const;  // affine part only
  Vec3d vector(Vec3d v) const;
  Vec3d column(int i) const { return {(*this)(0, i), (*this)(1, i), (*this)(2, i)}; }
  double determinant() const;  // of the linear part
  // Cofactor matrix of the linear part (row-major 3x3) times sign(det): carries normals, up to length.
  std::array<double, 9> normal_matrix() const;
  Transform inverse() const;  // of an affine one that is not singular
  bool is_affine() const;     // last row 0 0 0 1 and everything finite
  // Whether it is not affine, or flattens: its determinant is at most `least` times the cube of its longest column.
  bool is_singular(double least) const;
};

Transform operator*(const Transform& a, const Transform& b);

}  // namespace octrad
