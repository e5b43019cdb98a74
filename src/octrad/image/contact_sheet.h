// Several pictures as one, side by side, each with its name below it.
#pragma once

#include <string>
#include <vector>

#include "octrad/image/image.h"

namespace octrad {

struct LabelledImage {
  Image8 image;  // RGB
  std::string label;
};

// Rows of `columns` pictures (0: as nearly square as the sheet gets) on dark grey, centred in cells of the size of the
// largest; labels are cut to their cell. Throws InputError when the sheet would have more than 131072 pixels a side.
Image8 contact_sheet(const std::vector<LabelledImage>& pictures, int columns = 0);

}  // namespace octrad
