#include "octrad/shading/compact_texture.h"

#include <algorithm>
#include <bit>

#include "octrad/base/error.h"
#include "octrad/base/memory_limit.h"
#include "octrad/base/prefetch.h"

namespace octrad {
namespace {

// Values of a picture -> index below 256, by open addressing.
class Palette {
 public:
  Palette() : keys_(kSize, 0), index_(kSize, -1) {}
  // -1 when there are too many.
  int index(float value) {
    const std::uint32_t bits = std::bit_cast<std::uint32_t>(value);
    std::uint32_t slot = (bits * 2654435761u) >> (32 - kBits);
    while (index_[slot] >= 0 && keys_[slot] != bits) slot = (slot + 1) & (kSize - 1);
    if (index_[slot] < 0) {
      if (values.size() == kPaletteSize) return -1;
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

constexpr std::size_t kSmallest = 64 * 64;

}  // namespace

std::unique_ptr<CompactTexture> CompactTexture::make(const Texture& t) {
  if (t.kind != Texture::Kind::bitmap || t.wrap == Texture::Wrap::mirror || t.pixels.size() < kSmallest) return nullptr;
  const auto columns = static_cast<std::size_t>((t.width + 3) / 4),
             tiles = columns * static_cast<std::size_t>((t.height + 3) / 4);
  const MemoryScope scope;
  try {
    ask_memory(tiles * sizeof(TexelTile), "a texture");
  } catch (const MemoryError&) {
    return nullptr;  // the texture's own pixels are there
  }
  auto out = std::make_unique<CompactTexture>();
  out->tiles_.resize(tiles);
  Palette palette;
  for (int y = 0; y < t.height; ++y) {
    const Vec3f* row = t.pixels.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(t.width);
    for (int x = 0; x < t.width; ++x) {
      const int r = palette.index(row[x].x), g = palette.index(row[x].y), b = palette.index(row[x].z);
      if (r < 0 || g < 0 || b < 0) return nullptr;
      out->tiles_[static_cast<std::size_t>(y >> 2) * columns + static_cast<std::size_t>(x >> 2)]
          .texels[(y & 3) * 4 + (x & 3)] = {static_cast<std::uint8_t>(r), static_cast<std::uint8_t>(g),
                                            static_cast<std::uint8_t>(b), 0};
    }
  }
  std::copy(palette.values.begin(), palette.values.end(), out->palette_);
  static_cast<TextureSettings&>(out->view_) = t;
  out->view_.tiles = out->tiles_.data();
  out->view_.palette = out->palette_;
  out->view_.columns = static_cast<int>(columns);
  return out;
}

void CompactTexture::prefetch(const TextureView& view, Vec2f uv) {
  const TexelCell c = texel_cell(view, uv);
  prefetch_line(&texel_indices(view, c.x0, c.y0));
  prefetch_line(&texel_indices(view, c.x1, c.y0));
  prefetch_line(&texel_indices(view, c.x0, c.y1));
  prefetch_line(&texel_indices(view, c.x1, c.y1));
}

}  // namespace octrad
