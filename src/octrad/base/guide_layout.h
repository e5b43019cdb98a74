// Sizes of the tables that directions are drawn by (transport/direction_guide_math.h), which files hold as well.
#pragma once

#include <cstddef>

namespace octrad {

// kGuideSide^3 places with a table for surfaces along each of kGuideAxes directions.
inline constexpr int kGuideSide = 8, kGuideAxes = 6, kGuideTables = kGuideSide * kGuideSide * kGuideSide * kGuideAxes;
// Rows of equal height along z, columns around it.
inline constexpr int kGuideRows = 8, kGuideColumns = 16, kGuideParts = kGuideRows * kGuideColumns;
// Size of all tables: rows, columns and means in floats; squares and three more sums in eight bytes each.
inline constexpr std::size_t kGuideBytes =
    static_cast<std::size_t>(kGuideTables) * (4 * (kGuideRows + kGuideParts + 1) + 8 * (kGuideParts + 3));

}  // namespace octrad
