#include "octrad/scene/texture.h"

namespace octrad {

TextureView texture_view(const Texture& texture) {
  TextureView view;
  static_cast<TextureSettings&>(view) = texture;
  view.pixels = texture.pixels.data();
  return view;
}

Vec3f evaluate(const Texture& texture, Vec2f uv) { return evaluate_texture(texture_view(texture), uv); }
Vec2f gradient(const Texture& texture, Vec2f uv) { return texture_gradient(texture_view(texture), uv); }

}  // namespace octrad
