#include "scene/texture.h"

#include <algorithm>
#include <cmath>

namespace octrad {
namespace {

// Texel centres lie at (i + 1/2) / size; uv (0, 0) is the corner of the first pixel of the first row of the file: v runs
// down the picture. OBJ files count v upwards, which the mesh loader undoes, as Mitsuba does.

int wrap(int i, int n, Texture::Wrap mode) {
  switch (mode) {
    case Texture::Wrap::clamp: return std::clamp(i, 0, n - 1);
    case Texture::Wrap::repeat: {
      const int r = i % n;
      return r < 0 ? r + n : r;
    }
    case Texture::Wrap::mirror: {
      const int period = 2 * n;
      int r = i % period;
      if (r < 0) r += period;
      return r < n ? r : period - 1 - r;
    }
  }
  return 0;
}

// floor as int; coordinates too large for an int, or not a number, count as 0.
int floor_int(float x) {
  const float f = std::floor(x);
  return std::fabs(f) < 1e9f ? static_cast<int>(f) : 0;
}

Vec2f transform(const Texture& t, Vec2f uv) {
  return {t.to_uv[0] * uv.x + t.to_uv[1] * uv.y + t.to_uv[2], t.to_uv[3] * uv.x + t.to_uv[4] * uv.y + t.to_uv[5]};
}

const Vec3f& texel(const Texture& t, int x, int y) {
  return t.pixels[static_cast<std::size_t>(wrap(y, t.height, t.wrap)) * static_cast<std::size_t>(t.width) + static_cast<std::size_t>(wrap(x, t.width, t.wrap))];
}

struct Cell {
  int x, y;
  float fx, fy;
};

Cell bilinear_cell(const Texture& t, Vec2f uv) {
  const float x = uv.x * static_cast<float>(t.width) - 0.5f, y = uv.y * static_cast<float>(t.height) - 0.5f;
  const int ix = floor_int(x), iy = floor_int(y);
  const auto fraction = [](float f) { return f > 0.0f ? std::min(f, 1.0f) : 0.0f; };   // 0 for NaN
  return {ix, iy, fraction(x - static_cast<float>(ix)), fraction(y - static_cast<float>(iy))};
}

}  // namespace

Vec3f evaluate(const Texture& texture, Vec2f surface_uv) {
  if (texture.kind == Texture::Kind::constant) return texture.color0;
  const Vec2f uv = transform(texture, surface_uv);
  if (texture.kind == Texture::Kind::checkerboard) {
    // First colour where both coordinates fall into the same half of their unit interval.
    const bool a = uv.x - std::floor(uv.x) > 0.5f, b = uv.y - std::floor(uv.y) > 0.5f;
    return a == b ? texture.color0 : texture.color1;
  }
  if (texture.filter == Texture::Filter::nearest) {
    return texel(texture, floor_int(uv.x * static_cast<float>(texture.width)), floor_int(uv.y * static_cast<float>(texture.height)));
  }
  const Cell c = bilinear_cell(texture, uv);
  const Vec3f top = lerp(texel(texture, c.x, c.y), texel(texture, c.x + 1, c.y), Vec3f(c.fx));
  const Vec3f bottom = lerp(texel(texture, c.x, c.y + 1), texel(texture, c.x + 1, c.y + 1), Vec3f(c.fx));
  return lerp(top, bottom, Vec3f(c.fy));
}

Vec2f gradient(const Texture& texture, Vec2f surface_uv) {
  if (texture.kind != Texture::Kind::bitmap || texture.filter == Texture::Filter::nearest) return {0, 0};
  const Cell c = bilinear_cell(texture, transform(texture, surface_uv));
  const float v00 = texel(texture, c.x, c.y).x, v10 = texel(texture, c.x + 1, c.y).x;
  const float v01 = texel(texture, c.x, c.y + 1).x, v11 = texel(texture, c.x + 1, c.y + 1).x;
  const float dx = (lerp(v10 - v00, v11 - v01, c.fy)) * static_cast<float>(texture.width);
  const float dy = (lerp(v01 - v00, v11 - v10, c.fx)) * static_cast<float>(texture.height);
  return {texture.to_uv[0] * dx + texture.to_uv[3] * dy, texture.to_uv[1] * dx + texture.to_uv[4] * dy};
}

}  // namespace octrad
