#include "octrad/image/contact_sheet.h"

#include <algorithm>
#include <cassert>

#include "octrad/image/io_internal.h"
#include "octrad/image/text.h"

namespace octrad {
namespace {

constexpr std::uint8_t kBackground = 32;

void copy_into(Image8& sheet, const Image8& image, int left, int top) {
  for (int y = 0; y < image.height; ++y) {
    const auto row = image.data.begin() + static_cast<std::ptrdiff_t>(y) * image.width * 3;
    std::copy(row, row + static_cast<std::ptrdiff_t>(image.width) * 3,
              sheet.data.begin() + (static_cast<std::ptrdiff_t>(top + y) * sheet.width + left) * 3);
  }
}

// The number of columns whose sheet of n cells is nearest to a square.
int square_columns(int n, int cell_width, int cell_height) {
  const auto longer_side = [&](int columns) {
    return std::max(static_cast<long long>(columns) * cell_width,
                    static_cast<long long>((n + columns - 1) / columns) * cell_height);
  };
  int best = 1;
  for (int columns = 2; columns <= n; ++columns) {
    if (longer_side(columns) < longer_side(best)) best = columns;
  }
  return best;
}

}  // namespace

Image8 contact_sheet(const std::vector<LabelledImage>& pictures, int columns) {
  assert(!pictures.empty());
  int width = 0, height = 0;
  for (const auto& [image, label] : pictures) {
    assert(image.channels == 3);
    width = std::max(width, image.width);
    height = std::max(height, image.height);
  }
  const int scale = std::clamp(width / 200, 1, 16);
  const int gap = 4 * scale, cell_width = width + gap, cell_height = height + text_height(scale) + 2 * gap;
  const int n = static_cast<int>(pictures.size());
  columns = columns > 0 ? std::min(columns, n) : square_columns(n, cell_width, cell_height);
  const int rows = (n + columns - 1) / columns;
  const long long sheet_width = static_cast<long long>(columns) * cell_width + gap,
                  sheet_height = static_cast<long long>(rows) * cell_height + gap;
  image_io::check_size("the contact sheet", sheet_width, sheet_height, 3);

  Image8 sheet(static_cast<int>(sheet_width), static_cast<int>(sheet_height), 3);
  std::fill(sheet.data.begin(), sheet.data.end(), kBackground);
  for (int i = 0; i < n; ++i) {
    const auto& [image, label] = pictures[static_cast<std::size_t>(i)];
    const int left = gap + i % columns * cell_width, top = gap + i / columns * cell_height;
    copy_into(sheet, image, left + (width - image.width) / 2, top + (height - image.height) / 2);
    const std::string text = fit_text(label, scale, width);
    draw_text(sheet, left + (width - text_width(text, scale)) / 2, top + height + gap / 2, scale, text);
  }
  return sheet;
}

}  // namespace octrad
