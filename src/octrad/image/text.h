// Small text in pictures: a fixed-width bitmap font of 5 x 8 pixels for printable ASCII; other characters show as '?'.
#pragma once

#include <cstdint>
#include <string>

#include "octrad/image/image.h"

namespace octrad {

// Size on the picture in pixels; `scale` is the side of a dot of the font.
int text_width(const std::string& text, int scale);
int text_height(int scale);
// `text` as it can be drawn, cut with ".." where it is wider than `width` pixels.
std::string fit_text(const std::string& text, int scale, int width);

// Sets every channel of the dots of `text` to `value`; (x, y) is the upper left corner. What lies outside is cut off.
void draw_text(Image8& image, int x, int y, int scale, const std::string& text, std::uint8_t value = 255);

}  // namespace octrad
