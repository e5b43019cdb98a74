#include "octrad/image/image.h"

#include <algorithm>

#include "octrad/base/error.h"
#include "octrad/base/join.h"

namespace octrad {

int Image::channel(const std::string& name) const {
  const auto found = std::find(channels.begin(), channels.end(), name);
  return found == channels.end() ? -1 : static_cast<int>(found - channels.begin());
}

Image extract_rgb(const Image& image, const std::string& layer) {
  const std::string prefix = layer.empty() ? "" : layer + ".";
  int index[3];
  const char* names[3] = {"R", "G", "B"};
  const char* axes[3] = {"X", "Y", "Z"};
  const bool is_vector = image.channel(prefix + "X") >= 0;
  for (int c = 0; c < 3; ++c) {
    index[c] = image.channel(prefix + (is_vector ? axes[c] : names[c]));
    if (index[c] < 0) index[c] = image.channel(prefix + "Y");
    if (index[c] < 0) {
      throw InputError("picture has no " + (layer.empty() ? std::string("colour") : "layer \"" + layer + "\"") +
                       ": needs " + prefix + "R, " + prefix + "G and " + prefix + "B, or " + prefix + "Y; it has " +
                       join(image.channels));
    }
  }
  Image out(image.width, image.height, {"R", "G", "B"});
  out.metadata = image.metadata;
  for (std::size_t p = 0, n = image.pixel_count(), stride = image.channels.size(); p < n; ++p) {
    for (std::size_t c = 0; c < 3; ++c)
      out.data[3 * p + c] = image.data[p * stride + static_cast<std::size_t>(index[c])];
  }
  return out;
}

}  // namespace octrad
