// The points that octrad query is asked at.
#pragma once

#include <string>
#include <vector>

#include "octrad/base/query_rays.h"
#include "octrad/model/radiance_field.h"

namespace octrad::cli {

struct QueryPoints {
  std::vector<SurfacePoint> points;
  bool has_offsets = false;  // the file has the columns
  // Where offsets are to be traced: of the points' surfaces, or their shading normals where the file has no others.
  std::vector<Vec3f> geometric_normals;
};

// Surface points of a CSV file: a header with the columns' names in any order (others are ignored), a point a line. For
// a field that wants `rays` traced, what those of the BSDF met is given in more columns; that of the offset may be, as
// "disparity" and, if the field takes it, what is reflected, as "met,ralpha,rnx,rny,rnz,rar,rag,rab,rer,reg,reb"; or
// the geometric normal that it is traced with, as "ngx,ngy,ngz". Throws InputError as FILE:LINE, IoError.
QueryPoints read_points(const std::string& file, const QueryRays& rays);
// The same of a file's content.
QueryPoints parse_points(const std::string& file, const std::string& text, const QueryRays& rays);

}  // namespace octrad::cli
