// octrad render: a picture of a scene, path traced or from a trained cache.
#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "app/cli/common.h"
#include "app/cli/open_scene.h"
#include "octrad/base/atomic_file.h"
#include "octrad/base/bytes.h"
#include "octrad/base/duration.h"
#include "octrad/base/error.h"
#include "octrad/base/interrupt.h"
#include "octrad/base/log.h"
#include "octrad/base/version.h"
#include "octrad/image/io.h"
#include "octrad/model/model_file.h"
#include "octrad/render/renderer.h"
#include "octrad/scene/camera.h"

namespace octrad::cli {
namespace {

struct RenderVerbOptions {
  std::string scene, output, integrator, model;
  bool force = false;
  int spp = 0;         // 0: the integrator's own
  int max_depth = -2;  // -2: the scene's
  int rr_depth = 0;    // 0: 5
  std::string time;
  int width = 0, height = 0;
  std::string crop;
  int sensor = 0;
  bool sensor_given = false;
  std::string origin, target, up;
  double fov = 0.0;
  std::string fov_axis = "x";
  std::string camera_file;
  std::vector<std::string> definitions;
  int frames = 0;
};

// --camera, --origin ..., or a sensor of the scene. Film size: the camera's own where it has one.
Camera choose_camera(const Scene& scene, const RenderVerbOptions& o) {
  const bool look = !o.origin.empty() || !o.target.empty();
  if (look + !o.camera_file.empty() + o.sensor_given > 1)
    throw UsageError("--sensor, --camera and --origin/--target exclude each other");
  Camera camera;
  if (!o.camera_file.empty()) {
    if (o.fov > 0.0) throw UsageError(fmt::format("--fov: {} says the field of view", o.camera_file));
    const std::vector<Camera> cameras = read_cameras(o.camera_file);
    if (cameras.size() != 1)
      throw InputError(fmt::format("{}: holds {} cameras where one is needed", o.camera_file, cameras.size()));
    camera = cameras.front();
  } else if (look) {
    if (o.origin.empty() || o.target.empty()) throw UsageError("--origin and --target belong together");
    const Camera& first = scene.cameras.front();
    const bool own_fov = o.fov > 0.0;
    camera = look_at(parse_vector(o.origin, "--origin"), parse_vector(o.target, "--target"),
                     o.up.empty() ? Vec3f{0, 1, 0} : parse_vector(o.up, "--up"),
                     own_fov ? static_cast<float>(o.fov) : first.fov_degrees,
                     own_fov ? parse_fov_axis(o.fov_axis) : first.fov_axis);
    camera.near_clip = first.near_clip;
    camera.far_clip = first.far_clip;
  } else {
    if (o.sensor >= static_cast<int>(scene.cameras.size())) {
      throw UsageError(fmt::format("--sensor {}: the scene has {} (numbered from 0)", o.sensor, scene.cameras.size()));
    }
    camera = scene.cameras[static_cast<std::size_t>(o.sensor)];
    if (o.fov > 0.0) {
      camera.fov_degrees = static_cast<float>(o.fov);
      camera.fov_axis = parse_fov_axis(o.fov_axis);
    }
  }
  if (!look && !o.up.empty()) throw UsageError("--up belongs to --origin and --target");
  if (camera.film_width <= 0 || camera.film_height <= 0) {
    camera.film_width = scene.film.width;
    camera.film_height = scene.film.height;
  }
  return camera;
}

nlohmann::json camera_json(const Camera& c) {
  const auto vector = [](Vec3f v) { return nlohmann::json::array({v.x, v.y, v.z}); };
  static constexpr const char* kAxes[] = {"x", "y", "diagonal", "smaller", "larger"};
  const Vec3f target = c.origin + c.forward;
  return {{"origin", vector(c.origin)},
          {"target", vector(target)},
          {"up", vector(c.up)},
          {"fov", c.fov_degrees},
          {"fov_axis", kAxes[static_cast<int>(c.fov_axis)]}};
}

View choose_view(const Scene& scene, const RenderVerbOptions& o) {
  View view;
  view.camera = choose_camera(scene, o);
  const Vec2i size = picture_size(view.camera.film_width, view.camera.film_height, o.width, o.height);
  view.width = size.x;
  view.height = size.y;
  if (!o.crop.empty()) {
    const std::vector<double> crop = parse_numbers(o.crop, 4, "--crop");
    for (const double v : crop) {
      if (v != static_cast<double>(static_cast<int>(v)))
        throw UsageError(fmt::format("--crop \"{}\": expected whole numbers x,y,width,height", o.crop));
    }
    view.crop = {static_cast<int>(crop[0]), static_cast<int>(crop[1]), static_cast<int>(crop[2]),
                 static_cast<int>(crop[3])};
    if (view.crop.width <= 0 || view.crop.height <= 0) throw UsageError("--crop: width and height must be above 0");
  }
  return view;
}

double pixels_of(const View& view) {
  return view.crop.width > 0 ? static_cast<double>(view.crop.width) * view.crop.height
                             : static_cast<double>(view.width) * view.height;
}

// What is in memory already counts. The picture's sums are doubles, twice while tiles are merged; then the picture
// itself, in memory and while it is written.
void require_picture_memory(const CommonOptions& common, const View& view) {
  const double bytes = pixels_of(view) * (kPictureChannelCount + 1) * (2 * sizeof(double) + 2 * sizeof(float));
  require_memory(common.memory_budget(), fmt::format("a picture of {} x {} pixels", view.width, view.height),
                 {{"picture", static_cast<std::uint64_t>(bytes)},
                  {"the program, the scene and the model, in memory already", resident_bytes()}},
                 "--width, --height and --crop make the picture smaller");
}

RenderBudget choose_budget(const RenderVerbOptions& o, const IntegratorInfo& integrator) {
  RenderBudget budget;
  budget.seconds = o.time.empty() ? 0.0 : parse_duration(o.time);
  if (!o.time.empty() && budget.seconds <= 0.0) throw UsageError("--time must be above 0");
  budget.spp = o.spp > 0 ? o.spp : budget.seconds > 0.0 ? 0 : integrator.default_spp;
  budget.interrupted = [] { return interrupted(); };
  return budget;
}

// The configuration of a cached picture: the model's, with what may change after training.
Config model_config(const ModelInfo& info, const ConfigOptions& definitions) {
  Config config = info.config;
  for (const auto& [key, value] : definitions.config_definitions()) {
    if (key != "render.delta") {
      Config scratch = config;
      set(scratch, key, value);  // an unknown key is refused with a suggestion
      throw UsageError(
          fmt::format("-D {}: the model fixes this key; only render.delta can change after training", key));
    }
    set(config, key, value);
  }
  return config;
}

// Options that the integrator would ignore are refused.
void check_options(const RenderVerbOptions& o, const IntegratorInfo& integrator) {
  if (integrator.needs_model && o.model.empty())
    throw UsageError(fmt::format("--integrator {} needs --model FILE.octrad", o.integrator));
  if (!integrator.needs_model && !o.model.empty())
    throw UsageError(fmt::format("--integrator {} uses no --model", o.integrator));
  if (!integrator.uses_depth && (o.max_depth >= -1 || o.rr_depth > 0))
    throw UsageError(
        fmt::format("--integrator {} traces no paths: --max-depth and --rr-depth are for path", o.integrator));
  if (integrator.one_sample && (o.spp > 1 || !o.time.empty()))
    throw UsageError(
        fmt::format("--integrator {} takes one sample a pixel: --spp and --time are of no use", o.integrator));
  if (integrator.one_sample && o.frames > 0)
    throw UsageError(fmt::format("--integrator {} makes one picture: --frames cannot time it", o.integrator));
}

void render_verb(const CommonOptions& common, RenderVerbOptions o) {
  if (o.integrator.empty()) o.integrator = o.model.empty() ? "path" : "lhs";
  const IntegratorInfo& integrator = *find_integrator(o.integrator).info;
  check_options(o, integrator);
  picture_format(o.output);  // refuses an unknown ending
  require_writable(o.output);
  const std::unique_ptr<JsonLines> log = common.open_log();
  ConfigOptions definitions;
  definitions.definitions = o.definitions;

  std::optional<Model> model;
  if (!o.model.empty()) {
    model = load_model(o.model);
    find_integrator(o.integrator, model->field.get());
  }
  const DeviceChoice device = model ? common.choose_device(model->info.config.field) : common.choose_device();
  const std::unique_ptr<Stream> stream = device.make_stream();
  const PreparedScene prepared(open_scene(o.scene, definitions.scene_definitions()));
  const Scene& scene = prepared.scene();
  Config config;
  if (model) {
    check_scene(o.model, model->info, scene.file, scene.fingerprint, o.force);
    config = model_config(model->info, definitions);
  } else if (!definitions.config_definitions().empty()) {
    throw UsageError(fmt::format("-D {}: --integrator path has no configuration keys",
                                 definitions.config_definitions().front().first));
  }

  const View view = choose_view(scene, o);
  require_picture_memory(common, view);
  RenderBudget budget = choose_budget(o, integrator);
  RenderSettings settings;
  settings.film = scene.film;
  settings.max_depth = o.max_depth >= -1 ? o.max_depth : scene.max_depth;
  settings.rr_depth = o.rr_depth > 0 ? o.rr_depth : settings.rr_depth;
  settings.seed = static_cast<unsigned long long>(std::max(0LL, common.seed));
  settings.expected_spp = budget.spp;
  if (stream) settings.max_memory = common.memory_budget(*stream);

  if (log) {
    log->write({{"event", "start"},
                {"scene", o.scene},
                {"integrator", o.integrator},
                {"width", view.width},
                {"height", view.height},
                {"device", device.name}});
  }
  Progress progress(o.integrator);
  budget.progress = [&](int spp, double seconds) {
    const double by_samples = budget.spp > 0 ? static_cast<double>(spp) / budget.spp : 0.0;
    const double by_time = budget.seconds > 0.0 ? seconds / budget.seconds : 0.0;
    const double rate = seconds > 0.0 ? pixels_of(view) * spp / seconds : 0.0;
    if (progress.due()) {
      progress.update(std::clamp(std::max(by_samples, by_time), 0.0, 1.0),
                      fmt::format("{} spp  {} samples/s  {}", spp, format_rate(rate),
                                  format_bytes(static_cast<double>(resident_bytes()))));
    }
    if (log) log->write({{"event", "progress"}, {"spp", spp}, {"seconds", seconds}, {"samples_per_s", rate}});
  };

  defer_interrupts();  // from here on there is a picture to save
  const std::unique_ptr<Renderer> renderer =
      make_renderer(prepared, o.integrator, settings, model ? model->field.get() : nullptr, config, stream.get());
  renderer->set_view(view);
  std::optional<FrameTimes> frames;
  if (o.frames > 0) frames = renderer->time_frames(o.frames, std::max(1, budget.spp));
  RenderResult result = render(*renderer, budget);
  progress.finish();
  if (result.counts.non_finite > 0)
    log_warning(fmt::format("{} samples were not finite and count as black", format_count(result.counts.non_finite)));

  result.image.metadata["octrad.version"] = kVersion;
  result.image.metadata["octrad.scene"] =
      nlohmann::json{{"file", scene.file}, {"fingerprint", scene.fingerprint}}.dump();
  result.image.metadata["octrad.camera"] = camera_json(view.camera).dump();
  result.image.metadata["octrad.render"] = nlohmann::json{
      {"integrator", o.integrator},
      {"spp", result.spp},
      {"max_depth", integrator.uses_depth ? settings.max_depth : -1},
      {"seed", settings.seed},
      {"seconds", result.seconds}}.dump();
  if (model) {
    result.image.metadata["octrad.config"] = to_json(config).dump();
    result.image.metadata["octrad.model"] = nlohmann::json{{"file", o.model}, {"step", model->info.state.step}}.dump();
  }
  if (view.crop.width > 0) {
    result.image.metadata["dataWindow.min"] = fmt::format("{} {}", view.crop.x, view.crop.y);
    result.image.metadata["displayWindow"] = fmt::format("{} {}", view.width, view.height);
  }
  write_image(o.output, result.image);

  const double seconds = std::max(result.seconds, 1e-9);
  nlohmann::json report = {{"output", o.output},
                           {"integrator", o.integrator},
                           {"width", result.image.width},
                           {"height", result.image.height},
                           {"spp", result.spp},
                           {"seconds", result.seconds},
                           {"samples_per_s", static_cast<double>(result.samples) / seconds},
                           {"rays_per_s", static_cast<double>(result.counts.rays) / seconds},
                           {"queries_per_s", static_cast<double>(result.counts.queries) / seconds},
                           {"non_finite", result.counts.non_finite},
                           {"interrupted", result.interrupted}};
  report["device"] = device.name;
  if (stream) report["device_peak_bytes"] = stream->peak_bytes();
  if (frames) {
    report["frames"] = {{"count", o.frames},
                        {"median_ms", frames->median},
                        {"p95_ms", frames->p95},
                        {"stages_ms", stages_json(frames->stages)}};
  }
  if (log) {
    nlohmann::json done = report;
    done["event"] = "done";
    log->write(done);
  }
  if (common.json) {
    print_json(report);
  } else {
    if (frames)
      log_info("{} frames: median {:.3f} ms, 95th percentile {:.3f} ms ({})", o.frames, frames->median, frames->p95,
               format_stages(frames->stages));
    log_info("{}: {} x {}, {} spp in {} ({} samples/s{}){}", o.output, result.image.width, result.image.height,
             result.spp, format_duration(result.seconds), format_rate(static_cast<double>(result.samples) / seconds),
             result.counts.queries > 0
                 ? fmt::format(", {} queries/s", format_rate(static_cast<double>(result.counts.queries) / seconds))
                 : "",
             result.interrupted ? "; interrupted, what was done is saved" : "");
  }
}

}  // namespace

void add_render(Program& program) {
  auto o = std::make_shared<RenderVerbOptions>();
  CLI::App* verb = add_verb(program, "render", "Render a scene, path traced or from a trained cache.",
                            "octrad render scene.xml --integrator lhs --model room.octrad --width 512 -o lhs.exr\n"
                            "  octrad render scene.xml --integrator path --spp 256 --max-depth 8 -o ref.exr",
                            Devices::cuda);
  verb->add_option("scene", o->scene, "Mitsuba 3 scene")->required()->type_name("SCENE.xml");
  verb->add_option("-o,--output", o->output,
                   "picture; its ending says the format: .exr (with all layers), .hdr, .pfm, .png, .jpg")
      ->required()
      ->type_name("OUT.exr");
  verb->add_option("--integrator", o->integrator,
                   "path, or with --model: lhs (one query), rhs (one bounce), deferred (rhs on glossy surfaces), "
                   "disparity, traced, features1 ..., occupancy1 ...; default: path, with a model lhs")
      ->type_name("NAME");
  CLI::Option* model = verb->add_option("--model", o->model, "trained cache")->type_name("FILE.octrad");
  verb->add_flag("--force", o->force, "use the model although it was trained on another scene")->needs(model);
  verb->add_option("--spp", o->spp, "samples a pixel; default: path 64, rhs and deferred 16, others 4")
      ->check(whole_in_range(1, 1 << 30))
      ->type_name("N");
  verb->add_option("--time", o->time, "stop after this time, such as 30s or 2m (whichever comes first with --spp)")
      ->type_name("T");
  verb->add_option("--frames", o->frames,
                   "also render this many frames and print the median time, its 95th percentile and its parts")
      ->check(whole_in_range(1, 1 << 20))
      ->type_name("N");
  verb->add_option("--max-depth", o->max_depth,
                   "path: longest path as Mitsuba counts, -1 unlimited; default: the scene's")
      ->check(whole_in_range(-1, 1 << 20))
      ->type_name("D");
  verb->add_option("--rr-depth", o->rr_depth, "path: Russian roulette from this depth on; default: 5")
      ->check(whole_in_range(1, 1 << 20))
      ->type_name("D");
  verb->add_option("-D", o->definitions, "set a parameter of the scene file, or render.delta=cache|trace")
      ->type_name("KEY=VALUE")
      ->expected(1)
      ->allow_extra_args(false)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  verb->add_option("--width", o->width, "pixels; alone, the height follows the sensor's aspect")
      ->check(whole_in_range(1, 131072))
      ->type_name("W")
      ->group("Camera");
  verb->add_option("--height", o->height, "pixels; alone, the width follows the sensor's aspect")
      ->check(whole_in_range(1, 131072))
      ->type_name("H")
      ->group("Camera");
  verb->add_option("--crop", o->crop, "only this part of the picture")->type_name("X,Y,W,H")->group("Camera");
  CLI::Option* sensor = verb->add_option("--sensor", o->sensor, "sensor of the scene, from 0")
                            ->check(whole_in_range(0, 1 << 20))
                            ->type_name("N")
                            ->group("Camera");
  verb->add_option("--camera", o->camera_file, "JSON file with origin, target, up, fov")
      ->type_name("FILE")
      ->group("Camera");
  verb->add_option("--origin", o->origin, "look from here")->type_name("X,Y,Z")->group("Camera");
  verb->add_option("--target", o->target, "to here")->type_name("X,Y,Z")->group("Camera");
  verb->add_option("--up", o->up, "with this direction up; default 0,1,0")->type_name("X,Y,Z")->group("Camera");
  CLI::Option* fov = verb->add_option("--fov", o->fov, "field of view in degrees; default: the first sensor's")
                         ->check(in_range(0.01, 179.0))
                         ->type_name("DEG")
                         ->group("Camera");
  verb->add_option("--fov-axis", o->fov_axis, "x | y | diagonal | smaller | larger; default x")
      ->type_name("AXIS")
      ->needs(fov)
      ->group("Camera");
  add_log_option(*verb, program.common);
  verb->callback([&program, o, sensor] {
    o->sensor_given = sensor->count() > 0;
    program.run = [&program, o] { render_verb(program.common, *o); };
  });
}

}  // namespace octrad::cli
