// Bitmaps as shading reads them: one byte a channel in tiles of a cache line. Look-ups of large textures wait for
// memory; a bilinear one touches 1.6 lines here instead of 2 to 4, and pictures take a third of the space.
#pragma once

#include <memory>
#include <vector>

#include "octrad/scene/texture.h"

namespace octrad {

class CompactTexture {
 public:
  // nullptr where it would not be faster or not exact: constants, checkerboards, small pictures, mirrored wrapping, and
  // pictures of more than 256 different values (all 8-bit files have fewer).
  static std::unique_ptr<CompactTexture> make(const Texture& texture);

  CompactTexture() = default;
  CompactTexture(const CompactTexture&) = delete;
  CompactTexture& operator=(const CompactTexture&) = delete;

  // Starts loading what evaluate_texture(view, uv) will read, of a view with tiles.
  static void prefetch(const TextureView& view, Vec2f uv);
  const TextureView& view() const { return view_; }

 private:
  float palette_[kPaletteSize] = {};
  std::vector<TexelTile> tiles_;
  TextureView view_;
};

}  // namespace octrad
