#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <map>

#include "octrad/base/each_target_test_helper.h"
#include "octrad/base/error.h"
#include "octrad/base/rng.h"
#include "octrad/encoding/octaoctree.h"
#include "octrad/encoding/octaoctree_math.h"
#include "octrad/encoding/shell_cells_test_helper.h"

namespace octrad {
namespace {

using testing::ShellScene;

const Vec3f kOrigin{-1.0f, 2.0f, 0.5f}, kSize{4.0f, 3.0f, 2.5f};  // not a cube: sizes per axis must not be mixed up

struct Fixture {
  explicit Fixture(OctaOctreeOptions options = {}, Vec3f size = kSize)
      : scene(3),
        tree(options, scene.cells(options.levels), kOrigin, size) {
    testing::fill_random(tree.features(), 7);
    tree.canonicalize_rims();
  }
  ShellScene scene;
  OctaOctree tree;
};

struct LookupQueries {
  std::vector<Vec3f> x, w;
  std::vector<float> d;
  int size() const { return static_cast<int>(x.size()); }
};

LookupQueries make_queries(const Fixture& fixture, int n, std::uint64_t seed) {
  LookupQueries q;
  Rng rng(seed, RngPurpose::test, 11);
  for (int i = 0; i < n; ++i) {
    q.x.push_back(fixture.tree.origin() + fixture.scene.point(rng) * fixture.tree.size());
    q.w.push_back(ShellScene::direction(rng));
    q.d.push_back(i % 4 == 0 ? 0.0f : 3.0f * rng.uniform());
  }
  return q;
}

// The query straight from the text of method sections 2 and 4, written apart from octaoctree_math.h: cells in a map,
// rim vertices read where they are (the table's duplicates are filled), triangles found by solving for barycentric
// coordinates.
std::vector<double> independent_query(const OctaOctree& tree, Vec3d x, Vec3d w, double d, double* least_coverage) {
  const int levels = tree.options().levels, features = tree.options().features;
  std::vector<double> result(static_cast<std::size_t>(levels * features), 0.0);
  *least_coverage = 1.0;
  for (int l = 1; l <= levels; ++l) {
    const int n = 1 << (l + 1), maps = levels - tree.options().fine, r = l <= maps ? 1 << (maps + 1 - l) : 0, h = r / 2;
    std::map<std::array<int, 3>, std::int64_t> number;
    if (const auto& cells = tree.cells(l); true) {
      for (std::size_t i = 0; i < cells.size(); ++i)
        number[{cells[i].x, cells[i].y, cells[i].z}] = static_cast<std::int64_t>(i);
    }
    double g[3], total = 0.0;
    for (int a = 0; a < 3; ++a) g[a] = (x[a] - tree.origin()[a]) / tree.size()[a] * n - 0.5;
    std::vector<double> sum(static_cast<std::size_t>(features), 0.0);
    for (int corner = 0; corner < 8; ++corner) {
      std::array<int, 3> cell;
      double weight = 1.0;
      Vec3d v;
      for (int a = 0; a < 3; ++a) {
        cell[a] = static_cast<int>(std::floor(g[a])) + ((corner >> a) & 1);
        weight *= std::max(0.0, 1.0 - std::abs(g[a] - cell[a]));
        const double center = tree.origin()[a] + (cell[a] + 0.5) * tree.size()[a] / n;
        v[a] = (x[a] - center) * d + w[a];
      }
      if (weight <= 0.0 || number.count(cell) == 0) continue;
      total += weight;
      if (r == 0) {  // the cell's one vector
        for (int f = 0; f < features; ++f)
          sum[f] +=
              weight * tree.features()[static_cast<std::size_t>((tree.level_offset(l) + number[cell]) * features + f)];
        continue;
      }
      const double norm = std::abs(v.x) + std::abs(v.y) + std::abs(v.z);
      double ux = v.x / norm, uy = v.y / norm;
      if (v.z < 0) {
        const double fx = (1 - std::abs(uy)) * (ux < 0 ? -1 : 1), fy = (1 - std::abs(ux)) * (uy < 0 ? -1 : 1);
        ux = fx, uy = fy;
      }
      const double px = ux * h, py = uy * h;
      const int i = std::clamp(static_cast<int>(std::floor(px)), -h, h - 1),
                j = std::clamp(static_cast<int>(std::floor(py)), -h, h - 1);
      // The diagonal is parallel to the edge |u| + |v| = 1 of the quadrant that the cell's centre is in.
      const bool falling = (i + 0.5) * (j + 0.5) > 0;
      const std::array<std::array<int, 2>, 4> corners{{{i, j}, {i + 1, j}, {i, j + 1}, {i + 1, j + 1}}};
      const std::array<int, 3> triangles[2] = {falling ? std::array{0, 1, 2} : std::array{0, 1, 3},
                                               falling ? std::array{1, 2, 3} : std::array{0, 2, 3}};
      bool found = false;
      for (const auto& triangle : triangles) {
        const auto &a = corners[triangle[0]], &b = corners[triangle[1]], &c = corners[triangle[2]];
        const double area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
        double bary[3];
        bary[1] = ((px - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (py - a[1])) / area;
        bary[2] = ((b[0] - a[0]) * (py - a[1]) - (px - a[0]) * (b[1] - a[1])) / area;
        bary[0] = 1.0 - bary[1] - bary[2];
        if (*std::min_element(bary, bary + 3) < -1e-12) continue;
        found = true;
        for (int k = 0; k < 3; ++k) {
          const auto& vertex = corners[triangle[k]];
          const std::int64_t entry =
              tree.level_offset(l) + number[cell] * (r + 1) * (r + 1) + (vertex[1] + h) * (r + 1) + vertex[0] + h;
          for (int f = 0; f < features; ++f)
            sum[f] += weight * bary[k] * tree.features()[static_cast<std::size_t>(entry * features + f)];
        }
        break;
      }
      EXPECT_TRUE(found);
    }
    *least_coverage = std::min(*least_coverage, total);
    for (int f = 0; f < features && total > 0; ++f)
      result[static_cast<std::size_t>((l - 1) * features + f)] = sum[f] / total;
  }
  return result;
}

TEST(OctaOctree, EntryCountsOfThePaper) {
  const std::int64_t bathroom[8] = {56, 314, 1585, 7118, 30690, 127314, 583036, 2471679};
  const auto total = [&](int levels) {
    std::int64_t sum = 0;
    for (int l = 1; l <= levels; ++l) sum += octree_entries(levels, l, bathroom[l - 1]);
    return sum;
  };
  EXPECT_EQ(total(8), 79'375'000);
  EXPECT_EQ(total(5), 734'275);
  EXPECT_EQ(total(6), 3'526'245);
  EXPECT_EQ(total(8) * 4 * 4 >> 20, 1211);  // MiB in fp32
  EXPECT_EQ(spatial_resolution(8), 512);
  EXPECT_EQ(octahedral_resolution(8, 1), 256);
  EXPECT_EQ(octahedral_resolution(8, 8), 2);
  // A fine level has one vector a cell.
  EXPECT_EQ(spatial_resolution(9), 1024);
  EXPECT_EQ(octahedral_resolution(8, 9), 0);
  EXPECT_EQ(octree_entries(6, std::vector<long long>(bathroom, bathroom + 7)), 3'526'245 + 583'036);
}

TEST(OctaOctree, Construction) {
  const Fixture f({.levels = 4, .features = 4});
  std::int64_t sum = 0;
  for (int l = 1; l <= 4; ++l) {
    EXPECT_EQ(f.tree.level_offset(l), sum);
    sum += octree_entries(4, l, static_cast<std::int64_t>(f.tree.cells(l).size()));
  }
  EXPECT_EQ(f.tree.entry_count(), sum);
  EXPECT_EQ(static_cast<std::int64_t>(f.tree.features().size()), sum * 4);
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(f.tree.features().data()) % 64, 0u);
  EXPECT_EQ(f.tree.feature_count(), 16);
  const OctaOctree fresh({.levels = 3}, f.scene.cells(3), kOrigin, kSize);
  EXPECT_TRUE(std::all_of(fresh.features().begin(), fresh.features().end(), [](float v) { return v == 0.0f; }));
}

TEST(OctaOctree, RefusesWhatItCannotUse) {
  const ShellScene scene(1);
  auto cells = scene.cells(3);
  const auto message = [&](OctaOctreeOptions options, const std::vector<std::vector<Vec3i>>& c,
                           Vec3f size = Vec3f(1.0f)) {
    try {
      OctaOctree tree(options, c, Vec3f(0.0f), size);
    } catch (const Error& e) {
      return std::string(e.what());
    }
    return std::string("accepted");
  };
  EXPECT_EQ(message({.levels = 3}, cells), "accepted");
  EXPECT_NE(message({.levels = 0}, {}).find("octree.levels is 0"), std::string::npos);
  EXPECT_NE(message({.levels = 10}, {}).find("1 to 9"), std::string::npos);
  EXPECT_NE(message({.levels = 3, .features = 3}, cells).find("octree.features is 3"), std::string::npos);
  EXPECT_NE(message({.levels = 2}, cells).find("was given the cells of 3"), std::string::npos);
  EXPECT_NE(message({.levels = 3}, cells, Vec3f{1, 0, 1}).find("positive size"), std::string::npos);
  EXPECT_NE(message({.levels = 3}, cells, Vec3f{1, NAN, 1}).find("finite"), std::string::npos);
  auto broken = cells;
  std::swap(broken[1][3], broken[1][4]);
  EXPECT_NE(message({.levels = 3}, broken).find("octree level 2: cell"), std::string::npos);
  EXPECT_NE(message({.levels = 3}, broken).find("Morton order"), std::string::npos);
  broken = cells;
  broken[2][1] = broken[2][0];
  EXPECT_NE(message({.levels = 3}, broken).find("occurs twice"), std::string::npos);
  broken = cells;
  broken[0].push_back({4, 0, 0});
  EXPECT_NE(message({.levels = 3}, broken).find("outside the grid of 4^3"), std::string::npos);
  broken[0].back() = {0, -1, 0};
  EXPECT_NE(message({.levels = 3}, broken).find("outside the grid"), std::string::npos);
  // More than 2^32 feature vectors: refused before anything else is looked at or allocated. A map of level 1 at K = 9
  // has 513^2.
  std::vector<std::vector<Vec3i>> huge(9);
  huge[0].assign(16400, Vec3i{0, 0, 0});
  try {
    OctaOctree tree({.levels = 9}, huge, Vec3f(0.0f), Vec3f(1.0f));
    FAIL();
  } catch (const MemoryError& e) {
    EXPECT_NE(std::string(e.what()).find("octree.levels"), std::string::npos);
  }
}

TEST(OctaOctree, IndexFindsExactlyTheGivenCells) {
  for (int levels : {1, 2, 3, 5}) {
    const ShellScene scene(2);
    const auto cells = scene.cells(levels).back();
    const int n = spatial_resolution(levels);
    const CellIndex index(cells, n, "level");
    std::map<std::array<int, 3>, std::uint32_t> expected;
    for (std::size_t i = 0; i < cells.size(); ++i)
      expected[{cells[i].x, cells[i].y, cells[i].z}] = static_cast<std::uint32_t>(i);
    for (int z = -1; z <= n; ++z) {
      for (int y = -1; y <= n; ++y) {
        for (int x = -1; x <= n; ++x) {
          const auto it = expected.find({x, y, z});
          ASSERT_EQ(index.view().find(x, y, z), it == expected.end() ? kNoCell : it->second)
              << x << ' ' << y << ' ' << z;
        }
      }
    }
  }
}

TEST(OctaOctree, DefinitionMatchesAnIndependentEvaluation) {
  for (int features : {2, 4}) {
    const Fixture f({.levels = 4, .features = features, .fine = features / 4});
    const LookupQueries q = make_queries(f, 150, 1);
    std::vector<double> value(static_cast<std::size_t>(f.tree.feature_count())), slope(value.size());
    for (int i = 0; i < q.size(); ++i) {
      double coverage;
      const std::vector<double> expected = independent_query(f.tree, Vec3d(q.x[i]), Vec3d(q.w[i]), q.d[i], &coverage);
      lookup_query(f.tree.view(), Vec3d(q.x[i]), Vec3d(q.w[i]), static_cast<double>(q.d[i]), value.data(),
                   slope.data());
      for (std::size_t k = 0; k < value.size(); ++k)
        EXPECT_NEAR(value[k], expected[k], 1e-9 / std::max(coverage, 1e-6)) << i << ' ' << k;
    }
  }
}

TEST(OctaOctree, CanonicalizeRims) {
  Fixture f({.levels = 4, .fine = 1});  // the vectors of the fine level stay
  testing::fill_random(f.tree.features(), 99);
  const std::vector<float> before(f.tree.features().begin(), f.tree.features().end());
  f.tree.canonicalize_rims();
  std::size_t changed = 0;
  for (int l = 1; l <= 4; ++l) {
    const int r = octahedral_resolution(3, l), h = r / 2;
    for (std::size_t c = 0; c < f.tree.cells(l).size(); ++c) {
      const std::size_t map =
          static_cast<std::size_t>(f.tree.level_offset(l)) + c * static_cast<std::size_t>((r + 1) * (r + 1));
      for (int j = -h; j <= h; ++j) {
        for (int i = -h; i <= h; ++i) {
          const OctaVertex<int> vertex{i, j}, a = octa_canonical(vertex, r / 2);
          const std::size_t own = (map + octa_vertex_index(vertex, octa_map<int>(r))) * 4,
                            canonical = (map + octa_vertex_index(a, octa_map<int>(r))) * 4;
          for (std::size_t k = 0; k < 4; ++k) {
            ASSERT_EQ(f.tree.features()[own + k], before[canonical + k]);
            changed += f.tree.features()[own + k] != before[own + k];
          }
        }
      }
    }
  }
  EXPECT_GT(changed, 0u);
}

TEST(OctaOctree, DerivativeMatchesDifferencesInDouble) {
  // The features are piecewise smooth in d: triangles that change between d - e and d + e are rare and left out.
  const Fixture f({.levels = 5});
  const LookupQueries q = make_queries(f, 400, 2);
  const int count = f.tree.feature_count();
  std::vector<double> value(static_cast<std::size_t>(count)), slope(value), lower(value), upper(value), scratch(value);
  int outliers = 0, compared = 0;
  for (int i = 0; i < q.size(); ++i) {
    const Vec3d x(q.x[i]), w(q.w[i]);
    const double d = q.d[i], e = 1e-6;
    lookup_query(f.tree.view(), x, w, d, value.data(), slope.data());
    lookup_query(f.tree.view(), x, w, d - e, lower.data(), scratch.data());
    lookup_query(f.tree.view(), x, w, d + e, upper.data(), scratch.data());
    for (int k = 0; k < count; ++k) {
      ++compared;
      const double numeric = (upper[k] - lower[k]) / (2 * e);
      if (std::abs(numeric - slope[k]) > 1e-6 * (1.0 + std::abs(slope[k]))) ++outliers;
    }
  }
  EXPECT_LT(outliers, compared / 500);
}

void check_against_definition(OctaOctreeOptions options, int n, int stride) {
  Fixture f(options);
  testing::fill_random(f.tree.features(), 17);  // rim duplicates hold other values: reading one would show
  const LookupQueries q = make_queries(f, n, 3);
  const int count = f.tree.feature_count();
  std::vector<float> out(static_cast<std::size_t>(count * stride), -7.0f), recorded(out);
  OctaOctree::Record record;
  const std::int64_t empty = f.tree.lookup(q.x.data(), q.w.data(), q.d.data(), n, out.data(), stride);
  EXPECT_EQ(f.tree.lookup_record(q.x.data(), q.w.data(), q.d.data(), n, recorded.data(), stride, record), empty);
  ASSERT_EQ(record.begin.size(), static_cast<std::size_t>(n * (options.levels + 1)));
  ASSERT_GE(record.derivative.size(), static_cast<std::size_t>((count - 1) * stride + n));
  EXPECT_EQ(record.begin.front(), 0u);
  EXPECT_EQ(record.begin.back(), record.taps.size());
  std::vector<double> value(static_cast<std::size_t>(count)), slope(value);
  int bad = 0, bad_slope = 0, compared = 0;
  std::int64_t expected_empty = 0;
  for (int i = 0; i < n; ++i) {
    lookup_query(f.tree.view(), Vec3d(q.x[i]), Vec3d(q.w[i]), static_cast<double>(q.d[i]), value.data(), slope.data());
    const Vec3d p = normalize_position(f.tree.view(), Vec3d(q.x[i]));
    for (int l = 0; l < options.levels; ++l) {
      const OctreeLevelView& level = f.tree.view().level[l];
      const CellStencil<double> stencil = cell_stencil(level, p, options.trilinear);
      expected_empty += stencil.count == 0;
      // Taps: weights sum to 1 where there is anything, and reproduce the output.
      const std::uint32_t begin = record.begin[static_cast<std::size_t>(i * (options.levels + 1) + l)];
      const std::uint32_t end = record.begin[static_cast<std::size_t>(i * (options.levels + 1) + l + 1)];
      ASSERT_LE(begin, end);
      ASSERT_LE(end, record.taps.size());
      std::vector<double> sum(static_cast<std::size_t>(options.features), 0.0);
      double weights = 0.0;
      for (std::uint32_t t = begin; t < end; ++t) {
        const Tap tap = record.taps[t];
        EXPECT_GT(tap.weight, 0.0f);
        weights += tap.weight;
        ASSERT_GE(tap.entry, f.tree.level_offset(l + 1));
        ASSERT_LT(tap.entry, l + 1 < options.levels ? f.tree.level_offset(l + 2) : f.tree.entry_count());
        const int r = level.octahedral_resolution;
        const int vertex = static_cast<int>((tap.entry - f.tree.level_offset(l + 1)) % ((r + 1) * (r + 1)));
        const OctaVertex<int> canonical =
            octa_canonical<int>({vertex % (r + 1) - r / 2, vertex / (r + 1) - r / 2}, r / 2);
        EXPECT_EQ(octa_vertex_index(canonical, octa_map<int>(r)), static_cast<std::uint32_t>(vertex))
            << "a rim duplicate was named";
        for (int c = 0; c < options.features; ++c)
          sum[c] += double(tap.weight) * f.tree.features()[std::size_t{tap.entry} * options.features + c];
      }
      EXPECT_NEAR(weights, stencil.count > 0 ? 1.0 : 0.0, 2e-6);
      // Where the occupied cells have almost no weight before renormalisation, rounding decides; look at the others.
      double coverage = 0.0;
      for (int corner = 0; corner < 8; ++corner) {
        double weight = 1.0;
        const Vec3d g = p * double(level.spatial_resolution) - Vec3d(0.5);
        const Vec3i base{int(std::floor(g.x)), int(std::floor(g.y)), int(std::floor(g.z))};
        for (int a = 0; a < 3; ++a) {
          const double fraction = g[a] - base[a], high = options.trilinear ? fraction : double(fraction >= 0.5);
          weight *= ((corner >> a) & 1) != 0 ? high : 1 - high;
        }
        if (level.index.find(base.x + (corner & 1), base.y + (corner >> 1 & 1), base.z + (corner >> 2 & 1)) != kNoCell)
          coverage += weight;
      }
      for (int c = 0; c < options.features; ++c) {
        const std::size_t k = static_cast<std::size_t>(l * options.features + c),
                          at = k * static_cast<std::size_t>(stride) + static_cast<std::size_t>(i);
        EXPECT_NEAR(out[at], recorded[at], 1e-5);
        EXPECT_NEAR(sum[c], recorded[at], 4e-6);
        ++compared;
        if (coverage > 0.02 || stencil.count == 0) {
          bad += !(std::abs(out[at] - value[k]) < 2e-4);
          bad_slope += !(std::abs(record.derivative[at] - slope[k]) < 1e-3 * (1.0 + std::abs(slope[k])));
        }
      }
    }
  }
  EXPECT_EQ(empty, expected_empty);
  // Interpolated values are continuous: every one must agree. Nearest neighbours and slopes jump where float and double
  // fall on two sides of a border.
  EXPECT_LE(bad, options.trilinear && options.barycentric ? 0 : compared / 200);
  EXPECT_LE(bad_slope, compared / 200);
  for (int k = 0; k < count; ++k) {
    for (int i = n; i < stride; ++i) EXPECT_EQ(out[static_cast<std::size_t>(k * stride + i)], -7.0f) << "wrote past n";
  }
}

TEST(OctaOctree, EverySimdTargetMatchesTheDefinition) {
  testing::for_each_simd_target([] {
    check_against_definition({.levels = 5, .features = 4}, 1000, 1000);
    check_against_definition({.levels = 6, .features = 4}, 333, 340);
    check_against_definition({.levels = 3, .features = 2}, 261, 300);
    check_against_definition({.levels = 4, .features = 8}, 517, 517);
    check_against_definition({.levels = 1, .features = 4}, 40, 41);
    check_against_definition({.levels = 5, .features = 4, .trilinear = false}, 500, 500);
    check_against_definition({.levels = 5, .features = 4, .barycentric = false}, 500, 512);
    check_against_definition({.levels = 4, .features = 8, .trilinear = false, .barycentric = false}, 500, 500);
    check_against_definition({.levels = 5, .features = 4, .fine = 1}, 500, 500);
    check_against_definition({.levels = 5, .features = 2, .fine = 3}, 333, 340);
    check_against_definition({.levels = 4, .features = 8, .trilinear = false, .barycentric = false, .fine = 2}, 200,
                             200);
  });
}

TEST(OctaOctree, PartitionOfUnity) {
  testing::for_each_simd_target([] {
    Fixture f({.levels = 5});
    std::fill(f.tree.features().begin(), f.tree.features().end(), 0.625f);
    const LookupQueries q = make_queries(f, 700, 4);
    std::vector<float> out(static_cast<std::size_t>(f.tree.feature_count() * q.size()));
    EXPECT_EQ(f.tree.lookup(q.x.data(), q.w.data(), q.d.data(), q.size(), out.data(), q.size()), 0);
    for (float v : out) EXPECT_NEAR(v, 0.625f, 1e-6f);
  });
}

TEST(OctaOctree, OnlyOccupiedCellsAreRead) {
  // One occupied cell: inside its reach the answer is its map alone, whatever the trilinear weight; beyond, zero and
  // counted.
  testing::for_each_simd_target([] {
    OctaOctree tree({.levels = 2}, {{{1, 1, 1}}, {{2, 3, 2}}}, Vec3f(0.0f), Vec3f(8.0f));
    for (std::size_t i = 0; i < tree.features().size(); ++i)
      tree.features()[i] = i < static_cast<std::size_t>(tree.level_offset(2) * 4) ? 1.0f : 2.0f;
    // Level 2: cells of edge 1, centre (2.5, 3.5, 2.5). Level 1: edge 2, centre (3, 3, 3).
    const Vec3f x[6] = {{2.5f, 3.5f, 2.5f}, {3.4f, 3.6f, 2.2f}, {3.5f, 3.5f, 2.5f},
                        {1.0f, 3.0f, 3.0f}, {7.9f, 7.9f, 7.9f}, {-5.0f, 3.0f, 3.0f}};
    const float level1[6] = {1, 1, 1, 0, 0, 0}, level2[6] = {2, 2, 0, 0, 0, 0};
    const std::vector<Vec3f> w(6, Vec3f{0, 0, 1});
    const std::vector<float> d(6, 0.5f);
    std::vector<float> out(8 * 6);
    EXPECT_EQ(tree.lookup(x, w.data(), d.data(), 6, out.data(), 6), 7);
    for (int i = 0; i < 6; ++i) {
      for (int c = 0; c < 4; ++c) {
        EXPECT_NEAR(out[static_cast<std::size_t>(c * 6 + i)], level1[i], 1e-6f) << i;
        EXPECT_NEAR(out[static_cast<std::size_t>((4 + c) * 6 + i)], level2[i], 1e-6f) << i;
      }
    }
    // Nothing occupied at all, and nothing asked.
    const OctaOctree none({.levels = 2}, {{}, {}}, Vec3f(0.0f), Vec3f(8.0f));
    EXPECT_EQ(none.lookup(x, w.data(), d.data(), 6, out.data(), 6), 12);
    EXPECT_TRUE(std::all_of(out.begin(), out.end(), [](float v) { return v == 0.0f; }));
    EXPECT_EQ(none.lookup(nullptr, nullptr, nullptr, 0, nullptr, 0), 0);
  });
}

TEST(OctaOctree, OutsideTheDomainIsLookedUpAtItsNearestPlace) {
  testing::for_each_simd_target([] {
    Fixture f({.levels = 4});
    const Vec3f low = f.tree.origin(), high = low + f.tree.size();
    LookupQueries q = make_queries(f, 300, 5), inside = q;
    int moved = 0;
    for (int i = 0; i < q.size(); ++i) {
      const auto k = static_cast<std::size_t>(i);
      const int axis = i % 3;
      // Onto a face of the domain, and on from there.
      const float face = i % 2 == 0 ? low[axis] : high[axis], away = (i % 2 == 0 ? -1.0f : 1.0f) * f.tree.size()[axis];
      inside.x[k][axis] = face;
      q.x[k][axis] = face + away * (i % 5 == 0 ? 0.01f : 50.0f);
      moved += q.x[k] == inside.x[k] ? 0 : 1;
    }
    EXPECT_EQ(moved, 300);
    const auto rows = static_cast<std::size_t>(f.tree.feature_count() * q.size());
    std::vector<float> a(rows), b(rows);
    EXPECT_EQ(f.tree.lookup(q.x.data(), q.w.data(), q.d.data(), 300, a.data(), 300),
              f.tree.lookup(inside.x.data(), q.w.data(), q.d.data(), 300, b.data(), 300));
    float most = 0.0f;
    for (std::size_t i = 0; i < rows; ++i) {
      EXPECT_NEAR(a[i], b[i], 1e-4f);
      most = std::max(most, std::abs(a[i]));
    }
    EXPECT_GT(most, 0.1f);
  });
}

TEST(OctaOctree, WhatIsNotANumberIsHarmless) {
  testing::for_each_simd_target([] {
    const Fixture f({.levels = 4});
    const float nan = std::nanf(""), inf = std::numeric_limits<float>::infinity();
    const float odd[] = {nan, inf, -inf, 3e38f, -3e38f, 1e9f, -1e9f, 0.0f, -0.0f, 1e-42f};
    Rng rng(5, RngPurpose::test, 5);
    LookupQueries q = make_queries(f, 600, 6);
    std::vector<bool> bad_x(600, false), plain(600, false);
    for (int i = 0; i < q.size(); ++i) {
      const float v = odd[rng.below(10)];
      const int what = i % 4, axis = static_cast<int>(rng.below(3));
      if (what == 0) q.x[static_cast<std::size_t>(i)][axis] = v, bad_x[static_cast<std::size_t>(i)] = std::isnan(v);
      if (what == 1) q.w[static_cast<std::size_t>(i)][axis] = v;
      if (what == 2) q.d[static_cast<std::size_t>(i)] = v;
      plain[static_cast<std::size_t>(i)] = what == 3;
    }
    std::vector<float> out(static_cast<std::size_t>(f.tree.feature_count() * 600)), again(out);
    OctaOctree::Record record;
    f.tree.lookup(q.x.data(), q.w.data(), q.d.data(), 600, out.data(), 600);
    f.tree.lookup_record(q.x.data(), q.w.data(), q.d.data(), 600, again.data(), 600, record);
    for (const Tap& tap : record.taps) ASSERT_LT(tap.entry, f.tree.entry_count());
    for (int i = 0; i < 600; ++i) {
      for (int k = 0; k < f.tree.feature_count(); ++k) {
        const float v = out[static_cast<std::size_t>(k * 600 + i)];
        if (bad_x[static_cast<std::size_t>(i)]) {
          EXPECT_EQ(v, 0.0f);
        }
        if (i % 4 == 0) {
          EXPECT_LE(std::abs(v), 1.0f) << "an infinite position is one far outside";
        }
        if (plain[static_cast<std::size_t>(i)]) {
          EXPECT_LE(std::abs(v), 1.0f) << "a neighbour's NaN leaked";
        }
      }
    }
  });
}

TEST(OctaOctree, ResultDoesNotDependOnThePlaceInTheBatch) {
  testing::for_each_simd_target([] {
    const Fixture f({.levels = 5});
    const LookupQueries q = make_queries(f, 700, 8);
    const int count = f.tree.feature_count();
    std::vector<float> all(static_cast<std::size_t>(count * 700)), part(all), recorded(all);
    OctaOctree::Record record, single;
    f.tree.lookup(q.x.data(), q.w.data(), q.d.data(), 700, all.data(), 700);
    f.tree.lookup_record(q.x.data(), q.w.data(), q.d.data(), 700, recorded.data(), 700, record);
    for (const auto& [first, n] : {std::pair{0, 1}, {1, 5}, {13, 37}, {255, 300}, {699, 1}}) {
      f.tree.lookup(q.x.data() + first, q.w.data() + first, q.d.data() + first, n, part.data(), 700);
      for (int k = 0; k < count; ++k) {
        for (int i = 0; i < n; ++i)
          ASSERT_EQ(part[static_cast<std::size_t>(k * 700 + i)], all[static_cast<std::size_t>(k * 700 + first + i)]);
      }
      f.tree.lookup_record(q.x.data() + first, q.w.data() + first, q.d.data() + first, n, part.data(), n, single);
      for (int k = 0; k < count; ++k) {
        for (int i = 0; i < n; ++i) {
          ASSERT_EQ(part[static_cast<std::size_t>(k * n + i)], recorded[static_cast<std::size_t>(k * 700 + first + i)]);
          ASSERT_EQ(single.derivative[static_cast<std::size_t>(k * n + i)],
                    record.derivative[static_cast<std::size_t>(k * 700 + first + i)]);
        }
      }
      const std::uint32_t begin = record.begin[static_cast<std::size_t>(first * 6)];
      ASSERT_EQ(single.taps.size(), record.begin[static_cast<std::size_t>((first + n) * 6 - 1)] - begin);
      EXPECT_EQ(std::memcmp(single.taps.data(), record.taps.data() + begin, single.taps.size() * sizeof(Tap)), 0);
    }
  });
}

}  // namespace
}  // namespace octrad
