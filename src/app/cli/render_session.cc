#include "app/cli/render_session.h"

#include <fmt/format.h>

#include <algorithm>

#include "app/cli/open_scene.h"
#include "app/report/picture_origin.h"
#include "octrad/base/atomic_file.h"
#include "octrad/base/bytes.h"
#include "octrad/base/duration.h"
#include "octrad/base/error.h"
#include "octrad/base/huge_pages.h"
#include "octrad/base/interrupt.h"
#include "octrad/base/json_file.h"
#include "octrad/base/log.h"
#include "octrad/base/stopwatch.h"
#include "octrad/image/io.h"
#include "octrad/render/highlights.h"
#include "octrad/scene/fingerprint.h"

namespace octrad::cli {
namespace {

// What is in memory already counts. The picture's sums are doubles, three times: while tiles are merged, and as they
// were before a pass, in case it is interrupted; once more to be saved for --resume. Then the picture itself, in memory
// and while it is written.
void require_picture_memory(const CommonOptions& common, const View& view, bool resume) {
  const double bytes = pixels_of(view) * kFilmNumbers * ((resume ? 4 : 3) * sizeof(double) + 2 * sizeof(float));
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

// Options that the integrator, or the kind of result, would ignore are refused.
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
  if (!o.view.path_file.empty() && (o.frames > 0 || o.resume))
    throw UsageError(fmt::format("{}: of no use with --path, whose frames that are there are not rendered again",
                                 o.frames > 0 ? "--frames" : "--resume"));
  if (!o.view.mask.empty() && !o.view.path_file.empty())
    throw UsageError("--mask: of no use with --path, whose frames are other views");
  if (!o.view.mask.empty() && o.frames > 0)
    throw UsageError("--mask: of no use with --frames, which are whole pictures");
  if (!o.view.mask.empty() && o.denoise) throw UsageError("--mask: a denoiser needs every pixel");
  if (!o.view.mask.empty() && integrator.one_sample)
    throw UsageError(fmt::format("--mask: {} needs every pixel", o.integrator));
  if (o.overwrite && o.view.path_file.empty())
    throw UsageError("--overwrite is for --path: a single picture is always replaced");
  if (o.resume && integrator.needs_model)
    throw UsageError(fmt::format("--integrator {}: --resume continues path-traced pictures only", o.integrator));
  if (!o.save_every.empty() && !o.resume) throw UsageError("--save-every is of use only with --resume");
  if (!o.denoise && !o.denoiser.given().empty())
    throw UsageError(fmt::format("{} is of use only with --denoise", o.denoiser.given()));
}

// The options with what follows from others; refuses what cannot be done before anything is loaded.
RenderVerbOptions checked(RenderVerbOptions o, const std::string& log) {
  if (o.integrator.empty()) o.integrator = o.model.empty() ? "path" : "lhs";
  const IntegratorInfo& integrator = *find_integrator(o.integrator).info;
  o.denoise = o.denoise || integrator.denoised;
  check_options(o, integrator);
  picture_format(o.output);  // refuses an unknown ending
  o.exr.settings = o.exr.settings_for(o.output);
  require_writable(o.output);
  const std::vector<std::string> inputs = {o.scene, o.model, o.view.camera_file, o.view.path_file, o.view.mask};
  refuse_input_as_output("-o", o.output, inputs);
  refuse_input_as_output("--log-json", log, inputs);
  refuse_input_as_output("--log-json", log, {o.output});
  return o;
}

std::optional<Model> open_model(const RenderVerbOptions& o) {
  if (o.model.empty()) return std::nullopt;
  Model model = load_model(o.model);
  find_integrator(o.integrator, model.field.get());
  return model;
}

}  // namespace

Config model_config(const ModelInfo& info, const ConfigOptions& definitions) {
  Config config = info.config;
  for (const auto& [key, value] : definitions.config_definitions()) {
    if (!key.starts_with("render.")) {
      Config scratch = config;
      set(scratch, key, value);  // an unknown key is refused with a suggestion
      throw UsageError(fmt::format("-D {}: the model fixes this key; only render.* can change after training", key));
    }
    set(config, key, value);
  }
  return config;
}

RenderSession::RenderSession(const CommonOptions& common_options, RenderVerbOptions options)
    : common(common_options),
      o(checked(std::move(options), common.log_json)),
      lock(o.output),
      integrator(*find_integrator(o.integrator).info),
      model(open_model(o)),
      device(model ? common.choose_device(model->info.config.field) : common.choose_device()),
      stream(device.make_stream(o.definitions.tuning())),
      denoiser(o.denoise ? o.denoiser.make(device.cuda) : nullptr),
      prepared(open_scene(o.scene, o.definitions.scene_definitions(), common.permissive,
                          {{"-o", o.output}, {"--log-json", common.log_json}})),
      log(common.open_log(o.resume)),
      tev(open_tev(o.tev)),
      progress_(o.integrator) {
  use_huge_pages();
  if (model) {
    check_scene(o.model, model->info, scene().file, scene().fingerprint, o.force);
    config = model_config(model->info, o.definitions);
    warn_of_ignored_keys(o.definitions, config);
  } else {
    o.definitions.refuse_config_definitions(fmt::format(
        "--integrator {} asks no cache: keys of training belong to octrad train, render.* to a --model", o.integrator));
  }
  budget = choose_budget(o, integrator);
  settings.film = scene().film_of(static_cast<std::size_t>(std::max(0, o.view.sensor)));
  settings.max_depth = o.max_depth >= -1 ? o.max_depth : scene().max_depth;
  settings.rr_depth = o.rr_depth > 0 ? o.rr_depth : settings.rr_depth;
  settings.seed = static_cast<unsigned long long>(std::max(0LL, common.seed));
  settings.expected_spp = budget.spp > 0 ? budget.spp : kLargestPass;  // --time
  if (stream) settings.max_memory = common.memory_budget(*stream);
}

void RenderSession::start(const View& view) {
  require_format_size(o.output, view.width, view.height);
  require_picture_memory(common, view, o.resume);
  log_event("start", {{"scene", o.scene},
                      {"integrator", o.integrator},
                      {"width", view.width},
                      {"height", view.height},
                      {"device", device.name}});
  renderer =
      make_renderer(prepared, o.integrator, settings, model ? model->field.get() : nullptr, config, stream.get());
  renderer->set_view(view);
  if (view.mask) {
    const long long wanted = view.wanted_pixels(), sampled = renderer->window().sampled_pixels();
    if (sampled > 2 * wanted)
      log_info("{}: {} pixels are sampled for {} of the mask (a filter that reaches further than a box)", o.output,
               format_count(sampled), format_count(wanted));
  }
  if (o.integrator != "lhs") return;
  bounce_below = octrad::bounce_below(prepared, config);
  if (bounce_below > 0.0 && config.render_highlights == Highlights::automatic) {
    log_info(
        "small lamps shine on surfaces of roughness below {}: these take one bounce each, others a query of the cache "
        "(render.highlights=cache: all)",
        config.render_bounce_below);
  }
}

RenderResult RenderSession::render_picture(double begin, double share) {
  defer_interrupts();
  budget.progress = [&, pixels = static_cast<double>(renderer->window().sampled_pixels())](int spp, double seconds) {
    const double by_samples = budget.spp > 0 ? static_cast<double>(spp) / budget.spp : 0.0;
    const double by_time = budget.seconds > 0.0 ? seconds / budget.seconds : 0.0;
    const double rate = seconds > 0.0 ? pixels * spp / seconds : 0.0;
    if (progress_.due()) {
      progress_.update(begin + share * std::clamp(std::max(by_samples, by_time), 0.0, 1.0),
                       fmt::format("{} spp  {} samples/s  {}", spp, format_rate(rate),
                                   format_bytes(static_cast<double>(resident_bytes()))));
    }
    if (tev && tev->due()) {
      const Stopwatch watch;
      const Image image = renderer->image();
      tev->show(o.output, image, watch.seconds());
    }
    log_event("progress", {{"spp", spp}, {"seconds", seconds}, {"samples_per_s", rate}});
  };
  RenderResult result = render(*renderer, budget);
  if (result.interrupted || begin + share > 1.0 - 1e-9) progress_.finish();
  if (result.counts.non_finite > 0)
    log_warning(fmt::format("{} samples were not finite and count as black", format_count(result.counts.non_finite)));
  if (result.counts.empty_lookups > 0) log_info("{}", empty_lookups_text(result.counts.empty_lookups));
  return result;
}

void RenderSession::save(RenderResult& result, const View& view, unsigned long long seed, const std::string& file) {
  report::PictureOrigin origin(scene(), view, settings, integrator, o.integrator);
  origin.spp = result.spp;
  origin.seed = seed;
  origin.seconds = result.seconds;
  if (model) {
    origin.config = &config;
    origin.model_file = o.model;
    origin.model_step = model->info.state.step;
  }
  add_origin(result.image, origin);
  if (denoiser) {
    try {
      denoise(*denoiser, result.image, file);
    } catch (const Error&) {
      write_image(file, result.image, {}, o.exr.settings);
      log_warning(fmt::format("{} is saved with its noise", file));
      throw;
    }
    denoise_seconds += denoiser->seconds();
  }
  if (tev) tev->show(o.output, result.image);
  write_image(file, result.image, {}, o.exr.settings);
}

std::string RenderSession::difference(const Image& image, const View& view, unsigned long long seed,
                                      int least_spp) const {
  const PixelRect part = view.part();
  const std::string none;
  const auto text = [&](const char* key) {
    const auto found = image.metadata.find(key);
    return found == image.metadata.end() ? none : found->second;
  };
  const auto number = [&](const char* key, long long fallback) {
    return report::metadata_value<long long>(image, "octrad.render", key, fallback);
  };
  if (image.width != part.width() || image.height != part.height() ||
      text("dataWindow.min") != (part.x0 + part.y0 > 0 ? fmt::format("{} {}", part.x0, part.y0) : none) ||
      text("displayWindow") != (part.width() < view.width || part.height() < view.height
                                    ? fmt::format("{} {}", view.width, view.height)
                                    : none))
    return "size";
  if (report::metadata_value(image, "octrad.scene", "fingerprint", none) != picture_fingerprint(scene()))
    return "scene";
  if (text("octrad.camera") != report::camera_json(view.camera).dump()) return "camera";
  if (report::metadata_value(image, "octrad.render", "integrator", none) != o.integrator) return "integrator";
  if (integrator.uses_depth && number("max_depth", -2) != settings.max_depth) return "max_depth";
  // Older pictures do not say it.
  if (integrator.uses_depth && number("rr_depth", settings.rr_depth) != settings.rr_depth) return "rr_depth";
  if (number("seed", -1) != static_cast<long long>(seed)) return "seed";
  if (report::mask_of(image) != report::mask_hash(view)) return "mask";
  const std::string hash = report::view_hash(view, settings.film);
  if (report::metadata_value(image, "octrad.render", "view", hash) != hash)
    return "filter, clipping planes or principal point";
  if (number("spp", 0) < least_spp) return "spp";
  if (model && (text("octrad.config") != json_text(to_json(config)) ||
                report::metadata_value<long long>(image, "octrad.model", "step", -1) != model->info.state.step))
    return "model";
  if (text("octrad.denoise").empty() == (denoiser != nullptr)) return "denoiser";
  return none;
}

nlohmann::json RenderSession::report(const RenderResult& result, const View& view) const {
  const double seconds = std::max(result.seconds, 1e-9);
  nlohmann::json report = {{"output", o.output},
                           {"integrator", o.integrator},
                           {"width", view.part().width()},
                           {"height", view.part().height()},
                           {"spp", result.spp},
                           {"seconds", result.seconds},
                           {"samples_per_s", static_cast<double>(result.samples) / seconds},
                           {"rays_per_s", static_cast<double>(result.counts.rays) / seconds},
                           {"queries_per_s", static_cast<double>(result.counts.queries) / seconds},
                           {"non_finite", result.counts.non_finite},
                           {"empty_lookups", result.counts.empty_lookups},
                           {"interrupted", result.interrupted}};
  if (o.integrator == "lhs") report["bounce_below"] = bounce_below;
  report["device"] = device.name;
  if (denoiser) report["denoise_seconds"] = denoise_seconds;
  if (stream) report["device_peak_bytes"] = stream->peak_bytes();
  return report;
}

void RenderSession::log_event(const std::string& event, nlohmann::json fields) const {
  if (!log) return;
  fields["event"] = event;
  log->write(fields);
}

}  // namespace octrad::cli
