// octrad query: evaluates a model at given surface points.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <optional>

#include "app/cli/common.h"
#include "octrad/base/atomic_file.h"
#include "octrad/base/bytes.h"
#include "octrad/base/duration.h"
#include "octrad/base/error.h"
#include "octrad/base/join.h"
#include "octrad/base/log.h"
#include "octrad/base/stopwatch.h"
#include "octrad/base/threads.h"
#include "octrad/model/device_query.h"
#include "octrad/model/model_file.h"

namespace octrad::cli {
namespace {

struct QueryOptions {
  std::string model, points, output;
};

constexpr std::size_t kBlock =
    1024;  // points: small enough to stay in cache, large enough for whole tiles of the kernels

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

// Columns of a file for a field that wants `rays` traced: without a scene what they met is given, cluster by cluster.
std::vector<std::string> columns_for(const QueryRays& rays) {
  std::vector<std::string> names(kColumns.begin(), kColumns.end());
  for (int k = 0; rays.lobe > 0 && k < rays.clusters; ++k) {
    for (const char* of : {"t", "s", "n"}) names.push_back(of + std::to_string(k));
  }
  return names;
}

// Surface points of a CSV file: a header with the columns' names in any order (others are ignored), a point a line.
std::vector<SurfacePoint> read_points(const std::string& file, const QueryRays& rays) {
  const std::string text = read_text_file(file);
  const std::vector<std::string> names = columns_for(rays);
  std::vector<SurfacePoint> points;
  std::vector<std::size_t> column(names.size());
  std::size_t begin = 0, columns = 0;
  int line_number = 0;
  const auto refuse = [&](const std::string& why) {
    throw InputError(fmt::format("{}:{}: {}", file, line_number, why));
  };
  while (begin < text.size()) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const std::string line = text.substr(begin, end - begin);
    begin = end + 1;
    ++line_number;
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    const std::vector<std::string> cells = split_line(line);
    if (columns == 0) {
      columns = cells.size();
      for (std::size_t i = 0; i < names.size(); ++i) {
        const auto found = std::find(cells.begin(), cells.end(), names[i]);
        if (found == cells.end())
          refuse(fmt::format("the header lacks the column \"{}\"; expected {}{}", names[i], join(names, ","),
                             i < kColumns.size() ? ""
                                                 : ": this field takes what rays met (distance t, deviation s and "
                                                   "share n of each cluster), which a file of points cannot trace"));
        column[i] = static_cast<std::size_t>(found - cells.begin());
      }
      continue;
    }
    if (cells.size() != columns) refuse(fmt::format("{} cells where the header has {}", cells.size(), columns));
    std::vector<float> v(names.size());
    for (std::size_t i = 0; i < v.size(); ++i) {
      const std::string& cell = cells[column[i]];
      char* stop = nullptr;
      v[i] = std::strtof(cell.c_str(), &stop);
      if (cell.empty() || *stop != '\0' || !std::isfinite(v[i]))
        refuse(fmt::format("column {}: \"{}\" is not a finite number", names[i], cell));
    }
    SurfacePoint p;
    p.x = {v[0], v[1], v[2]};
    p.wo = {v[3], v[4], v[5]};
    p.n = {v[6], v[7], v[8]};
    p.albedo = {v[9], v[10], v[11]};
    p.alpha = v[12];
    for (std::size_t i = kColumns.size(); i < v.size(); i += 3) {
      if (v[i] < 0.0f || v[i + 1] < 0.0f || v[i + 2] < 0.0f || v[i + 2] > 1.0f)
        refuse(fmt::format("columns {},{},{}: expected a distance and a deviation of at least 0 and a share in 0 ... 1",
                           names[i], names[i + 1], names[i + 2]));
      p.lobe[(i - kColumns.size()) / 3] = {v[i], v[i + 1], v[i + 2]};
    }
    for (const auto& [name, d] : {std::pair{"wo", p.wo}, std::pair{"n", p.n}}) {
      if (std::abs(length(d) - 1.0f) > 1e-2f)
        refuse(fmt::format("{} has length {:.3g}: a unit vector is needed", name, length(d)));
    }
    points.push_back(p);
  }
  if (columns == 0) throw InputError(file + ": is empty; the first line names the columns");
  return points;
}

void query_verb(const CommonOptions& common, const QueryOptions& o) {
  if (o.output.empty() && common.json) throw UsageError("--json needs -o: standard output cannot hold both");
  if (!o.output.empty()) require_writable(o.output);
  refuse_input_as_output("-o", o.output, {o.model, o.points});
  const Model model = load_model(o.model);
  const DeviceChoice device = common.choose_device(model.info.config.field);
  const std::unique_ptr<Stream> stream = device.make_stream();
  const std::vector<SurfacePoint> points = read_points(o.points, query_rays(model.info.config));
  RadianceField& field = *model.field;
  if (model.info.config.lookup_offset == LookupOffset::traced && model.field->uses_disparity())
    log_warning("the model was trained with lookup.offset = traced; without a scene the disparity is taken as 0");

  const Stopwatch watch;
  const auto features = static_cast<std::size_t>(field.feature_count());
  std::vector<std::string> text((points.size() + kBlock - 1) / kBlock);
  const auto write = [&](std::size_t begin, std::size_t n, const float* h, const float* disparity,
                         const Vec3f* radiance) {
    std::string& out = text[begin / kBlock];
    for (std::size_t i = 0; i < n; ++i) {
      fmt::format_to(std::back_inserter(out), "{:.9g}", disparity[i]);
      for (std::size_t f = 0; f < features; ++f)
        fmt::format_to(std::back_inserter(out), ",{:.9g}", h[i * features + f]);
      fmt::format_to(std::back_inserter(out), ",{:.9g},{:.9g},{:.9g}\n", radiance[i].x, radiance[i].y, radiance[i].z);
    }
  };
  if (stream) {
    const FieldAnswers answers =
        ask_on_stream(*stream, field, model.info.config, points, common.memory_budget(*stream));
    parallel_blocks(points.size(), kBlock, [&](std::size_t begin, std::size_t end) {
      write(begin, end - begin, &answers.features[begin * features], &answers.disparity[begin],
            &answers.radiance[begin]);
    });
  } else {
    parallel_blocks(points.size(), kBlock, [&](std::size_t begin, std::size_t end) {
      const std::size_t n = end - begin;
      const std::span<const SurfacePoint> block(points.data() + begin, n);
      std::vector<float> h(n * features), disparity(n);
      std::vector<Vec3f> radiance(n);
      field.inspect(block, h, disparity);
      field.radiance(block, radiance);
      write(begin, n, h.data(), disparity.data(), radiance.data());
    });
  }
  const double seconds = watch.seconds();

  std::string header = "disparity";
  for (std::size_t f = 0; f < features; ++f) header += fmt::format(",f{}", f);
  header += ",r,g,b\n";
  if (o.output.empty()) {
    for (const std::string& block : text) header += block;
    print_text(header);
    return;
  }
  AtomicFile out(o.output);
  out.write(header);
  for (const std::string& block : text) out.write(block);
  out.commit();
  nlohmann::json report = {{"points", points.size()},
                           {"features", features},
                           {"output", o.output},
                           {"seconds", seconds},
                           {"device", device.name}};
  if (stream) report["device_peak_bytes"] = stream->peak_bytes();
  if (common.json) print_json(report);
  else
    log_info("{}: {} points in {}", o.output, format_count(static_cast<long long>(points.size())),
             format_duration(seconds));
}

}  // namespace

void add_query(Program& program) {
  auto o = std::make_shared<QueryOptions>();
  CLI::App* verb = add_verb(program, "query", "Evaluate a model at surface points.",
                            "octrad query room.octrad --points in.csv -o out.csv", Devices::cuda);
  verb->add_option("model", o->model, "trained cache")->required()->type_name("MODEL.octrad");
  verb->add_option("--points", o->points,
                   "CSV with the columns x,y,z,wox,woy,woz,nx,ny,nz,ar,ag,ab,alpha; field ncr: more")
      ->required()
      ->type_name("IN.csv");
  verb->add_option("-o,--output", o->output, "CSV with disparity, features and radiance; default: standard output")
      ->type_name("OUT.csv");
  verb->callback([&program, o] { program.run = [&program, o] { query_verb(program.common, *o); }; });
}

}  // namespace octrad::cli
