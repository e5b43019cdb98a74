#include "octrad/scene/texture.h"

namespace octrad {

TextureView texture_view(const Texture& texture) {
  TextureView view;
  static_cast<TextureSettings&>(view) = texture;
  view.pixels = texture.pixels.data();
  return view;
}

}  // namespace octrad
