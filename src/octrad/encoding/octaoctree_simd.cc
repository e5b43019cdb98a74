// Level-major blocks in two stages. The address stage works on as many queries as a vector has lanes: stencil, cell
// numbers (scalar loads), parallax, octahedral triangles; it writes entries and weights and prefetches. One step later
// the gather stage sums feature vectors, query by query, while the next step's cache lines are being fetched.
#include "octrad/encoding/octaoctree_simd.h"

#include <hwy/cache_control.h>

#include <algorithm>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "octrad/encoding/octaoctree_simd.cc"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "octrad/encoding/feature_rows-inl.h"

#ifndef OCTRAD_ENCODING_OCTAOCTREE_SIMD_ONCE
#define OCTRAD_ENCODING_OCTAOCTREE_SIMD_ONCE
namespace octrad {
namespace {

constexpr int kMaxLanes = 16;  // most queries in a step
constexpr int kBlock = 256;    // queries processed level by level
constexpr int kCorners = 8;

// A block's inputs, one array a component. Lanes beyond the batch hold positions that are not a number: no cell counts.
struct QueryBlock {
  alignas(64) float p[3][kBlock + kMaxLanes];  // position normalised to the domain
  alignas(64) float w[3][kBlock + kMaxLanes];
  alignas(64) float d[kBlock + kMaxLanes];
};

// Output of the address stage and input of the gather stage, for one level and one step.
struct StepTaps {
  alignas(64) std::uint32_t entry[kCorners][3][kMaxLanes];
  alignas(64) float weight[kCorners][3][kMaxLanes];
  alignas(64) float slope[kCorners][3][kMaxLanes];  // weight's derivative by the disparity (record only)
  alignas(64) std::uint32_t corners[kMaxLanes];     // bit j: corner j's cell counts
  int vertices;                                     // of each corner
};

void load_block(const OctaOctreeView& view, const Vec3f* x, const Vec3f* w, const float* d, int n, QueryBlock& block) {
  for (int i = 0; i < n; ++i) {
    const Vec3f p = normalize_position(view, x[i]);
    for (int a = 0; a < 3; ++a) {
      block.p[a][i] = p[a];
      block.w[a][i] = w[i][a];
    }
    block.d[i] = d[i];
  }
  for (int i = n; i < n + kMaxLanes; ++i) {
    for (int a = 0; a < 3; ++a) {
      block.p[a][i] = std::numeric_limits<float>::quiet_NaN();
      block.w[a][i] = 0.0f;
    }
    block.d[i] = 0.0f;
  }
}

}  // namespace
}  // namespace octrad
#endif

HWY_BEFORE_NAMESPACE();
namespace octrad {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// One axis of the stencil, lower and upper cell.
struct Axis {
  VF weight[2];
  VF offset[2];  // x - c_j
  VF v[2];       // parallax direction; never -0
  VU code[2];    // contribution to brick and place in brick
};

HWY_INLINE Axis make_axis(const OctreeLevelView& level, int axis, bool trilinear, VF p, VF w, VF d) {
  const F f;
  const I di;
  const U du;
  const VF zero = hn::Zero(f), one = hn::Set(f, 1.0f);
  const VF resolution = hn::Set(f, static_cast<float>(level.spatial_resolution));
  Axis r;
  const VF g = hn::Sub(hn::Mul(p, resolution), hn::Set(f, 0.5f));
  const VF last = hn::Sub(resolution, one);
  // A position outside the grid, or NaN, is moved to two cells below it, where no corner is inside.
  const auto inside = hn::And(hn::Ge(g, hn::Neg(one)), hn::Le(g, resolution));
  const VF base = hn::IfThenElse(inside, hn::Floor(g), hn::Set(f, -2.0f));
  const VF fraction = hn::IfThenElseZero(inside, hn::Sub(g, base));
  const VF high = trilinear ? fraction : hn::IfThenElseZero(hn::Ge(fraction, hn::Set(f, 0.5f)), one);
  r.weight[0] = hn::IfThenElseZero(hn::And(hn::Ge(base, zero), hn::Le(base, last)), hn::Sub(one, high));
  r.weight[1] = hn::IfThenElseZero(hn::And(hn::Ge(base, hn::Neg(one)), hn::Lt(base, last)), high);
  const VF edge = hn::Set(f, level.cell_size[axis]);
  r.offset[0] = hn::Mul(fraction, edge);
  r.offset[1] = hn::Mul(hn::Sub(fraction, one), edge);
  const std::uint32_t stride = axis == 0 ? 1u
                                         : (axis == 1 ? 1u : static_cast<std::uint32_t>(level.index.bricks_per_axis)) *
                                               static_cast<std::uint32_t>(level.index.bricks_per_axis);
  const VI cell = hn::ConvertTo(di, base), limit = hn::Set(di, level.spatial_resolution - 1);
  for (int o = 0; o < 2; ++o) {
    r.v[o] = hn::Add(hn::MulAdd(r.offset[o], d, w), zero);  // + 0 turns -0 into +0: sign(0) = +1
    const VU c = hn::BitCast(du, hn::Min(hn::Max(hn::Add(cell, hn::Set(di, o)), hn::Zero(di)), limit));
    const VU inner = hn::Or(hn::And(c, hn::Set(du, 1u)), hn::Or(hn::ShiftLeft<2>(hn::And(c, hn::Set(du, 2u))),
                                                                hn::ShiftLeft<4>(hn::And(c, hn::Set(du, 4u)))));
    const VU brick = hn::Mul(hn::ShiftRight<3>(c), hn::Set(du, stride << 9));
    r.code[o] = hn::Add(brick, hn::ShiftLeftSame(inner, axis));
  }
  return r;
}

// Numbers of the cells with the given codes (brick << 9 | place in brick); all bits set: empty.
HWY_NOINLINE void find_cells(const CellIndexView& index, const std::uint32_t* HWY_RESTRICT code,
                             std::uint32_t* HWY_RESTRICT cell, int count) {
  const std::uint32_t* HWY_RESTRICT top = index.top;
  const CellOctant* HWY_RESTRICT octants = index.octants;
  for (int i = 0; i < count; ++i) {
    const std::uint32_t c = code[i];
    const CellOctant& octant = octants[top[c >> 9] * std::size_t{8} + (c >> 6 & 7)];
    const std::uint64_t shifted = octant.mask >> (c & 63);
    const std::uint64_t below = octant.mask & ~(~std::uint64_t{0} << (c & 63));
    const std::uint32_t occupied = static_cast<std::uint32_t>(shifted & 1);
    cell[i] = (octant.first + static_cast<std::uint32_t>(__builtin_popcountll(below))) | (occupied - 1u);
  }
}

// Stencil, cells and triangles of one step of queries. Returns a mask count: lanes without a cell.
template <bool kRecord>
HWY_NOINLINE int address_stage(const OctaOctreeView& view, const OctreeLevelView& level, const QueryBlock& block,
                               int first, StepTaps& taps) {
  const F f;
  const U du;
  const int lanes = static_cast<int>(hn::Lanes(f));
  const VF d = hn::Load(f, block.d + first);
  Axis axis[3];
  for (int a = 0; a < 3; ++a) {
    axis[a] = make_axis(level, a, view.trilinear, hn::Load(f, block.p[a] + first), hn::Load(f, block.w[a] + first), d);
  }

  alignas(64) std::uint32_t code[kCorners * kLanes], cell[kCorners * kLanes];
  for (int j = 0; j < kCorners; ++j) {
    hn::Store(hn::Add(hn::Add(axis[0].code[j & 1], axis[1].code[j >> 1 & 1]), axis[2].code[j >> 2]), du,
              code + j * lanes);
  }
  find_cells(level.index, code, cell, kCorners * lanes);

  const VU none = hn::Set(du, ~0u);
  VF weight[kCorners], sum = hn::Zero(f);
  VU corners = hn::Zero(du);
  for (int j = 0; j < kCorners; ++j) {
    const VF w = hn::Mul(hn::Mul(axis[0].weight[j & 1], axis[1].weight[j >> 1 & 1]), axis[2].weight[j >> 2]);
    const auto counts =
        hn::And(hn::Gt(w, hn::Zero(f)), hn::RebindMask(f, hn::Ne(hn::Load(du, cell + j * lanes), none)));
    weight[j] = hn::IfThenElseZero(counts, w);
    sum = hn::Add(sum, weight[j]);
    corners = hn::Or(corners, hn::IfThenElseZero(hn::RebindMask(du, counts), hn::Set(du, 1u << j)));
  }
  hn::Store(corners, du, taps.corners);
  const auto any = hn::Gt(sum, hn::Zero(f));
  const VF normalize = hn::IfThenElseZero(any, hn::Div(hn::Set(f, 1.0f), hn::IfThenElse(any, sum, hn::Set(f, 1.0f))));

  const int resolution = level.octahedral_resolution;
  if (resolution == 0) {  // one vector a cell
    for (int j = 0; j < kCorners; ++j) {
      hn::Store(hn::Add(hn::Set(du, level.first_entry), hn::Load(du, cell + j * lanes)), du, taps.entry[j][0]);
      hn::Store(hn::Mul(weight[j], normalize), f, taps.weight[j][0]);
      if constexpr (kRecord) hn::Store(hn::Zero(f), f, taps.slope[j][0]);
    }
    taps.vertices = 1;
    return lanes - static_cast<int>(hn::CountTrue(f, any));
  }
  taps.vertices = 3;
  const std::uint32_t map_size = static_cast<std::uint32_t>((resolution + 1) * (resolution + 1));
  const float half = static_cast<float>(resolution / 2);
  const VF h = hn::Set(f, half), minus_h = hn::Set(f, -half), one = hn::Set(f, 1.0f), zero = hn::Zero(f);
  // Vertex indices are computed in floats (below 2^23, exact) on top of 2^23, whose bits are then an integer.
  constexpr std::uint32_t kMagicBits = 0x4b000000u;
  const VF row_stride = hn::Set(f, static_cast<float>(resolution + 1));
  const VF magic = hn::Set(f, 0x1p23f + half * static_cast<float>(resolution + 1) + half);
  const VU last_bits = hn::Set(du, kMagicBits + map_size - 1);
  const auto vertex_bits = [&](VF row, VF column) HWY_ATTR {
    // The minimum only matters for directions that are not a number.
    return hn::Min(hn::BitCast(du, hn::MulAdd(row, row_stride, hn::Add(column, magic))), last_bits);
  };
  VF magnitude[3][2];
  for (int a = 0; a < 3; ++a) {
    for (int o = 0; o < 2; ++o) magnitude[a][o] = hn::Abs(axis[a].v[o]);
  }

  for (int j = 0; j < kCorners; ++j) {
    const VF vx = axis[0].v[j & 1], vy = axis[1].v[j >> 1 & 1], vz = axis[2].v[j >> 2];
    const auto counts = hn::RebindMask(f, hn::TestBit(corners, hn::Set(du, 1u << j)));
    const VU map = hn::Add(hn::Set(du, level.first_entry - kMagicBits),
                           hn::Mul(hn::Load(du, cell + j * lanes), hn::Set(du, map_size)));

    const VF norm = hn::Max(hn::Add(hn::Add(magnitude[0][j & 1], magnitude[1][j >> 1 & 1]), magnitude[2][j >> 2]),
                            hn::Set(f, kMinL1Norm));
    const VF scale = hn::Div(h, norm);
    const VF px = hn::Mul(vx, scale), py = hn::Mul(vy, scale);
    const auto folded = hn::Lt(vz, zero);
    VF x = hn::IfThenElse(folded, hn::CopySign(hn::Sub(h, hn::Abs(py)), vx), px);
    VF y = hn::IfThenElse(folded, hn::CopySign(hn::Sub(h, hn::Abs(px)), vy), py);
    x = hn::Min(hn::Max(x, minus_h), h);
    y = hn::Min(hn::Max(y, minus_h), h);
    const VF i = hn::Min(hn::Floor(x), hn::Sub(h, one)), k = hn::Min(hn::Floor(y), hn::Sub(h, one));
    const VF s = hn::Sub(x, i), t = hn::Sub(y, k);
    const VF w = hn::Mul(weight[j], normalize);
    VU entry[3];
    VF b[3];
    if (!view.barycentric) {
      const VF column = hn::Add(i, hn::IfThenElseZero(hn::Ge(s, hn::Set(f, 0.5f)), one));
      const VF row = hn::Add(k, hn::IfThenElseZero(hn::Ge(t, hn::Set(f, 0.5f)), one));
      entry[0] = vertex_bits(hn::IfThenElse(hn::Eq(hn::Abs(column), h), hn::Abs(row), row),
                             hn::IfThenElse(hn::Eq(hn::Abs(row), h), hn::Abs(column), column));
      entry[1] = entry[2] = entry[0];
      b[0] = w;
      b[1] = b[2] = zero;
      if constexpr (kRecord) {
        for (int v = 0; v < 3; ++v) hn::Store(zero, f, taps.slope[j][v]);
      }
    } else {
      // Cells of quadrants 1 and 3 are those of 2 and 4 mirrored in x: s becomes 1 - s and the columns change places.
      const auto mirrored = hn::Not(hn::Xor(hn::Lt(i, zero), hn::Lt(k, zero)));
      const VF m = hn::IfThenElse(mirrored, hn::Sub(one, s), s);
      const VF i1 = hn::Add(i, one), k1 = hn::Add(k, one);
      const VF ia = hn::IfThenElse(mirrored, i1, i), ib = hn::IfThenElse(mirrored, i, i1);
      const auto right = hn::Gt(m, t);
      const VF upper = hn::Max(m, t), lower = hn::Min(m, t);
      // Canonical rim vertices: on a rim column the row is made positive, on a rim row the column is.
      const VF abs_ia = hn::Abs(ia), abs_ib = hn::Abs(ib), abs_k = hn::Abs(k), abs_k1 = hn::Abs(k1);
      const auto rim_ia = hn::Eq(abs_ia, h), rim_ib = hn::Eq(abs_ib, h), rim_k = hn::Eq(abs_k, h),
                 rim_k1 = hn::Eq(abs_k1, h);
      entry[0] = vertex_bits(hn::IfThenElse(rim_ia, abs_k, k), hn::IfThenElse(rim_k, abs_ia, ia));
      entry[1] = vertex_bits(hn::IfThenElse(rim_ib, abs_k1, k1), hn::IfThenElse(rim_k1, abs_ib, ib));
      entry[2] =
          vertex_bits(hn::IfThenElse(right, hn::IfThenElse(rim_ib, abs_k, k), hn::IfThenElse(rim_ia, abs_k1, k1)),
                      hn::IfThenElse(right, hn::IfThenElse(rim_k, abs_ib, ib), hn::IfThenElse(rim_k1, abs_ia, ia)));
      b[0] = hn::Mul(w, hn::Sub(one, upper));
      b[1] = hn::Mul(w, lower);
      b[2] = hn::Mul(w, hn::Sub(upper, lower));
      if constexpr (kRecord) {
        const VF sign_bit = hn::Set(f, -0.0f);
        const VF ox = axis[0].offset[j & 1], oy = axis[1].offset[j >> 1 & 1], oz = axis[2].offset[j >> 2];
        const VF sx = hn::And(vx, sign_bit), sy = hn::And(vy, sign_bit), sz = hn::And(vz, sign_bit);
        const VF norm_velocity = hn::Add(hn::Add(hn::Xor(ox, sx), hn::Xor(oy, sy)), hn::Xor(oz, sz));
        const VF relative = hn::Div(norm_velocity, norm);
        const VF qx = hn::NegMulAdd(px, relative, hn::Mul(ox, scale)),
                 qy = hn::NegMulAdd(py, relative, hn::Mul(oy, scale));
        const VF flip = hn::Xor(hn::Xor(sx, sy), sign_bit);
        const VF dx = hn::IfThenElse(folded, hn::Xor(qy, flip), qx), dy = hn::IfThenElse(folded, hn::Xor(qx, flip), qy);
        const VF dm = hn::IfThenElse(mirrored, hn::Neg(dx), dx);
        const VF d_upper = hn::IfThenElse(right, dm, dy), d_lower = hn::IfThenElse(right, dy, dm);
        hn::Store(hn::IfThenElseZero(counts, hn::Mul(w, hn::Neg(d_upper))), f, taps.slope[j][0]);
        hn::Store(hn::IfThenElseZero(counts, hn::Mul(w, d_lower)), f, taps.slope[j][1]);
        hn::Store(hn::IfThenElseZero(counts, hn::Mul(w, hn::Sub(d_upper, d_lower))), f, taps.slope[j][2]);
      }
    }
    for (int v = 0; v < 3; ++v) {
      hn::Store(hn::IfThenElseZero(hn::RebindMask(du, counts), hn::Add(entry[v], map)), du, taps.entry[j][v]);
      hn::Store(hn::IfThenElseZero(counts, b[v]), f, taps.weight[j][v]);
    }
  }
  return lanes - static_cast<int>(hn::CountTrue(f, any));
}

// Prefetches the cache lines that the gather stage will read. All three vertices: the third is next to one of the
// others but often in another line, and leaving it out costs a third of the speed on large tables. Prefetching further
// ahead gains nothing. (Inlined: the compiler drops calls of a function that does nothing but prefetch.)
template <int C>
HWY_INLINE void prefetch_stage(const float* HWY_RESTRICT table, const StepTaps& taps, int lanes) {
  for (int q = 0; q < lanes; ++q) {
    for (std::uint32_t rest = taps.corners[q]; rest != 0; rest &= rest - 1) {
      const int j = __builtin_ctz(rest);
      for (int k = 0; k < taps.vertices; ++k) hwy::Prefetch(table + std::size_t{taps.entry[j][k][q]} * C);
    }
  }
}

// Sums the feature vectors of one step, of a level of maps (3) or a fine one (1).
template <int C, bool kRecord, int kVertices>
HWY_NOINLINE void gather_vertices(const float* HWY_RESTRICT table, const StepTaps& taps, int lanes,
                                  float* HWY_RESTRICT value, float* HWY_RESTRICT slope) {
  const Feature<C> f;
  constexpr int kStep = C / kParts<C>;
  for (int q = 0; q < lanes; ++q) {
    hn::Vec<Feature<C>> sum[kParts<C>], rate[kParts<C>];
    for (int part = 0; part < kParts<C>; ++part) sum[part] = rate[part] = hn::Zero(f);
    for (std::uint32_t rest = taps.corners[q]; rest != 0; rest &= rest - 1) {
      const int j = __builtin_ctz(rest);
      for (int k = 0; k < kVertices; ++k) {
        const float* t = table + std::size_t{taps.entry[j][k][q]} * C;
        const auto w = hn::Set(f, taps.weight[j][k][q]);
        for (int part = 0; part < kParts<C>; ++part) {
          const auto v = hn::Load(f, t + part * kStep);
          sum[part] = hn::MulAdd(w, v, sum[part]);
          if constexpr (kRecord) rate[part] = hn::MulAdd(hn::Set(f, taps.slope[j][k][q]), v, rate[part]);
        }
      }
    }
    for (int part = 0; part < kParts<C>; ++part) {
      hn::Store(sum[part], f, value + q * C + part * kStep);
      if constexpr (kRecord) hn::Store(rate[part], f, slope + q * C + part * kStep);
    }
  }
}

// value[q C + c] and, when recording, its derivative.
template <int C, bool kRecord>
HWY_INLINE void gather_stage(const float* HWY_RESTRICT table, const StepTaps& taps, int lanes,
                             float* HWY_RESTRICT value, float* HWY_RESTRICT slope) {
  if (taps.vertices == 3) gather_vertices<C, kRecord, 3>(table, taps, lanes, value, slope);
  else gather_vertices<C, kRecord, 1>(table, taps, lanes, value, slope);
}

template <int C>
std::int64_t lookup_features(const OctaOctreeView& view, const Vec3f* x, const Vec3f* w, const float* d, int n,
                             float* out, std::int64_t stride) {
  const int lanes = static_cast<int>(hn::Lanes(F()));
  QueryBlock block;
  StepTaps ring[2];
  alignas(64) float value[kLanes * C];
  std::int64_t empty = 0;
  for (int begin = 0; begin < n; begin += kBlock) {
    const int count = std::min(kBlock, n - begin), steps = (count + lanes - 1) / lanes;
    load_block(view, x + begin, w + begin, d + begin, count, block);
    empty -= static_cast<std::int64_t>(steps * lanes - count) * view.levels;  // the padding does not count
    const int total = steps * view.levels;
    for (int step = 0; step <= total; ++step) {
      if (step < total) {
        StepTaps& taps = ring[step & 1];
        empty += address_stage<false>(view, view.level[step / steps], block, step % steps * lanes, taps);
        prefetch_stage<C>(view.table, taps, lanes);
      }
      if (step > 0) {
        const int level = (step - 1) / steps, first = (step - 1) % steps * lanes;
        gather_stage<C, false>(view.table, ring[(step - 1) & 1], lanes, value, nullptr);
        write_rows<C>(value, std::min(lanes, count - first), out + level * C * stride + begin + first, stride);
      }
    }
  }
  return empty;
}

template <int C>
std::int64_t record_features(const OctaOctreeView& view, const Vec3f* x, const Vec3f* w, const float* d, int n,
                             float* out, std::int64_t stride, OctaOctree::Record& record) {
  const int lanes = static_cast<int>(hn::Lanes(F()));
  QueryBlock block;
  StepTaps taps[kMaxOctreeLevels];
  alignas(64) float value[kLanes * C], slope[kLanes * C];
  std::int64_t empty = 0;
  std::size_t used = 0;
  record.begin.resize(static_cast<std::size_t>(n) * static_cast<std::size_t>(view.levels + 1));
  record.derivative.resize(static_cast<std::size_t>(view.levels * C) * static_cast<std::size_t>(stride));
  std::uint32_t* offset = record.begin.data();
  for (int begin = 0; begin < n; begin += kBlock) {
    const int count = std::min(kBlock, n - begin);
    load_block(view, x + begin, w + begin, d + begin, count, block);
    for (int first = 0; first < count; first += lanes) {
      const int valid = std::min(lanes, count - first);
      empty -= static_cast<std::int64_t>(lanes - valid) * view.levels;
      for (int step = 0; step <= view.levels; ++step) {
        if (step < view.levels) {
          empty += address_stage<true>(view, view.level[step], block, first, taps[step]);
          prefetch_stage<C>(view.table, taps[step], lanes);
        }
        if (step > 0) {
          gather_stage<C, true>(view.table, taps[step - 1], lanes, value, slope);
          const std::int64_t at = (step - 1) * C * stride + begin + first;
          write_rows<C>(value, valid, out + at, stride);
          write_rows<C>(slope, valid, record.derivative.data() + at, stride);
        }
      }
      const std::size_t most = used + static_cast<std::size_t>(valid * view.levels * kCorners * 3);
      if (record.taps.size() < most) record.taps.resize(std::max(most, record.taps.size() * 3 / 2));
      Tap* tap = record.taps.data();
      for (int q = 0; q < valid; ++q) {
        *offset++ = static_cast<std::uint32_t>(used);
        for (int l = 0; l < view.levels; ++l) {
          for (std::uint32_t rest = taps[l].corners[q]; rest != 0; rest &= rest - 1) {
            const int j = __builtin_ctz(rest);
            for (int k = 0; k < taps[l].vertices; ++k) {
              const float weight = taps[l].weight[j][k][q];
              tap[used] = {taps[l].entry[j][k][q], weight};
              used += weight != 0.0f;
            }
          }
          *offset++ = static_cast<std::uint32_t>(used);
        }
      }
    }
  }
  record.taps.resize(used);
  return empty;
}

std::int64_t lookup_target(const OctaOctreeView& view, const Vec3f* x, const Vec3f* w, const float* d, int n,
                           float* out, std::int64_t stride) {
  switch (view.features) {
    case 2: return lookup_features<2>(view, x, w, d, n, out, stride);
    case 4: return lookup_features<4>(view, x, w, d, n, out, stride);
    default: return lookup_features<8>(view, x, w, d, n, out, stride);
  }
}

std::int64_t record_target(const OctaOctreeView& view, const Vec3f* x, const Vec3f* w, const float* d, int n,
                           float* out, std::int64_t stride, OctaOctree::Record& record) {
  switch (view.features) {
    case 2: return record_features<2>(view, x, w, d, n, out, stride, record);
    case 4: return record_features<4>(view, x, w, d, n, out, stride, record);
    default: return record_features<8>(view, x, w, d, n, out, stride, record);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace octrad
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace octrad {

HWY_EXPORT(lookup_target);
HWY_EXPORT(record_target);

std::int64_t octaoctree_lookup(const OctaOctreeView& view, const Vec3f* x, const Vec3f* w, const float* d, int n,
                               float* out, int stride) {
  return HWY_DYNAMIC_DISPATCH(lookup_target)(view, x, w, d, n, out, stride);
}

std::int64_t octaoctree_lookup_record(const OctaOctreeView& view, const Vec3f* x, const Vec3f* w, const float* d, int n,
                                      float* out, int stride, OctaOctree::Record& record) {
  return HWY_DYNAMIC_DISPATCH(record_target)(view, x, w, d, n, out, stride, record);
}

}  // namespace octrad
#endif
