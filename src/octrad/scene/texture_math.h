// Textures at surface coordinates, as plain pointers: for host and device.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "octrad/base/vec.h"

namespace octrad {

// Parameters of a texture; its pixels are in TextureView.
struct TextureSettings {
  enum class Kind { constant, bitmap, checkerboard };
  enum class Filter { nearest, bilinear };
  enum class Wrap { repeat, mirror, clamp };
  Kind kind = Kind::constant;
  Vec3f color0{0.4f, 0.4f, 0.4f};  // constant value, or the checkerboard's first colour
  Vec3f color1{0.2f, 0.2f, 0.2f};
  float to_uv[6] = {1, 0, 0, 0, 1, 0};  // row-major 2x3: uv' = A (u, v, 1)
  Filter filter = Filter::bilinear;
  Wrap wrap = Wrap::repeat;
  int width = 0, height = 0;
};

// Texels as indices into a palette of values (shading/compact_texture.h).
inline constexpr int kPaletteSize = 256;
struct TexelIndices {
  std::uint8_t r, g, b, unused;
};
struct alignas(64) TexelTile {
  TexelIndices texels[16];  // 4 x 4, row by row
};

struct TextureView : TextureSettings {
  const Vec3f* pixels = nullptr;     // [height][width], or null where `tiles` holds them
  const TexelTile* tiles = nullptr;  // [ceil(height / 4)][columns]
  const float* palette = nullptr;    // [kPaletteSize]
  int columns = 0;
};

// Texel centres lie at (i + 1/2) / size; uv (0, 0) is the corner of the first pixel of the first row of the file: v
// runs down the picture. OBJ files count v upwards, which the mesh loader undoes, as Mitsuba does.

OCTRAD_HD inline int wrap_texel(int i, int n, TextureSettings::Wrap mode) {
  if (i >= 0 && i < n) return i;
  if (mode == TextureSettings::Wrap::clamp) return i < 0 ? 0 : n - 1;
  const int period = mode == TextureSettings::Wrap::mirror ? 2 * n : n;
  int r = i % period;
  if (r < 0) r += period;
  return r < n ? r : period - 1 - r;
}

// floor as int; coordinates too large for an int, or not a number, count as 0.
OCTRAD_HD inline int floor_to_int(float x) {
  if (!(std::fabs(x) < 1e9f)) return 0;
  const int i = static_cast<int>(x);
  return i - (static_cast<float>(i) > x ? 1 : 0);
}

OCTRAD_HD inline Vec2f transform_uv(const TextureSettings& t, Vec2f uv) {
  return {t.to_uv[0] * uv.x + t.to_uv[1] * uv.y + t.to_uv[2], t.to_uv[3] * uv.x + t.to_uv[4] * uv.y + t.to_uv[5]};
}

// Texels (x0, y0) .. (x1, y1), wrapped, and the position between them; all one texel where nothing is interpolated.
struct TexelCell {
  int x0, y0, x1, y1;
  float fx, fy;
};

OCTRAD_HD inline TexelCell texel_cell(const TextureSettings& t, Vec2f surface_uv) {
  const Vec2f uv = transform_uv(t, surface_uv);
  TexelCell c;
  if (t.filter == TextureSettings::Filter::nearest) {
    c.x0 = c.x1 = wrap_texel(floor_to_int(uv.x * static_cast<float>(t.width)), t.width, t.wrap);
    c.y0 = c.y1 = wrap_texel(floor_to_int(uv.y * static_cast<float>(t.height)), t.height, t.wrap);
    c.fx = c.fy = 0.0f;
    return c;
  }
  const float x = uv.x * static_cast<float>(t.width) - 0.5f, y = uv.y * static_cast<float>(t.height) - 0.5f;
  const int ix = floor_to_int(x), iy = floor_to_int(y);
  const float fx = x - static_cast<float>(ix), fy = y - static_cast<float>(iy);
  c.fx = fx > 0.0f ? std::min(fx, 1.0f) : 0.0f;  // 0 for NaN
  c.fy = fy > 0.0f ? std::min(fy, 1.0f) : 0.0f;
  c.x0 = wrap_texel(ix, t.width, t.wrap);
  c.x1 = wrap_texel(ix + 1, t.width, t.wrap);
  c.y0 = wrap_texel(iy, t.height, t.wrap);
  c.y1 = wrap_texel(iy + 1, t.height, t.wrap);
  return c;
}

OCTRAD_HD inline const TexelIndices& texel_indices(const TextureView& t, int x, int y) {
  const TexelTile& tile = t.tiles[static_cast<std::size_t>(y >> 2) * static_cast<std::size_t>(t.columns) +
                                  static_cast<std::size_t>(x >> 2)];
  return tile.texels[(y & 3) * 4 + (x & 3)];
}

template <bool kTiles>
OCTRAD_HD inline Vec3f texel(const TextureView& t, int x, int y) {
  if constexpr (kTiles) {
    const TexelIndices i = texel_indices(t, x, y);
    return {t.palette[i.r], t.palette[i.g], t.palette[i.b]};
  } else {
    return t.pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(t.width) + static_cast<std::size_t>(x)];
  }
}

template <bool kTiles>
OCTRAD_HD inline Vec3f evaluate_bitmap(const TextureView& t, Vec2f surface_uv) {
  const TexelCell c = texel_cell(t, surface_uv);
  if (t.filter == TextureSettings::Filter::nearest) return texel<kTiles>(t, c.x0, c.y0);
  const Vec3f top = lerp(texel<kTiles>(t, c.x0, c.y0), texel<kTiles>(t, c.x1, c.y0), Vec3f(c.fx));
  const Vec3f bottom = lerp(texel<kTiles>(t, c.x0, c.y1), texel<kTiles>(t, c.x1, c.y1), Vec3f(c.fx));
  return lerp(top, bottom, Vec3f(c.fy));
}

// Linear RGB at surface coordinates.
OCTRAD_HD inline Vec3f evaluate_texture(const TextureView& t, Vec2f surface_uv) {
  if (t.kind == TextureSettings::Kind::constant) return t.color0;
  if (t.kind == TextureSettings::Kind::checkerboard) {
    // First colour where both coordinates fall into the same half of their unit interval.
    const Vec2f uv = transform_uv(t, surface_uv);
    const bool a = uv.x - std::floor(uv.x) > 0.5f, b = uv.y - std::floor(uv.y) > 0.5f;
    return a == b ? t.color0 : t.color1;
  }
  return t.tiles != nullptr ? evaluate_bitmap<true>(t, surface_uv) : evaluate_bitmap<false>(t, surface_uv);
}

// Derivatives of the first channel with respect to the surface's u and v.
OCTRAD_HD inline Vec2f texture_gradient(const TextureView& t, Vec2f surface_uv) {
  if (t.kind != TextureSettings::Kind::bitmap || t.filter == TextureSettings::Filter::nearest) return {0, 0};
  const TexelCell c = texel_cell(t, surface_uv);
  float v00, v10, v01, v11;
  if (t.tiles != nullptr) {
    v00 = texel<true>(t, c.x0, c.y0).x, v10 = texel<true>(t, c.x1, c.y0).x;
    v01 = texel<true>(t, c.x0, c.y1).x, v11 = texel<true>(t, c.x1, c.y1).x;
  } else {
    v00 = texel<false>(t, c.x0, c.y0).x, v10 = texel<false>(t, c.x1, c.y0).x;
    v01 = texel<false>(t, c.x0, c.y1).x, v11 = texel<false>(t, c.x1, c.y1).x;
  }
  const float dx = (lerp(v10 - v00, v11 - v01, c.fy)) * static_cast<float>(t.width);
  const float dy = (lerp(v01 - v00, v11 - v10, c.fx)) * static_cast<float>(t.height);
  return {t.to_uv[0] * dx + t.to_uv[3] * dy, t.to_uv[1] * dx + t.to_uv[4] * dy};
}

}  // namespace octrad
