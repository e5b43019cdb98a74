// octrad train: trains a radiance cache of a scene.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <optional>

#include "app/cli/common.h"
#include "app/cli/open_scene.h"
#include "app/cli/serve.h"
#include "app/cli/tev_training.h"
#include "app/report/picture_origin.h"
#include "octrad/base/atomic_file.h"
#include "octrad/base/bytes.h"
#include "octrad/base/duration.h"
#include "octrad/base/error.h"
#include "octrad/base/huge_pages.h"
#include "octrad/base/interrupt.h"
#include "octrad/base/join.h"
#include "octrad/base/log.h"
#include "octrad/base/memory_limit.h"
#include "octrad/image/io.h"
#include "octrad/image/tonemap.h"
#include "octrad/scene/camera.h"
#include "octrad/scene/fingerprint.h"
#include "octrad/train/trainer.h"

namespace octrad::cli {
namespace {

struct TrainVerbOptions {
  std::string scene, output;
  ConfigOptions config;
  std::string field;
  long long steps = -1;
  std::string time;
  std::string reference, validate_every;
  bool resume = false, overwrite = false, no_optimizer = false, deterministic = false;
  bool view = false;
  ServeOptions serve;
  std::string tev;
};

// Options that have configuration keys of their own are applied last: they are what the user sees first.
void apply_options(Config& config, const TrainVerbOptions& o, const CommonOptions& common) {
  if (!o.field.empty()) set(config, "field", o.field);
  set_seed(config, common);
  if (!o.time.empty()) set(config, "train.time", o.time);
  if (o.steps >= 0) set(config, "train.steps", std::to_string(o.steps));
}

// The configuration of a resumed run is the model's; only budgets, and keys of pictures alone, may be new. Keys that
// are newer than the model stay as they are there, also where a preset, which may have changed since, is named again.
Config resumed_config(const Model& model, const TrainVerbOptions& o, const CommonOptions& common) {
  Config wanted = model.info.config;
  if (!o.config.preset.empty() || !o.config.file.empty()) {
    wanted = o.config.resolve();
  } else {
    for (const auto& [key, value] : o.config.config_definitions()) set(wanted, key, value);
  }
  apply_options(wanted, o, common);
  if (wanted.target_scale == 0.0) wanted.target_scale = model.info.config.target_scale;  // chosen by the first run
  const std::vector<ConfigKey> was = describe(model.info.config), now = describe(wanted),
                               of_preset = describe(preset(wanted.preset));
  const auto has = [](const auto& list, const std::string& key) {
    return std::find(list.begin(), list.end(), key) != list.end();
  };
  std::vector<std::string> given;
  for (const auto& [key, value] : o.config.config_definitions()) given.push_back(key);
  std::string kept;
  // Of train.cameras the cameras themselves are compared (check_sensors), not the file's name.
  static const std::vector<std::string> kMayChange = {"train.steps", "train.time", "checkpoint.every", "train.cameras"};
  for (std::size_t i = 0; i < was.size(); ++i) {
    const std::string& key = was[i].key;
    const bool of_pictures = key.starts_with("render.") && key != "render.delta" && key != "render.trace_below";
    if (was[i].value == now[i].value || of_pictures || has(kMayChange, key)) continue;
    if (has(model.info.state.newer_keys, key) && now[i].value == of_preset[i].value && !has(given, key)) {
      set(wanted, key, was[i].value);
      kept += fmt::format(" {}={}", key, was[i].value);
      continue;
    }
    throw UsageError(fmt::format(
        "--resume: {} was {} in {} and is {} now; a run continues with its own configuration (only train.steps, train.time, "
        "checkpoint.every, the name of train.cameras, and render.* but render.delta and render.trace_below may change)",
        key, was[i].value, o.output, now[i].value));
  }
  if (!kept.empty())
    log_info("{} is older than these keys of preset {}, and goes on as before them:{}", o.output, wanted.preset, kept);
  return wanted;
}

// The preset and what differs from it in one line; with -v every key, one line a group.
void show_config(const Config& config) {
  const std::vector<ConfigKey> keys = describe(config), preset_keys = describe(preset(config.preset));
  std::vector<std::pair<std::string, std::string>> groups;
  std::string changed;
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const std::string& key = keys[i].key;
    const std::string text = key + "=" + (keys[i].value.empty() ? "\"\"" : keys[i].value);
    if (keys[i].value != preset_keys[i].value) changed += ", " + text;
    const std::string group = key.substr(0, key.find('.') == std::string::npos ? 0 : key.find('.'));
    if (groups.empty() || groups.back().first != group) groups.push_back({group, ""});
    groups.back().second += " " + text;
  }
  log_info("preset {}{}{}", config.preset, changed, log_level() < LogLevel::verbose ? " (-v: every key)" : "");
  for (const auto& [group, line] : groups) log_verbose(" {}", line);
}

// Warns of a reference that the cache cannot come near to, as far as the file says how it was made.
void check_reference(const std::string& file, const Image& reference, const Scene& scene) {
  if (reference.metadata.count("displayWindow") > 0)
    throw InputError(file + ": is a part of a picture (--crop); --reference needs the whole view");
  if (!report::mask_of(reference).empty())
    throw InputError(file + ": is a part of a picture (--mask); --reference needs the whole view");
  if (is_display_referred(reference))
    throw InputError(file + ": holds what a screen shows; --reference needs linear radiance (EXR, HDR, PFM)");
  const std::string expected = picture_fingerprint(scene);
  const std::string fingerprint = report::metadata_value(reference, "octrad.scene", "fingerprint", expected);
  if (fingerprint != expected) {
    log_warning(
        fmt::format("{} shows another scene: {} (fingerprint {}), not {} ({}); the error against it says little", file,
                    report::metadata_value<std::string>(reference, "octrad.scene", "file", "?"), fingerprint,
                    scene.file, expected));
  }
  const auto camera = reference.metadata.find("octrad.camera");
  if (camera != reference.metadata.end() && fingerprint == expected && !scene.cameras.empty() &&
      camera->second != report::camera_json(scene.cameras.front()).dump())
    log_warning(
        fmt::format("{} has another camera than the scene's first sensor, whose picture it is compared with", file));
  const std::string integrator = report::metadata_value<std::string>(reference, "octrad.render", "integrator", "path");
  if (integrator != "path" && integrator != "denoised")
    log_warning(fmt::format("{} is a picture of integrator {}, and no reference", file, integrator));
  const int depth = report::metadata_value(reference, "octrad.render", "max_depth", -1);
  if (depth >= 0 && report::metadata_value<std::string>(reference, "octrad.render", "integrator", "") == "path") {
    log_warning(
        fmt::format("{} has paths of at most {} (max_depth) and the cache has every bounce: the light that the "
                    "reference lacks counts as an error; render it with --max-depth -1",
                    file, depth));
  }
}

// Trains while a page watches and steers it. Whether training was cut short.
bool train_viewed(const CommonOptions& common, const TrainVerbOptions& o, PreparedScene& scene, Trainer& trainer,
                  Stream* stream, const std::function<bool()>& interrupted) {
  viewer::Studio studio{scene, {}, viewer_settings(common, scene.scene(), 0, stream), stream};
  viewer::ViewerModel model{o.output, {}, trainer.config(), &trainer.field()};
  model.info.config = trainer.config();
  model.trainer = &trainer;
  studio.models.push_back(std::move(model));
  studio.denoiser = find_denoiser();
  const View view = choose_view(scene.scene(), ViewOptions{}, choose_camera(scene.scene(), ViewOptions{}));
  viewer::ViewState first = first_state(view, false);
  first.a.integrator = "lhs";
  viewer::LiveTraining live(scene, trainer, {});
  viewer::Session session(std::move(studio), std::move(first),
                          viewer_command(common, o.scene, o.config.scene_definitions(), {}), &live);
  return serve(o.serve, common, session, interrupted);
}

// --resume: the model at -o, with its optimiser's state; none where there is no file yet. `held`: bytes that it takes,
// which are part of what training is estimated to need.
std::optional<Model> open_resumed(const TrainVerbOptions& o, std::uint64_t& held) {
  if (!o.resume) return std::nullopt;
  if (!std::filesystem::exists(o.output)) {
    log_info("{} does not exist yet: starting from the beginning", o.output);
    return std::nullopt;
  }
  Model model = load_to_train(o.output, held);
  if (!model.has_optimizer)
    throw InputError(fmt::format("--resume: {} holds no optimiser state (it was saved with --no-optimizer)", o.output));
  return model;
}

void check_sensors(const TrainVerbOptions& o, const TrainingState& state, const Scene& scene,
                   const std::vector<Camera>& cameras) {
  if (!state.has_other_sensors(sensors_fingerprint(scene, cameras))) return;
  throw InputError(fmt::format(
      "--resume: the sensors of {}, the sampling weights of its lights or the cameras of train.cameras are others than "
      "those that {} was trained with; a run continues with its own",
      o.scene, o.output));
}

void warn_of_spent_budget(const std::string& file, const Config& config, const TrainingState& state,
                          double time_limit) {
  const bool no_steps = config.train_steps > 0 && state.step >= config.train_steps;
  const double most = config.train_steps > 0 ? time_limit : config.train_seconds;
  if (!no_steps && !(most > 0.0 && state.seconds >= most)) return;
  log_warning(
      fmt::format("{} has trained {} already: nothing is left to do; {} is the total, earlier runs included", file,
                  no_steps ? fmt::format("{} of {} steps", format_count(state.step), format_count(config.train_steps))
                           : fmt::format("{} of {}", format_duration(state.seconds), format_duration(most)),
                  no_steps ? "--steps" : "--time"));
}

// What is said while it trains, on the terminal and in `log` (may be null). All must outlive the training.
void report_progress(TrainOptions& options, Progress& progress, JsonLines* log) {
  const Stream* stream = options.stream;
  options.progress = [&progress, log, stream](const TrainProgress& p) {
    if (progress.due()) {
      std::string text = fmt::format("step {}  loss {:.4f}", format_count(p.step), p.loss);
      if (p.validation_mape >= 0.0) text += fmt::format("  MAPE {:.4f}", p.validation_mape);
      text += fmt::format("  {} queries/s", format_rate(p.queries_per_second));
      if (p.validation_mape < 0.0) text += "  " + format_bytes(static_cast<double>(resident_bytes()));  // 80 columns
      progress.update(p.fraction, text);
    }
    if (log == nullptr) return;
    nlohmann::json line = {{"event", "progress"},
                           {"step", p.step},
                           {"seconds", p.seconds},
                           {"fraction", p.fraction},
                           {"loss", p.loss},
                           {"points_per_s", p.points_per_second},
                           {"rhs_queries_per_s", p.queries_per_second},
                           {"memory", resident_bytes()}};
    if (stream != nullptr) line["device_memory"] = stream->allocated_bytes();
    log->write(line);
  };
  options.validated = [log](long long step, double seconds, double mape) {
    if (log) log->write({{"event", "validation"}, {"step", step}, {"seconds", seconds}, {"mape", mape}});
  };
  options.saved = [log](const std::string& file, long long step) {
    log_verbose("saved {} at step {}", file, format_count(step));
    if (log) log->write({{"event", "saved"}, {"file", file}, {"step", step}});
  };
  options.not_saved = [log](const std::string& why, long long step) {
    warn_not_saved(why);
    if (log) log->write({{"event", "not_saved"}, {"error", why}, {"step", step}});
  };
  options.placed = [](const DomainFit& fit) {
    log_info("{}", domain_text(fit));
    if (const std::string warning = domain_warning(fit); !warning.empty()) log_warning(warning);
  };
}

// Whether training was cut short.
bool run(const CommonOptions& common, const TrainVerbOptions& o, PreparedScene& scene, const TrainOptions& options,
         Trainer& trainer) {
  if (o.view) return train_viewed(common, o, scene, trainer, options.stream, options.interrupted);
  std::optional<TevTraining> tev;
  if (!o.tev.empty()) {
    const std::uint64_t budget = options.stream != nullptr ? common.memory_budget(*options.stream) : 0;
    tev.emplace(o.tev, o.output, scene, trainer, options.stream, budget);
  }
  bool cut = false;
  while (!trainer.done() && !cut) {
    cut = options.interrupted();
    if (!cut) trainer.step();
    if (tev) tev->update();
  }
  if (tev) tev->update(true);
  return cut;
}

nlohmann::json report_json(const TrainVerbOptions& o, const Config& config, const TrainOptions& options,
                           const TrainResult& result, const std::string& device, const ModelFileSize& size) {
  nlohmann::json report = {
      {"steps", result.steps},
      {"seconds", result.seconds},
      {"lhs_samples", result.lhs_samples},
      {"rhs_queries", result.rhs_queries},
      {"rhs_queries_per_s", static_cast<double>(result.rhs_queries) / std::max(result.seconds, 1e-9)},
      {"empty_lookups", result.empty_lookups},
      {"dropped_contributions", result.dropped_contributions},
      {"loss", result.loss < 0.0 ? nlohmann::json(nullptr) : nlohmann::json(result.loss)},
      {"validation_mape", nullptr},
      {"model", o.output},
      {"field", config.field},
      {"preset", config.preset},
      {"interrupted", result.interrupted},
      {"device", device}};
  report["memory_estimate_bytes"] = static_cast<std::uint64_t>(options.used_memory + result.memory);
  report["memory_peak_bytes"] = peak_resident_bytes();
  if (options.stream != nullptr) report["device_peak_bytes"] = options.stream->peak_bytes();
  if (!result.stages.empty()) report["stages_ms"] = stages_json(result.stages);
  if (result.validation_mape >= 0.0) report["validation_mape"] = result.validation_mape;
  if (size.total > 0.0) {
    report["model_bytes"] = static_cast<std::uint64_t>(size.total);
    report["optimizer_bytes"] = static_cast<std::uint64_t>(size.optimizer);
  }
  return report;
}

void print_result(const std::string& file, const TrainResult& result, const ModelFileSize& size) {
  log_info("{}: {} steps in {}, loss {:.4f}{}, {} queries/s", file, format_count(result.steps),
           format_duration(result.seconds), result.loss,
           result.validation_mape >= 0.0 ? fmt::format(", validation MAPE {:.4f}", result.validation_mape) : "",
           format_rate(static_cast<double>(result.rhs_queries) / std::max(result.seconds, 1e-9)));
  if (size.optimizer > 0.0)
    log_info("{}: {} with what --resume needs, {} with --no-optimizer", file, format_bytes(size.total),
             format_bytes(size.total - size.optimizer));
  if (!result.stages.empty()) log_info("ms of a step: {}", format_stages(result.stages));
}

void train_verb(const CommonOptions& common, TrainVerbOptions o) {
  if (o.view) o.serve.prepare();
  const WriterLock lock(o.output);
  if (!o.resume && !o.overwrite && std::filesystem::is_regular_file(o.output))
    throw UsageError(fmt::format("{} exists: --resume continues it, --overwrite replaces it", o.output));
  Config config = o.config.resolve();
  apply_options(config, o, common);
  const std::vector<std::string> inputs = {o.scene, o.reference, o.config.file, config.train_cameras};
  refuse_input_as_output("-o", o.output, inputs);
  refuse_input_as_output("--log-json", common.log_json, inputs);
  refuse_input_as_output("--log-json", common.log_json, {o.output});
  const double validate_every = o.validate_every.empty() ? 0.0 : parse_duration(o.validate_every);
  if (!o.validate_every.empty() && validate_every <= 0.0) throw UsageError("--validate-every must be above 0");

  std::uint64_t held = 0;
  std::optional<Model> resumed = open_resumed(o, held);
  if (resumed) config = resumed_config(*resumed, o, common);
  warn_of_ignored_keys(o.config, config);

  const DeviceChoice device = common.choose_device(config.field);
  const std::unique_ptr<Stream> stream = device.make_stream(o.config.tuning());
  Image reference;
  if (!o.reference.empty()) reference = read_image(o.reference);
  PreparedScene scene(open_scene(o.scene, o.config.scene_definitions(), common.permissive,
                                 {{"-o", o.output}, {"--log-json", common.log_json}}));
  use_huge_pages();
  std::vector<Camera> cameras;
  if (!config.train_cameras.empty()) cameras = read_cameras(config.train_cameras);
  if (resumed)
    check_scene(o.output, resumed->info, scene.scene().file, scene.scene().fingerprint, false,
                "a training goes on in the scene that it began in");
  if (resumed) check_sensors(o, resumed->info.state, scene.scene(), cameras);
  if (!o.reference.empty()) check_reference(o.reference, reference, scene.scene());
  const std::unique_ptr<JsonLines> log = common.open_log(resumed.has_value());

  TrainOptions options;
  options.output = o.output;
  options.save_optimizer = !o.no_optimizer;
  options.reference = o.reference.empty() ? nullptr : &reference;
  if (!o.validate_every.empty()) options.validation_seconds = validate_every;
  options.max_memory = static_cast<double>(common.memory_budget());
  if (!stream) {  // what training takes of the scene, before it is measured
    scene.tracer();
    scene.surfaces();
  }
  const std::uint64_t resident = resident_bytes();
  options.used_memory = static_cast<double>(resident - std::min(resident, held));
  options.stream = stream.get();
  options.deterministic = o.deterministic;
  if (stream) {
    options.max_memory = static_cast<double>(common.memory_budget(*stream));
    options.used_memory = static_cast<double>(scene.bytes_to_upload(*stream));
  }
  options.cameras = std::move(cameras);
  options.resume = resumed ? &*resumed : nullptr;

  // With both --steps and --time the schedule follows the steps and the time is a limit.
  if (o.steps > 0 && !o.time.empty()) options.time_limit = parse_duration(o.time);
  options.interrupted = [&] {
    defer_interrupts();  // first asked before the first step: up to there nothing is to be saved
    return interrupted();
  };

  const long long resumed_step = resumed ? resumed->info.state.step : 0;
  show_config(config);
  if (stream && stream->on_device() && o.config.preset.empty() && o.config.file.empty() && !resumed)
    log_info("on a GPU --preset default learns more in the same time, in more memory");
  if (log)
    log->write({{"event", "start"},
                {"scene", o.scene},
                {"config", to_json(config)},
                {"step", resumed_step},
                {"device", device.name}});
  if (resumed) {
    log_info("continuing {} at step {}", o.output, format_count(resumed_step));
    warn_of_spent_budget(o.output, config, resumed->info.state, options.time_limit);
  }

  Progress progress("train");
  report_progress(options, progress, log.get());
  Trainer trainer(scene, config, options);
  const bool cut = run(common, o, scene, options, trainer);
  const TrainResult result = trainer.finish(cut);
  set_memory_limit(0);  // what is left is to say what was done
  progress.finish();
  if (result.dropped_contributions > 0) {
    log_warning(fmt::format("{} contributions to targets were not finite and count as black",
                            format_count(result.dropped_contributions)));
  }
  if (result.empty_lookups > 0) log_info("{}", empty_lookups_text(result.empty_lookups));

  ModelFileSize size;
  if (std::filesystem::is_regular_file(o.output)) size = model_file_size(TensorReader(o.output));
  const nlohmann::json report = report_json(o, config, options, result, device.name, size);
  if (log) {
    nlohmann::json done = report;
    done["event"] = "done";
    log->write(done);
  }
  if (result.interrupted) {
    const bool edited = scene.fingerprint() != scene.scene().fingerprint;
    log_info("interrupted: {} holds step {}; {}", o.output, format_count(result.steps),
             edited ? "it belongs to the edited scene, in which --resume does not go on" : "--resume continues it");
  }
  if (common.json) print_json(report);
  else print_result(o.output, result, size);
  if (log) log->finish();
}

}  // namespace

void add_train(Program& program) {
  auto o = std::make_shared<TrainVerbOptions>();
  CLI::App* verb =
      add_verb(program, "train", "Train a radiance cache of a scene.",
               "octrad train scene.xml -o room.octrad --preset cpu --time 3m --reference ref.exr", Devices::cuda);
  verb->add_option("scene", o->scene, "Mitsuba XML, glTF or pbrt")->required()->type_name("SCENE");
  verb->add_option("-o,--output", o->output, "model file; checkpoints go there too")
      ->required()
      ->type_name("MODEL.octrad");
  o->config.add_to(*verb);
  verb->add_option("--field", o->field, join(field_names(), " | ") + "; default: " + Config{}.field)->type_name("NAME");
  verb->add_option("--steps", o->steps, "train N steps")->check(whole_in_range(1, 100000000))->type_name("N");
  verb->add_option("--time", o->time, "train this long, such as 90s or 5m; with --steps: at most this long")
      ->type_name("T");
  verb->add_option("--reference", o->reference,
                   "picture of the scene's first sensor: its error is shown while training")
      ->type_name("REF.exr");
  verb->add_option("--validate-every", o->validate_every,
                   "how often that is measured, in time of training; measuring does not count as training")
      ->type_name("T")
      ->needs("--reference");
  CLI::Option* resume =
      verb->add_flag("--resume", o->resume, "continue the model in MODEL.octrad where its last checkpoint left it");
  verb->add_flag("--overwrite", o->overwrite, "replace MODEL.octrad if there is one")->excludes(resume);
  verb->add_flag("--deterministic", o->deterministic, "on a GPU: the same bits every time, slower (the CPU always is)");
  verb->add_flag("--no-optimizer", o->no_optimizer, "leave out what --resume needs: a small file");
  CLI::Option* view =
      verb->add_flag("--view", o->view, "watch and steer it in a browser (docs/viewer.md)")->group("Server");
  o->serve.add_to(*verb, view);
  add_permissive_option(*verb, program.common);
  add_tev_option(*verb, o->tev)->excludes("--view");
  add_log_option(*verb, program.common);
  verb->callback([&program, o] {
    program.common.own_threads = o->view ? 4 : 1;  // the clock of the training; the viewer's
    program.run = [&program, o] { train_verb(program.common, *o); };
  });
}

}  // namespace octrad::cli
