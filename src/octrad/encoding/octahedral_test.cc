#include <gtest/gtest.h>

#include <map>
#include <set>

#include "octrad/base/rng.h"
#include "octrad/encoding/octahedral_math.h"
#include "octrad/encoding/shell_cells_test_helper.h"

namespace octrad {
namespace {

// Direction (unit length) of a point of the square; the inverse of octa_project.
Vec3d octa_unproject(Vec2<double> u) {
  Vec3d v{u.x, u.y, 1.0 - std::abs(u.x) - std::abs(u.y)};
  if (v.z < 0.0) {
    v.x = (1.0 - std::abs(u.y)) * octa_sign(u.x);
    v.y = (1.0 - std::abs(u.x)) * octa_sign(u.y);
  }
  return normalize(v);
}

using testing::ShellScene;

// Weight of every stored vertex for a direction.
std::map<int, double> vertex_weights(Vec3d v, int resolution) {
  const OctaTriangle<double> t = octa_triangle(octa_project(v).u, octa_map<double>(resolution));
  std::map<int, double> weights;
  for (int k = 0; k < 3; ++k) weights[octa_vertex_index(t.vertex[k], octa_map<double>(resolution))] += t.weight[k];
  return weights;
}

double difference(const std::map<int, double>& a, const std::map<int, double>& b) {
  double sum = 0.0;
  for (const auto& [i, w] : a) sum += std::abs(w - (b.count(i) ? b.at(i) : 0.0));
  for (const auto& [i, w] : b) sum += a.count(i) ? 0.0 : std::abs(w);
  return sum;
}

TEST(Octahedral, AxesLandOnTheirVertices) {
  const auto at = [](Vec3d v) { return octa_project(v).u; };
  EXPECT_EQ(at({0, 0, 1}), (Vec2<double>{0, 0}));
  EXPECT_EQ(at({1, 0, 0}), (Vec2<double>{1, 0}));
  EXPECT_EQ(at({0, -3, 0}), (Vec2<double>{0, -1}));
  // sign(0) = +1: with 0 the pole would land on the centre, which is +z.
  EXPECT_EQ(at({0, 0, -1}), (Vec2<double>{1, 1}));
  EXPECT_EQ(at({0.0, 0.5, -0.5}), (Vec2<double>{0.5, 1}));
  EXPECT_EQ(at({-0.0, -0.5, -0.5}), (Vec2<double>{0.5, -1}));
  EXPECT_EQ(at({0, 0, 0}), (Vec2<double>{0, 0}));
}

TEST(Octahedral, UnprojectInverts) {
  Rng rng(1, RngPurpose::test, 1);
  for (int n = 0; n < 2000; ++n) {
    const Vec3d v = normalize(Vec3d(ShellScene::direction(rng)));
    EXPECT_LT(length(octa_unproject(octa_project(v * (0.1 + rng.uniform())).u) - v), 1e-12);
  }
}

TEST(Octahedral, RimRemapsAreTheSameDirection) {
  for (int resolution : {2, 4, 16, 64}) {
    const int h = resolution / 2;
    std::set<int> distinct;
    for (int j = -h; j <= h; ++j) {
      for (int i = -h; i <= h; ++i) {
        const OctaVertex<int> c = octa_canonical<int>({i, j}, resolution / 2);
        distinct.insert(octa_vertex_index(c, octa_map<int>(resolution)));
        const Vec3d a = octa_unproject(Vec2<double>{double(i) / h, double(j) / h});
        const Vec3d b = octa_unproject(Vec2<double>{double(c.i) / h, double(c.j) / h});
        EXPECT_LT(length(a - b), 1e-14) << i << ' ' << j;
        const OctaVertex<int> again = octa_canonical(c, resolution / 2);
        EXPECT_TRUE(again.i == c.i && again.j == c.j);
        if (std::abs(i) < h && std::abs(j) < h) {
          EXPECT_TRUE(c.i == i && c.j == j);
        }
      }
    }
    // Euler: an octahedron whose faces are cut into (R/2)^2 triangles has R^2 + 2 vertices.
    EXPECT_EQ(static_cast<int>(distinct.size()), resolution * resolution + 2);
  }
}

TEST(Octahedral, EveryVertexIsReachedAndOnlyCanonicalOnes) {
  for (int resolution : {2, 4, 8}) {
    const int h = resolution / 2;
    std::set<int> seen;
    for (int j = -h; j <= h; ++j) {
      for (int i = -h; i <= h; ++i) {
        const Vec3d v = octa_unproject(Vec2<double>{double(i) / h, double(j) / h});
        int heavy = 0;
        for (const auto& [index, weight] : vertex_weights(v, resolution)) {
          if (weight > 1.0 - 1e-12) {
            ++heavy;
            seen.insert(index);
          }
        }
        EXPECT_EQ(heavy, 1);
      }
    }
    Rng rng(2, RngPurpose::test, 2);
    for (int n = 0; n < 5000; ++n) {
      for (const auto& [index, weight] : vertex_weights(Vec3d(ShellScene::direction(rng)), resolution))
        seen.insert(index);
    }
    EXPECT_EQ(static_cast<int>(seen.size()), resolution * resolution + 2);
  }
}

template <typename T>
void check_weights() {
  Rng rng(3, RngPurpose::test, 3);
  for (int n = 0; n < 20000; ++n) {
    const int resolution = 2 << (n % 8);
    Vec3f v = ShellScene::direction(rng);
    if (n % 3 == 0) v[n / 3 % 3] = 0.0f;  // edges of the octahedron
    if (n % 7 == 0) v = v * 1e-8f;
    if (n % 11 == 0) v = v * 1e20f;
    const OctaTriangle<T> t = octa_triangle(octa_project(Vec3<T>(v)).u, octa_map<T>(resolution));
    T sum = 0;
    for (int k = 0; k < 3; ++k) {
      EXPECT_GE(t.weight[k], T(0));
      sum += t.weight[k];
      EXPECT_LE(std::abs(t.vertex[k].i), resolution / 2);
      EXPECT_LE(std::abs(t.vertex[k].j), resolution / 2);
    }
    EXPECT_NEAR(sum, T(1), T(4) * std::numeric_limits<T>::epsilon());
    for (const Vec2<T> velocity : {Vec2<T>{T(1), T(0)}, Vec2<T>{T(0), T(1)}, Vec2<T>{T(-0.5), T(2)}}) {
      T slope[3];
      t.slopes(velocity, slope);
      EXPECT_EQ(slope[0] + slope[1] + slope[2], T(0));
    }
  }
}
TEST(Octahedral, WeightsAreAPartitionOfUnity) {
  check_weights<float>();
  check_weights<double>();
}

TEST(Octahedral, ContinuousEverywhere) {
  // Two directions an angle of 1e-7 apart differ by at most about R 1e-7 in every weight: seams, rim, axes and all.
  Rng rng(4, RngPurpose::test, 4);
  const double step = 1e-7;
  for (int resolution : {2, 8, 64}) {
    for (int n = 0; n < 20000; ++n) {
      Vec3d v = normalize(Vec3d(ShellScene::direction(rng)));
      const int special = n % 5;
      if (special == 1) v[static_cast<int>(rng.below(3))] = 0.0;  // faces meet
      if (special == 2) {
        v = Vec3d(0.0);
        v[static_cast<int>(rng.below(3))] = n % 2 ? 1.0 : -1.0;
      }                                                            // axes
      if (special == 3) v.z = -std::abs(v.z), v[n / 5 % 2] = 0.0;  // rim of the square
      if (special == 4) {                                          // borders of cells
        const OctaProjection<double> r = octa_project(v);
        v = octa_unproject(Vec2<double>{std::round(r.u.x * resolution / 2) / (resolution / 2.0), r.u.y});
      }
      v = normalize(v);
      const Vec3d a = v + Vec3d(ShellScene::direction(rng)) * step, b = v - Vec3d(ShellScene::direction(rng)) * step;
      EXPECT_LT(difference(vertex_weights(a, resolution), vertex_weights(b, resolution)), 40.0 * resolution * step);
      EXPECT_LT(difference(vertex_weights(v, resolution), vertex_weights(b, resolution)), 40.0 * resolution * step);
    }
  }
}

TEST(Octahedral, ReproducesLinearFunctionsInAFace) {
  // Inside a face of the octahedron the map is affine in u, so a function linear in u within the face is reproduced
  // exactly; p = v / |v|_1 is one such (of another linear form in each of the eight faces).
  Rng rng(5, RngPurpose::test, 5);
  for (int n = 0; n < 20000; ++n) {
    const int resolution = 2 << (n % 7), h = resolution / 2;
    const Vec3d v = Vec3d(ShellScene::direction(rng));
    const OctaProjection<double> r = octa_project(v);
    const OctaTriangle<double> t = octa_triangle(r.u, octa_map<double>(resolution));
    Vec3d sum;
    for (int k = 0; k < 3; ++k) {
      Vec3d q = octa_unproject(Vec2<double>{double(t.vertex[k].i) / h, double(t.vertex[k].j) / h});
      q = q / (std::abs(q.x) + std::abs(q.y) + std::abs(q.z));
      sum += q * t.weight[k];
    }
    EXPECT_LT(length(sum - r.p), 1e-13) << v.x << ' ' << v.y << ' ' << v.z << " R " << resolution;
  }
}

TEST(Octahedral, NearestVertexIsTheNearest) {
  Rng rng(6, RngPurpose::test, 6);
  for (int n = 0; n < 5000; ++n) {
    const int resolution = 2 << (n % 4), h = resolution / 2;
    const Vec2<double> u = octa_project(Vec3d(ShellScene::direction(rng))).u;
    double best = 1e9;
    OctaVertex<double> expected{};
    for (int j = -h; j <= h; ++j) {
      for (int i = -h; i <= h; ++i) {
        const double distance = length(Vec3d(u.x * h - i, u.y * h - j, 0.0));
        if (distance < best) best = distance, expected = octa_canonical<double>({double(i), double(j)}, h);
      }
    }
    const OctaVertex<double> a = octa_nearest(u, octa_map<double>(resolution));
    EXPECT_TRUE(a.i == expected.i && a.j == expected.j);
  }
}

TEST(Octahedral, VelocityMatchesDifferences) {
  Rng rng(7, RngPurpose::test, 7);
  int checked = 0;
  for (int n = 0; n < 5000; ++n) {
    const Vec3d v = Vec3d(ShellScene::direction(rng)), delta = Vec3d(ShellScene::direction(rng));
    const double e = 1e-6;
    const Vec3d lower = v - delta * e, upper = v + delta * e;
    if (lower.x * upper.x < 0 || lower.y * upper.y < 0 || lower.z * upper.z < 0) continue;  // crosses an edge
    const Vec2<double> numeric = (octa_project(upper).u - octa_project(lower).u) * (0.5 / e);
    const Vec2<double> analytic = octa_velocity(octa_project(v), v, delta);
    EXPECT_NEAR(analytic.x, numeric.x, 1e-7);
    EXPECT_NEAR(analytic.y, numeric.y, 1e-7);
    ++checked;
  }
  EXPECT_GT(checked, 4900);
}

TEST(Octahedral, NotANumberStaysInsideTheMap) {
  const float nan = std::nanf(""), inf = INFINITY;
  for (Vec3f v : {Vec3f{nan, 0, 0}, Vec3f{0, nan, 1}, Vec3f{inf, 0, 0}, Vec3f{-inf, inf, -inf}, Vec3f{nan, nan, nan},
                  Vec3f{3e38f, 3e38f, -3e38f}}) {
    const OctaTriangle<float> t = octa_triangle(octa_project(v).u, octa_map<float>(8));
    const OctaVertex<float> near = octa_nearest(octa_project(v).u, octa_map<float>(8));
    for (OctaVertex<float> a : {t.vertex[0], t.vertex[1], t.vertex[2], near}) {
      EXPECT_LE(std::abs(a.i), 4);
      EXPECT_LE(std::abs(a.j), 4);
    }
  }
}

}  // namespace
}  // namespace octrad
