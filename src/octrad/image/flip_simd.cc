// One tile of FLIP for every instruction set (Highway's dynamic dispatch: this file is compiled once per target).
// Equations are those of section 4 of the paper of 2020; all filters are separable.
#include "octrad/image/flip_simd.h"

// SSSE3 and AVX-512 "DL" would give the same code as the next smaller sets.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "octrad/image/flip_simd.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>

#include <hwy/contrib/math/math-inl.h>

HWY_BEFORE_NAMESPACE();
namespace octrad {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, 16>;
using V = hn::Vec<D>;
constexpr std::size_t kLanes = hn::MaxLanes(D());
static_assert(kFlipTile % kLanes == 0);

// What is kept of a row after the filters along x.
enum Plane { kAchromatic, kRedGreen, kBlueYellow0, kBlueYellow1, kSmooth, kEdge, kPoint, kPlanes };

// out[x] = sum over k of taps[k] (in[x + k] +- in[x - k]) along x (step 1) or y (step: the length of a row).
template <bool kOdd>
HWY_INLINE V filter(const FlipFilter& f, const float* in, std::size_t step) {
  const D d;
  V sum = kOdd ? hn::Zero(d) : hn::Mul(hn::Set(d, f.taps[0]), hn::LoadU(d, in));
  for (std::size_t k = 1; k < f.taps.size(); ++k) {
    const V after = hn::LoadU(d, in + k * step), before = hn::LoadU(d, in - k * step);
    sum = hn::MulAdd(hn::Set(d, f.taps[k]), kOdd ? hn::Sub(after, before) : hn::Add(after, before), sum);
  }
  return sum;
}

HWY_INLINE V clamp01(V v) {
  const D d;
  return hn::Min(hn::Max(v, hn::Zero(d)), hn::Set(d, 1.0f));
}

HWY_INLINE V power(V x, V exponent) {  // 0 for x <= 0
  const D d;
  const V tiny = hn::Set(d, 1e-30f);
  const V p = hn::Exp(d, hn::Mul(exponent, hn::Log(d, hn::Max(x, tiny))));
  return hn::IfThenElseZero(hn::Gt(x, tiny), p);
}

HWY_INLINE V lab_curve(V t) {  // CIE 1976: cube root, and a line near 0
  const D d;
  constexpr float kDelta = 6.0f / 29.0f;
  const V line = hn::MulAdd(t, hn::Set(d, 1.0f / (3.0f * kDelta * kDelta)), hn::Set(d, 4.0f / 29.0f));
  return hn::IfThenElse(hn::Gt(t, hn::Set(d, kDelta * kDelta * kDelta)), power(t, hn::Set(d, 1.0f / 3.0f)), line);
}

struct Color {
  V x, y, z;
};

HWY_INLINE Color transform(const float m[3][3], const Color& c) {
  const D d;
  const auto row = [&](const float* r) {
    return hn::MulAdd(hn::Set(d, r[0]), c.x, hn::MulAdd(hn::Set(d, r[1]), c.y, hn::Mul(hn::Set(d, r[2]), c.z)));
  };
  return {row(m[0]), row(m[1]), row(m[2])};
}

// One row of a picture through the tone mapping, from opponent colours to the seven filtered rows of the tile. `line`:
// room for 3 rows of a tile with its border.
void filter_row(const FlipConstants& k, const Image& image, int x0, int y, std::size_t span, float* line, float* out) {
  const D d;
  const std::size_t radius = static_cast<std::size_t>(k.radius);
  float *a = line, *b = line + span, *c = line + 2 * span;
  const float* from = &image.data[3 * static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width)];
  for (std::size_t i = 0; i < span; ++i) {
    const int x = std::clamp(x0 + static_cast<int>(i) - k.radius, 0, image.width - 1);
    const float* rgb = from + 3 * static_cast<std::size_t>(x);
    a[i] = rgb[0];
    b[i] = rgb[1];
    c[i] = rgb[2];
  }
  for (std::size_t i = 0; i < span; i += kLanes) {
    Color rgb = {hn::LoadU(d, a + i), hn::LoadU(d, b + i), hn::LoadU(d, c + i)};
    if (k.tone_map) {
      for (V* v : {&rgb.x, &rgb.y, &rgb.z}) {
        // At 1e6 the curve has long ended above 1; squares of larger values could overflow.
        const V x = hn::Min(hn::Max(hn::Mul(*v, hn::Set(d, k.scale)), hn::Zero(d)), hn::Set(d, 1e6f));
        const V above = hn::Mul(x, hn::MulAdd(hn::Set(d, k.curve[0]), x, hn::Set(d, k.curve[1])));
        const V below =
            hn::MulAdd(x, hn::MulAdd(hn::Set(d, k.curve[2]), x, hn::Set(d, k.curve[3])), hn::Set(d, k.curve[4]));
        *v = hn::Div(above, below);
      }
    }
    const Color xyz = transform(k.to_xyz, {clamp01(rgb.x), clamp01(rgb.y), clamp01(rgb.z)});
    hn::StoreU(xyz.y, d, a + i);  // achromatic, red-green and blue-yellow, without the factors 116, 500 and 200
    hn::StoreU(hn::Sub(xyz.x, xyz.y), d, b + i);
    hn::StoreU(hn::Sub(xyz.y, xyz.z), d, c + i);
  }
  for (std::size_t i = 0; i < kFlipTile; i += kLanes) {
    const auto keep = [&](Plane plane, V v) { hn::StoreU(v, d, out + plane * kFlipTile + i); };
    const std::size_t at = i + radius;
    keep(kAchromatic, filter<false>(k.achromatic, a + at, 1));
    keep(kRedGreen, filter<false>(k.red_green, b + at, 1));
    keep(kBlueYellow0, filter<false>(k.blue_yellow[0], c + at, 1));
    keep(kBlueYellow1, filter<false>(k.blue_yellow[1], c + at, 1));
    keep(kSmooth, filter<false>(k.gaussian, a + at, 1));
    keep(kEdge, filter<true>(k.edge, a + at, 1));
    keep(kPoint, filter<false>(k.point, a + at, 1));
  }
}

struct Perceived {
  Color lab;  // CIELab with Hunt's adjustment
  V edge, point;
};

// The filters along y, then colour as seen and the size of edges and points. `at`: the centre's place in the filtered
// rows.
HWY_INLINE Perceived perceive(const FlipConstants& k, const float* at) {
  const D d;
  constexpr std::size_t kStep = kPlanes * kFlipTile;
  const auto plane = [&](Plane p) { return at + p * kFlipTile; };
  const V y = filter<false>(k.achromatic, plane(kAchromatic), kStep);
  const V x_y = filter<false>(k.red_green, plane(kRedGreen), kStep);
  const V y_z =
      hn::MulAdd(hn::Set(d, k.share[0]), filter<false>(k.blue_yellow[0], plane(kBlueYellow0), kStep),
                 hn::Mul(hn::Set(d, k.share[1]), filter<false>(k.blue_yellow[1], plane(kBlueYellow1), kStep)));
  const Color rgb = transform(k.to_rgb, {hn::Add(y, x_y), y, hn::Sub(y, y_z)});
  const Color xyz = transform(k.to_xyz, {clamp01(rgb.x), clamp01(rgb.y), clamp01(rgb.z)});
  const V fx = lab_curve(xyz.x), fy = lab_curve(xyz.y), fz = lab_curve(xyz.z);
  const V lightness = hn::MulAdd(hn::Set(d, 116.0f), fy, hn::Set(d, -16.0f));
  const V hunt = hn::Mul(hn::Set(d, 0.01f), lightness);
  const auto magnitude = [&](V along_x, V along_y) {
    return hn::Sqrt(hn::MulAdd(along_x, along_x, hn::Mul(along_y, along_y)));
  };
  return {{lightness, hn::Mul(hunt, hn::Mul(hn::Set(d, 500.0f), hn::Sub(fx, fy))),
           hn::Mul(hunt, hn::Mul(hn::Set(d, 200.0f), hn::Sub(fy, fz)))},
          magnitude(filter<false>(k.gaussian, plane(kEdge), kStep), filter<true>(k.edge, plane(kSmooth), kStep)),
          magnitude(filter<false>(k.gaussian, plane(kPoint), kStep), filter<false>(k.point, plane(kSmooth), kStep))};
}

HWY_INLINE V difference(const FlipConstants& k, const Perceived& r, const Perceived& i) {
  const D d;
  constexpr float kColorPower = 0.7f, kKnee = 0.4f, kAtKnee = 0.95f;
  // HyAB distance, compressed; its range is mapped to [0, 1] by two lines.
  const V da = hn::Sub(r.lab.y, i.lab.y), db = hn::Sub(r.lab.z, i.lab.z);
  const V distance = hn::Add(hn::Abs(hn::Sub(r.lab.x, i.lab.x)), hn::Sqrt(hn::MulAdd(da, da, hn::Mul(db, db))));
  const V color = power(distance, hn::Set(d, kColorPower));
  const float knee = kKnee * k.largest_color;
  const V low = hn::Mul(color, hn::Set(d, kAtKnee / knee));
  const V high = hn::MulAdd(hn::Sub(color, hn::Set(d, knee)), hn::Set(d, (1.0f - kAtKnee) / (k.largest_color - knee)),
                            hn::Set(d, kAtKnee));
  const V mapped = hn::IfThenElse(hn::Lt(color, hn::Set(d, knee)), low, high);
  const V feature = hn::Max(hn::Abs(hn::Sub(r.edge, i.edge)), hn::Abs(hn::Sub(r.point, i.point)));
  const V seen = hn::Sqrt(hn::Mul(feature, hn::Set(d, 0.70710678f)));
  return power(mapped, hn::Sub(hn::Set(d, 1.0f), seen));
}

void tile_target(const FlipConstants& k, const Image& reference, const Image& image, int x0, int y0,
                 std::vector<float>& error) {
  const D d;
  const std::size_t radius = static_cast<std::size_t>(k.radius);
  const std::size_t span = (kFlipTile + 2 * radius + kLanes - 1) / kLanes * kLanes;
  const std::size_t height =
      std::min(kFlipTileRows, static_cast<std::size_t>(reference.height) - static_cast<std::size_t>(y0));
  const std::size_t width =
      std::min(kFlipTile, static_cast<std::size_t>(reference.width) - static_cast<std::size_t>(x0));
  constexpr std::size_t kRow = kPlanes * kFlipTile;
  std::vector<float> line(3 * span), rows[2];
  for (int which = 0; which < 2; ++which) {
    rows[which].resize((height + 2 * radius) * kRow);
    for (std::size_t row = 0; row < height + 2 * radius; ++row) {
      const int y = std::clamp(y0 + static_cast<int>(row) - k.radius, 0, reference.height - 1);
      filter_row(k, which == 0 ? reference : image, x0, y, span, line.data(), &rows[which][row * kRow]);
    }
  }
  float result[kFlipTile];
  for (std::size_t row = 0; row < height; ++row) {
    const std::size_t at = (row + radius) * kRow;
    for (std::size_t i = 0; i < kFlipTile; i += kLanes) {
      hn::StoreU(difference(k, perceive(k, &rows[0][at + i]), perceive(k, &rows[1][at + i])), d, result + i);
    }
    float* to = &error[(static_cast<std::size_t>(y0) + row) * static_cast<std::size_t>(reference.width) +
                       static_cast<std::size_t>(x0)];
    for (std::size_t x = 0; x < width; ++x) to[x] = std::max(to[x], result[x]);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace octrad
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace octrad {
HWY_EXPORT(tile_target);

void flip_tile(const FlipConstants& constants, const Image& reference, const Image& image, int x0, int y0,
               std::vector<float>& error) {
  HWY_DYNAMIC_DISPATCH(tile_target)(constants, reference, image, x0, y0, error);
}

}  // namespace octrad
#endif
