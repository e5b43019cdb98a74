#include "app/cli/query_points.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

#include "octrad/base/error.h"
#include "octrad/base/escape.h"
#include "octrad/base/input_file.h"
#include "octrad/base/join.h"
#include "octrad/base/memory_limit.h"
#include "octrad/scene/limits.h"

namespace octrad::cli {
namespace {

constexpr std::array<const char*, 13> kColumns = {"x",  "y",  "z",  "wox", "woy", "woz",  "nx",
                                                  "ny", "nz", "ar", "ag",  "ab",  "alpha"};

std::vector<std::string> split_line(const std::string& line) {
  std::vector<std::string> cells;
  std::size_t begin = 0;
  while (true) {
    const std::size_t comma = line.find(',', begin);
    std::string cell = line.substr(begin, comma == std::string::npos ? std::string::npos : comma - begin);
    cell.erase(0, std::min(cell.find_first_not_of(" \t\r"), cell.size()));
    cell.erase(cell.find_last_not_of(" \t\r") + 1);
    cells.push_back(std::move(cell));
    if (comma == std::string::npos) return cells;
    begin = comma + 1;
  }
}

// What a ray of the offset met, SurfacePoint::disparity and, if the field takes it, SurfacePoint::reflected.
std::vector<std::string> offset_columns(const OffsetRay& offset) {
  std::vector<std::string> names = {"disparity"};
  if (offset.reflected) {
    for (const char* name : {"met", "ralpha", "rnx", "rny", "rnz", "rar", "rag", "rab", "rer", "reg", "reb"})
      names.emplace_back(name);
  }
  return names;
}

// Columns of a file for a field that wants `rays` traced: without a scene what they met is given, cluster by cluster.
std::vector<std::string> columns_for(const QueryRays& rays) {
  std::vector<std::string> names(kColumns.begin(), kColumns.end());
  for (int k = 0; rays.lobe > 0 && k < rays.clusters; ++k) {
    for (const char* of : {"t", "s", "n"}) names.push_back(of + std::to_string(k));
  }
  return names;
}

}  // namespace

QueryPoints read_points(const std::string& file, const QueryRays& rays) {
  return parse_points(file, read_file(file), rays);
}

QueryPoints parse_points(const std::string& file, const std::string& text, const QueryRays& rays) {
  std::vector<std::string> names = columns_for(rays);
  const std::size_t required = names.size();
  QueryPoints result;
  std::vector<SurfacePoint>& points = result.points;
  std::vector<std::size_t> column;
  // Some programs write the mark of UTF-8 first.
  std::size_t begin = text.starts_with("\xef\xbb\xbf") ? 3 : 0, columns = 0;
  int line_number = 0;
  bool has_normals = false;
  const auto refuse = [&](const std::string& why) {
    throw InputError(fmt::format("{}:{}: {}", file, line_number, why));
  };
  while (begin < text.size()) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const std::string line = text.substr(begin, end - begin);
    begin = end + 1;
    ++line_number;
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    constexpr std::size_t kLongLine = 1 << 16;
    if (line.size() > kLongLine)
      ask_memory(static_cast<std::uint64_t>(std::count(line.begin(), line.end(), ',')) * 3 * sizeof(std::string), file);
    const std::vector<std::string> cells = split_line(line);
    if (columns == 0) {
      columns = cells.size();
      const auto find_column = [&](const std::string& name) {
        const auto found = std::find(cells.begin(), cells.end(), name);
        if (found != cells.end() && std::find(found + 1, cells.end(), name) != cells.end())
          refuse(fmt::format("the header has the column \"{}\" twice", name));
        if (found != cells.end()) column.push_back(static_cast<std::size_t>(found - cells.begin()));
        return found != cells.end();
      };
      for (std::size_t i = 0; i < required; ++i) {
        if (!find_column(names[i]))
          refuse(fmt::format("the header lacks the column \"{}\"; expected {}{}", names[i], join(names, ","),
                             i < kColumns.size() ? ""
                                                 : ": this field takes what rays met (distance t, deviation s and "
                                                   "share n of each cluster), which a file of points cannot trace"));
      }
      if (!rays.offset.traced) continue;
      const std::vector<std::string> offset = offset_columns(rays.offset);
      std::string missing;
      for (const std::string& name : offset) {
        if (find_column(name)) names.push_back(name);
        else if (missing.empty()) missing = name;
      }
      result.has_offsets = names.size() == required + offset.size();
      if (result.has_offsets) continue;
      if (names.size() > required)
        refuse(
            fmt::format("the header lacks the column \"{}\"; what the ray of an offset met needs {}, or none of them",
                        missing, join(offset, ",")));
      for (const char* name : {"ngx", "ngy", "ngz"}) {
        if (find_column(name)) names.emplace_back(name);
      }
      has_normals = names.size() == required + 3;
      if (!has_normals && names.size() > required)
        refuse("the header has some of the columns ngx,ngy,ngz; a normal needs all");
      continue;
    }
    if (cells.size() != columns) refuse(fmt::format("{} cells where the header has {}", cells.size(), columns));
    std::vector<float> v(names.size());
    for (std::size_t i = 0; i < v.size(); ++i) {
      const std::string& cell = cells[column[i]];
      char* stop = nullptr;
      v[i] = std::strtof(cell.c_str(), &stop);
      if (cell.empty() || stop != cell.c_str() + cell.size() || !std::isfinite(v[i]))
        refuse(fmt::format("column {}: \"{}\" is not a finite number", names[i], printable(cell.substr(0, 40))));
    }
    SurfacePoint p;
    p.x = {v[0], v[1], v[2]};
    p.wo = {v[3], v[4], v[5]};
    p.n = {v[6], v[7], v[8]};
    p.albedo = {v[9], v[10], v[11]};
    p.alpha = v[12];
    if (result.has_offsets) p.disparity = v[required];
    if (p.disparity < 0.0f) refuse("column disparity: expected a number of at least 0");
    if (result.has_offsets && rays.offset.reflected) {
      const float* r = &v[required + 1];
      p.reflected = {r[0], r[1], {r[2], r[3], r[4]}, {r[5], r[6], r[7]}, {r[8], r[9], r[10]}};
      if ((r[0] != 0.0f && r[0] != 1.0f) || *std::min_element(r + 5, r + 11) < 0.0f || r[1] < 0.0f)
        refuse(
            "columns met,ralpha,rar,...,reb: expected 0 or 1, and a roughness, an albedo and an emission of at least 0");
      if (r[0] == 1.0f && std::abs(length(p.reflected.n) - 1.0f) > 1e-2f)
        refuse(fmt::format("rnx,rny,rnz has length {:.3g}: a unit vector is needed", length(p.reflected.n)));
    }
    for (std::size_t i = kColumns.size(); i < required; i += 3) {
      if (v[i] < 0.0f || v[i + 1] < 0.0f || v[i + 2] < 0.0f || v[i + 2] > 1.0f)
        refuse(fmt::format("columns {},{},{}: expected a distance and a deviation of at least 0 and a share in 0 ... 1",
                           names[i], names[i + 1], names[i + 2]));
      p.lobe[(i - kColumns.size()) / 3] = {v[i], v[i + 1], v[i + 2]};
    }
    const Vec3f geometric = has_normals ? Vec3f{v[required], v[required + 1], v[required + 2]} : p.n;
    for (const auto& [name, d] : {std::pair{"wo", p.wo}, std::pair{"n", p.n}, std::pair{"ng", geometric}}) {
      if (std::abs(length(d) - 1.0f) > 1e-2f)
        refuse(fmt::format("{} has length {:.3g}: a unit vector is needed", name, length(d)));
    }
    if (!within(p.x, kLargestCameraCoordinate)) refuse("x,y,z: coordinates may be up to 1e12");
    if (min_component(p.albedo) < 0.0f || p.alpha < 0.0f)
      refuse("columns ar,ag,ab,alpha: expected an albedo and a roughness of at least 0");
    ask_to_grow(points, file);
    points.push_back(p);
    if (!rays.offset.traced || result.has_offsets) continue;
    ask_to_grow(result.geometric_normals, file);
    result.geometric_normals.push_back(geometric);
  }
  if (columns == 0) throw InputError(file + ": is empty; the first line names the columns");
  return result;
}

}  // namespace octrad::cli
