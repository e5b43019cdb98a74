#include "shading/compact_texture.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace octrad {
namespace {

// Numbers of a picture -> index below 256, by open addressing.
class Palette {
 public:
  Palette() : keys_(kSize, 0), index_(kSize, -1) {}
  // -1 when there are too many.
  int index(float value) {
    const std::uint32_t bits = std::bit_cast<std::uint32_t>(value);
    std::uint32_t slot = (bits * 2654435761u) >> (32 - kBits);
    while (index_[slot] >= 0 && keys_[slot] != bits) slot = (slot + 1) & (kSize - 1);
    if (index_[slot] < 0) {
      if (values.size() == 256) return -1;
      keys_[slot] = bits;
      index_[slot] = static_cast<int>(values.size());
      values.push_back(value);
    }
    return index_[slot];
  }
  std::vector<float> values;

 private:
  static constexpr int kBits = 11, kSize = 1 << kBits;
  std::vector<std::uint32_t> keys_;
  std::vector<int> index_;
};

// As scene/texture.cc: coordinates too large for an int, or not a number, count as 0.
int floor_int(float x) {
  if (!(std::fabs(x) < 1e9f)) return 0;
  const int i = static_cast<int>(x);
  return i - (static_cast<float>(i) > x ? 1 : 0);
}

int wrap(int i, int n, bool clamp) {
  if (i >= 0 && i < n) return i;
  if (clamp) return std::clamp(i, 0, n - 1);
  const int r = i % n;
  return r < 0 ? r + n : r;
}

constexpr std::size_t kSmallest = 64 * 64;

}  // namespace

std::unique_ptr<CompactTexture> CompactTexture::make(const Texture& t) {
  if (t.kind != Texture::Kind::bitmap || t.wrap == Texture::Wrap::mirror || t.pixels.size() < kSmallest) return nullptr;
  auto out = std::make_unique<CompactTexture>();
  out->width_ = t.width;
  out->height_ = t.height;
  out->nearest_ = t.filter == Texture::Filter::nearest;
  out->clamp_ = t.wrap == Texture::Wrap::clamp;
  std::copy(t.to_uv, t.to_uv + 6, out->to_uv_);
  out->columns_ = static_cast<std::size_t>((t.width + 3) / 4);
  out->tiles_.resize(out->columns_ * static_cast<std::size_t>((t.height + 3) / 4));
  Palette palette;
  for (int y = 0; y < t.height; ++y) {
    const Vec3f* row = t.pixels.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(t.width);
    for (int x = 0; x < t.width; ++x) {
      const int r = palette.index(row[x].x), g = palette.index(row[x].y), b = palette.index(row[x].z);
      if (r < 0 || g < 0 || b < 0) return nullptr;
      out->tiles_[static_cast<std::size_t>(y >> 2) * out->columns_ + static_cast<std::size_t>(x >> 2)].texels[(y & 3) * 4 + (x & 3)] = {
          static_cast<std::uint8_t>(r), static_cast<std::uint8_t>(g), static_cast<std::uint8_t>(b), 0};
    }
  }
  std::fill(std::begin(out->palette_), std::end(out->palette_), 0.0f);
  std::copy(palette.values.begin(), palette.values.end(), out->palette_);
  return out;
}

CompactTexture::Cell CompactTexture::cell(Vec2f uv) const {
  const Vec2f t{to_uv_[0] * uv.x + to_uv_[1] * uv.y + to_uv_[2], to_uv_[3] * uv.x + to_uv_[4] * uv.y + to_uv_[5]};
  Cell c;
  if (nearest_) {
    c.x0 = c.x1 = wrap(floor_int(t.x * static_cast<float>(width_)), width_, clamp_);
    c.y0 = c.y1 = wrap(floor_int(t.y * static_cast<float>(height_)), height_, clamp_);
    c.fx = c.fy = 0.0f;
    return c;
  }
  const float x = t.x * static_cast<float>(width_) - 0.5f, y = t.y * static_cast<float>(height_) - 0.5f;
  const int ix = floor_int(x), iy = floor_int(y);
  const auto fraction = [](float f) { return f > 0.0f ? std::min(f, 1.0f) : 0.0f; };  // 0 for NaN
  c.fx = fraction(x - static_cast<float>(ix));
  c.fy = fraction(y - static_cast<float>(iy));
  c.x0 = wrap(ix, width_, clamp_);
  c.x1 = wrap(ix + 1, width_, clamp_);
  c.y0 = wrap(iy, height_, clamp_);
  c.y1 = wrap(iy + 1, height_, clamp_);
  return c;
}

Vec3f CompactTexture::evaluate(Vec2f uv) const {
  const Cell c = cell(uv);
  if (nearest_) return color(texel(c.x0, c.y0));
  const Vec3f top = lerp(color(texel(c.x0, c.y0)), color(texel(c.x1, c.y0)), Vec3f(c.fx));
  const Vec3f bottom = lerp(color(texel(c.x0, c.y1)), color(texel(c.x1, c.y1)), Vec3f(c.fx));
  return lerp(top, bottom, Vec3f(c.fy));
}

void CompactTexture::prefetch(Vec2f uv) const {
  const Cell c = cell(uv);
  __builtin_prefetch(&texel(c.x0, c.y0));
  __builtin_prefetch(&texel(c.x1, c.y0));
  __builtin_prefetch(&texel(c.x0, c.y1));
  __builtin_prefetch(&texel(c.x1, c.y1));
}

}  // namespace octrad
