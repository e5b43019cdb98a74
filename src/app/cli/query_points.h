// The points that octrad query is asked at.
#pragma once

#include <string>
#include <vector>

#include "octrad/model/radiance_field.h"

namespace octrad::cli {

// Surface points of a CSV file: a header with the columns' names in any order (others are ignored), a point a line. For
// a field that wants `rays` traced, what they met is given in more columns. Throws InputError as FILE:LINE, IoError.
std::vector<SurfacePoint> read_points(const std::string& file, const QueryRays& rays);
// The same of a file's content.
std::vector<SurfacePoint> parse_points(const std::string& file, const std::string& text, const QueryRays& rays);

}  // namespace octrad::cli
