#include "app/report/image_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <span>

#include "app/report/image_page_assets.h"
#include "octrad/base/error.h"
#include "octrad/base/escape.h"
#include "octrad/base/half.h"
#include "octrad/image/tonemap.h"

namespace octrad::report {
namespace {

// Means of blocks of factor x factor pixels; what does not fill a block at the right and the bottom is left out.
Image smaller(const Image& rgb, int factor) {
  if (factor == 1) return rgb;
  Image out(rgb.width / factor, rgb.height / factor, {"R", "G", "B"});
  for (int y = 0; y < out.height; ++y) {
    for (int x = 0; x < out.width; ++x) {
      Vec3f sum(0.0f);
      for (int v = 0; v < factor; ++v) {
        for (int u = 0; u < factor; ++u) sum = sum + rgb.rgb(x * factor + u, y * factor + v);
      }
      out.set_rgb(x, y, sum / static_cast<float>(factor * factor));
    }
  }
  return out;
}

// Half floats, little-endian; what is out of their range becomes the largest.
std::string pixels(const Image& rgb) {
  std::vector<std::uint8_t> bytes;
  bytes.reserve(rgb.data.size() * 2);
  for (const float v : rgb.data) {
    const std::uint16_t half = to_half(v != v ? v : std::clamp(v, -kLargestHalf, kLargestHalf)).bits;
    bytes.push_back(static_cast<std::uint8_t>(half & 255u));
    bytes.push_back(static_cast<std::uint8_t>(half >> 8));
  }
  return base64(bytes);
}

}  // namespace

std::string base64(const std::vector<std::uint8_t>& bytes) {
  static const char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const auto byte = [&](std::size_t k) { return i + k < bytes.size() ? static_cast<unsigned>(bytes[i + k]) : 0u; };
    const unsigned word = byte(0) << 16 | byte(1) << 8 | byte(2);
    for (unsigned k = 0; k < 4; ++k) out += i + k > bytes.size() ? '=' : kDigits[word >> (18 - 6 * k) & 63u];
  }
  return out;
}

std::string viewer_head() {
  const auto ramp = [](std::span<const Vec3f> colors) {
    std::string list;
    for (const Vec3f c : colors) list += fmt::format("{}[{:g}, {:g}, {:g}]", list.empty() ? "" : ", ", c.x, c.y, c.z);
    return list;
  };
  std::string script = kViewerScript;
  const std::string place = "(() => {\n";
  script.insert(script.find(place) + place.size(), fmt::format("  const ramps = {{ error: [{}], signed: [{}] }};\n",
                                                               ramp(kFalseColors), ramp(kSignedColors)));
  return fmt::format("<style>\n{}</style>\n<script>\n{}</script>\n", kViewerStyle, script);
}

std::string viewer_html(const std::string& id, const std::vector<PageImage>& images, bool has_reference,
                        int largest_side) {
  if (images.empty()) throw InputError("a viewer needs a picture");
  const int width = images[0].image.width, height = images[0].image.height;
  const int longer = std::max(width, height);
  const int factor = largest_side > 0 ? (longer + largest_side - 1) / largest_side : 1;
  if (std::min(width, height) < factor) throw InputError("a picture is too narrow for the viewer");
  std::string out = fmt::format(
      "<figure class=\"octrad-viewer\" id=\"{}\" data-width=\"{}\" data-height=\"{}\" data-reference=\"{}\">\n", id,
      width / factor, height / factor, has_reference ? 1 : 0);
  for (const PageImage& picture : images) {
    if (picture.image.width != width || picture.image.height != height)
      throw InputError(fmt::format("{}: pictures of one viewer have one size", picture.name));
    out += fmt::format("<script type=\"text/plain\" data-name=\"{}\" data-caption=\"{}\">{}</script>\n",
                       markup_text(picture.name), markup_text(picture.caption),
                       pixels(smaller(linear_color(picture.image), factor)));
  }
  return out + "<noscript>The pictures need JavaScript.</noscript>\n</figure>\n";
}

std::string page_html(const std::string& title, const std::string& body) {
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{}</title>\n{}</head>\n"
      "<body>\n{}</body>\n</html>\n",
      markup_text(title), viewer_head(), body);
}

}  // namespace octrad::report
