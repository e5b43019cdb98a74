// octrad query: evaluates a model at given surface points.
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

#include "app/cli/common.h"
#include "app/cli/open_scene.h"
#include "app/cli/query_points.h"
#include "octrad/base/atomic_file.h"
#include "octrad/base/bytes.h"
#include "octrad/base/duration.h"
#include "octrad/base/error.h"
#include "octrad/base/log.h"
#include "octrad/base/memory_limit.h"
#include "octrad/base/stopwatch.h"
#include "octrad/base/threads.h"
#include "octrad/model/device_query.h"
#include "octrad/model/model_file.h"
#include "octrad/transport/follow_math.h"
#include "octrad/transport/prepared_scene.h"

namespace octrad::cli {
namespace {

struct QueryOptions {
  std::string model, points, output, scene;
  bool force = false;
  ConfigOptions definitions;
};

constexpr std::size_t kBlock =
    1024;  // points: small enough to stay in cache, large enough for whole tiles of the kernels

// Traces the offsets of points whose look-ups have one. Says in which scene; empty: the one that the model names is not
// there, and they stay 0.
std::string trace_offsets(const CommonOptions& common, const QueryOptions& o, const ModelInfo& info,
                          const OffsetRay& offset, QueryPoints& asked) {
  const std::string file = o.scene.empty() ? info.scene_file : o.scene;
  const auto definitions = o.definitions.scene_definitions();
  try {
    refuse_input_as_output("-o", o.output, {file});
    const PreparedScene scene(open_scene(file, definitions, common.permissive, {{"-o", o.output}}));
    check_scene(o.model, info, file, scene.fingerprint(), o.force);
    const TransportContext context = scene.context();
    parallel_blocks(asked.points.size(), kBlock, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i)
        trace_offset(context, offset, asked.geometric_normals[i], asked.points[i]);
    });
    return file;
  } catch (const UsageError&) {
    throw;
  } catch (const Error& error) {
    if (!o.scene.empty() || !definitions.empty()) throw;
    log_warning(fmt::format(
        "{}: glossy points are looked up with what rays meet (lookup.offset = traced), which is taken as nothing here: {}; "
        "--scene says where the scene is",
        o.model, error.what()));
    return "";
  }
}

void query_verb(const CommonOptions& common, const QueryOptions& o) {
  if (o.output.empty() && common.json) throw UsageError("--json needs -o: standard output cannot hold both");
  if (!o.output.empty()) require_writable(o.output);
  refuse_input_as_output("-o", o.output, {o.model, o.points, o.scene});
  o.definitions.refuse_config_definitions("a query has no configuration keys; the model fixes them");
  const Model model = load_model(o.model);
  const DeviceChoice device = common.choose_device(model.info.config.field);
  const std::unique_ptr<Stream> stream = device.make_stream(o.definitions.tuning());
  const QueryRays rays = query_rays(model.info.config);
  QueryPoints asked = read_points(o.points, rays);
  std::vector<SurfacePoint>& points = asked.points;
  const auto has_offset = [&](const SurfacePoint& p) { return rays.offset.rule.has_offset(p.alpha); };
  std::string scene;
  if (rays.offset.traced && !asked.has_offsets && std::any_of(points.begin(), points.end(), has_offset))
    scene = trace_offsets(common, o, model.info, rays.offset, asked);
  else if (!o.scene.empty() || !o.definitions.scene_definitions().empty())
    log_warning("--scene and -D are not used: no offset of these points is traced");
  RadianceField& field = *model.field;

  const Stopwatch watch;
  const auto features = static_cast<std::size_t>(field.feature_count());
  constexpr std::size_t kCharacters = 16;  // of a number: -1.23456789e-05,
  ask_memory(points.size() * (features + 4) * (kCharacters + (stream ? sizeof(float) : 0)), o.points + ": its answer");
  std::vector<std::string> text((points.size() + kBlock - 1) / kBlock);
  const auto write = [&](std::size_t begin, std::size_t n, const float* h, const float* disparity,
                         const Vec3f* radiance) {
    std::string& out = text[begin / kBlock];
    out.reserve(n * (features + 4) * kCharacters);
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
    std::fputs(header.c_str(), stdout);
    for (const std::string& block : text) std::fwrite(block.data(), 1, block.size(), stdout);
    flush_stdout();
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
  if (!scene.empty()) report["scene"] = scene;
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
  verb->add_option(
          "--scene", o->scene,
          "scene that offsets of glossy points are traced in (lookup.offset = traced); default: the file that the "
          "model was trained with. Not needed where the points have columns of them")
      ->type_name("SCENE");
  add_force_option(*verb, o->force);
  o->definitions.add_definitions_to(*verb);
  add_permissive_option(*verb, program.common);
  verb->add_option("-o,--output", o->output, "CSV with disparity, features and radiance; default: standard output")
      ->type_name("OUT.csv");
  verb->callback([&program, o] { program.run = [&program, o] { query_verb(program.common, *o); }; });
}

}  // namespace octrad::cli
