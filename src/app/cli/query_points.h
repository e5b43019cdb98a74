// The points that octrad query is asked at.
#pragma once

#include <string>
#include <vector>

#include "octrad/model/radiance_field.h"

namespace octrad::cli {

struct QueryPoints {
  std::vector<SurfacePoint> points;
  bool has_disparity = false;  // the file has the column
};

// Surface points of a CSV file: a header with the columns' names in any order (others are ignored), a point a line. For
// a field that wants `rays` traced, what those of the BSDF met is given in more columns; that of the offset may be, as
// "disparity". Throws InputError as FILE:LINE, IoError.
QueryPoints read_points(const std::string& file, const QueryRays& rays);
// The same of a file's content.
QueryPoints parse_points(const std::string& file, const std::string& text, const QueryRays& rays);

}  // namespace octrad::cli
