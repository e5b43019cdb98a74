// octrad render: a picture of a scene, path traced or from a trained cache, or the frames of a camera path.
#include <fmt/format.h>

#include <filesystem>
#include <optional>

#include "app/cli/common.h"
#include "app/cli/render_session.h"
#include "app/report/picture_origin.h"
#include "octrad/base/bytes.h"
#include "octrad/base/duration.h"
#include "octrad/base/error.h"
#include "octrad/base/log.h"
#include "octrad/image/io.h"
#include "octrad/image/size_limit.h"
#include "octrad/render/film_state.h"
#include "octrad/scene/fingerprint.h"

namespace octrad::cli {
namespace {

// Adds the denoiser to the times of frames.
void time_denoiser(Denoiser& denoiser, const Image& image, const std::string& name, int count, FrameTimes& times) {
  std::vector<double> ms;
  for (int f = -1; f < count; ++f) {  // the first warms up
    Image copy = image;
    denoiser.run(copy, name);
    if (f >= 0) ms.push_back(1e3 * denoiser.seconds());
  }
  times.median += percentile(ms, 0.5);
  times.p95 += percentile(ms, 0.95);
  times.stages.emplace_back("denoising", percentile(ms, 0.5));
}

// What a picture must have in common with the one that it goes on from.
FilmIdentity identity_of(const RenderSession& s, const View& view) {
  const Crop& c = view.crop;
  FilmIdentity identity = {
      {"scene", picture_fingerprint(s.scene())},
      {"camera", report::whole_camera(view.camera)},
      {"size", fmt::format("{} x {}, crop {},{},{},{}{}", view.width, view.height, c.x, c.y, c.width, c.height,
                           view.mask ? ", mask " + report::mask_hash(view) : "")},
      {"integrator", s.integrator.denoised ? "path" : s.o.integrator},
      {"seed", std::to_string(s.settings.seed)},
      {"max_depth", std::to_string(s.settings.max_depth)},
      {"rr_depth", std::to_string(s.settings.rr_depth)},
      {"filter", report::filter_text(s.settings.film)},
      {"device", s.device.name}};
  // Sampling weights of lights choose the random paths, not what the picture shows: no part of the fingerprint.
  if (const std::vector<float> weights = s.scene().sampling_weights(); !weights.empty())
    identity["sampling_weights"] = fmt::format("{}", fmt::join(weights, " "));
  return identity;
}

// --resume: what the picture goes on from is in a file beside it, kept for runs to more samples.
class Continuation {
 public:
  Continuation(RenderSession& session, const View& view)
      : session_(session),
        file_(named_by(session.o.output) + ".state"),
        identity_(identity_of(session, view)) {
    if (!session.o.resume) return;
    std::error_code error;  // where a name is too long for a state, writing says so
    if (std::filesystem::exists(session.o.output, error) && !std::filesystem::is_regular_file(session.o.output, error))
      throw UsageError(fmt::format("--resume: {} is not a file that a state could lie beside", session.o.output));
    if (std::filesystem::exists(file_, error)) {
      from_ = read_film_state(file_, identity_);
      if (session.budget.spp > 0 && from_->samples > session.budget.spp)
        throw InputError(fmt::format("{}: has {} samples a pixel already, more than the {} asked for", file_,
                                     from_->samples, session.budget.spp));
    }
    session.budget.from = from_ ? &*from_ : nullptr;
    session.budget.save = [this](const FilmState& state) { save(state); };
    if (!session.o.save_every.empty()) session.budget.save_every = parse_duration(session.o.save_every);
  }

  int samples() const { return from_ ? from_->samples : 0; }

  // The picture on disk, where it has what is asked for. Throws UsageError for a merged one, which it would replace.
  std::optional<Image> finished(const View& view) const {
    if (!session_.o.resume) return std::nullopt;
    std::optional<Image> image = on_disk();
    if (!image) return std::nullopt;
    if (report::picture_seeds(*image).size() > 1)
      throw UsageError(
          fmt::format("--resume: {} was merged from several pictures, which nothing can go on from; take another name",
                      session_.o.output));
    if (session_.budget.spp > 0 &&
        session_.difference(*image, view, session_.settings.seed, session_.budget.spp).empty())
      return image;
    if (!from_) log_info("{}: nothing is there to go on from ({}): it is rendered anew", session_.o.output, file_);
    return std::nullopt;
  }

  // Whether the result may replace what is on disk: with --resume, a picture of more samples stays.
  bool replaces(const RenderResult& result, const View& view) const {
    if (result.spp == 0) return false;  // interrupted in its first pass
    if (!session_.o.resume) return true;
    const std::optional<Image> image = on_disk();
    return !image || !session_.difference(*image, view, session_.settings.seed, result.spp + 1).empty();
  }

  // After the picture was written. An interrupted one can be continued even without --resume, unless its state would
  // replace that of another picture. Whether --resume goes on from it.
  bool finish(const RenderResult& result) {
    if (!result.interrupted || result.spp == 0 || session_.integrator.needs_model) return false;
    if (session_.o.resume) return true;
    if (!std::filesystem::is_regular_file(session_.o.output)) return false;
    if (std::filesystem::exists(file_)) {
      try {
        if (read_film_state(file_, identity_).samples >= result.spp) return true;
      } catch (const Error& error) {
        log_warning(fmt::format("{}; it stays, and --resume cannot go on from the new picture", error.what()));
        return false;
      }
    }
    Renderer& renderer = *session_.renderer;
    save({result.spp, renderer.largest_pass(), result.seconds, result.counts, renderer.sums()});
    return failure_.empty();
  }

  // Throws IoError where the last state could not be saved.
  void check() const {
    if (!failure_.empty()) throw IoError(failure_);
  }

 private:
  // What a link leads to: the state lies beside the picture itself.
  static std::string named_by(const std::string& output) {
    std::error_code error;
    return std::filesystem::is_symlink(output, error) ? std::filesystem::weakly_canonical(output, error).string()
                                                      : output;
  }

  // The picture comes first: a disk that is full ends nothing.
  void save(const FilmState& state) {
    try {
      write_film_state(file_, state, identity_);
      failure_.clear();
    } catch (const Error& error) {
      if (failure_.empty()) log_warning(error.what());
      failure_ = error.what();
    }
  }

  std::optional<Image> on_disk() const {
    try {
      if (std::filesystem::exists(session_.o.output)) return read_image(session_.o.output);
    } catch (const MemoryError&) {  // what it has is not known
      throw;
    } catch (const Error&) {  // nothing that must be kept
    }
    return std::nullopt;
  }

  RenderSession& session_;
  const std::string file_;
  const FilmIdentity identity_;
  std::optional<FilmState> from_;
  std::string failure_;  // of the last save
};

void print_picture(const RenderSession& s, const RenderResult& result, const nlohmann::json& report,
                   const std::optional<FrameTimes>& frames, const std::string& ending) {
  if (s.common.json) {
    print_json(report);
    return;
  }
  if (frames)
    log_info("{} frames: median {:.3f} ms, 95th percentile {:.3f} ms ({})", s.o.frames, frames->median, frames->p95,
             format_stages(frames->stages));
  const double seconds = std::max(result.seconds, 1e-9);
  log_info("{}: {} x {}, {} spp in {} ({} samples/s{}){}{}", s.o.output, result.image.width, result.image.height,
           result.spp, format_duration(result.seconds), format_rate(static_cast<double>(result.samples) / seconds),
           result.counts.queries > 0
               ? fmt::format(", {} queries/s", format_rate(static_cast<double>(result.counts.queries) / seconds))
               : "",
           s.denoiser ? fmt::format(", denoised in {}", format_duration(s.denoise_seconds)) : "", ending);
}

void render_picture(RenderSession& s) {
  const View view = choose_view(s.scene(), s.o.view, choose_camera(s.scene(), s.o.view));
  Continuation continuation(s, view);
  if (std::optional<Image> image = continuation.finished(view)) {
    RenderResult result;
    result.spp = static_cast<int>(report::metadata_value<long long>(*image, "octrad.render", "spp", 0));
    result.seconds = report::metadata_value(*image, "octrad.render", "seconds", 0.0);
    result.samples = view.wanted_pixels() * result.spp;
    result.image = std::move(*image);
    nlohmann::json report = s.report(result, view);
    report["resumed_spp"] = result.spp;
    s.log_event("done", report);
    print_picture(s, result, report, std::nullopt, "; was finished");
    if (s.log) s.log->finish();
    return;
  }
  s.start(view);
  std::optional<FrameTimes> frames;
  if (s.o.frames > 0) frames = s.renderer->time_frames(s.o.frames, std::max(1, s.budget.spp));
  RenderResult result = s.render_picture();
  if (frames && s.denoiser) time_denoiser(*s.denoiser, result.image, s.o.output, s.o.frames, *frames);
  const bool replaces = continuation.replaces(result, view);
  if (replaces) s.save(result, view, s.settings.seed, s.o.output);
  const bool goes_on = continuation.finish(result);

  nlohmann::json report = s.report(result, view);
  if (s.o.resume) report["resumed_spp"] = continuation.samples();
  if (frames) {
    report["frames"] = {{"count", s.o.frames},
                        {"median_ms", frames->median},
                        {"p95_ms", frames->p95},
                        {"stages_ms", stages_json(frames->stages)}};
  }
  s.log_event("done", report);
  print_picture(s, result, report, frames,
                result.interrupted && result.spp == 0
                    ? "; interrupted before every pixel had a sample: nothing is saved"
                : !replaces           ? "; kept for --resume beside the file, which has more samples"
                : !result.interrupted ? ""
                : goes_on             ? "; interrupted, what was done is saved, and --resume goes on"
                                      : "; interrupted, what was done is saved");
  continuation.check();
  if (s.log) s.log->finish();
}

void render_verb(const CommonOptions& common, const RenderVerbOptions& o) {
  RenderSession session(common, o);
  if (o.view.path_file.empty()) render_picture(session);
  else render_frames(session);
}

}  // namespace

void add_render(Program& program) {
  auto o = std::make_shared<RenderVerbOptions>();
  CLI::App* verb = add_verb(program, "render", "Render a scene, path traced or from a trained cache.",
                            "octrad render scene.xml --integrator lhs --model room.octrad --width 512 -o lhs.exr\n"
                            "  octrad render scene.xml --integrator path --spp 256 -o ref.exr",
                            Devices::cuda);
  verb->add_option("scene", o->scene, "Mitsuba XML, glTF or pbrt")->required()->type_name("SCENE");
  verb->add_option("-o,--output", o->output,
                   "picture; its ending says the format: .exr (with all layers), .hdr, .pfm, .png, .jpg")
      ->required()
      ->type_name("OUT.exr");
  verb->add_option(
          "--integrator", o->integrator,
          "path, denoised (few paths, then --denoise), or with --model: lhs (one query), rhs (one bounce), deferred (rhs on glossy surfaces), "
          "disparity, traced, features1 ..., occupancy1 ...; default: path, with a model lhs")
      ->type_name("NAME");
  CLI::Option* model = verb->add_option("--model", o->model, "trained cache")->type_name("FILE.octrad");
  add_force_option(*verb, o->force)->needs(model);
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
  o->definitions.add_definitions_to(*verb, ", or a key render.*, such as render.delta=cache");
  verb->add_option("--width", o->view.width, "pixels; alone, the height follows the sensor's aspect")
      ->check(whole_in_range(1, kMostFilmPixels))
      ->type_name("W")
      ->group("Camera");
  verb->add_option("--height", o->view.height, "pixels; alone, the width follows the sensor's aspect")
      ->check(whole_in_range(1, kMostFilmPixels))
      ->type_name("H")
      ->group("Camera");
  verb->add_option("--crop", o->view.crop, "only this part of the picture")->type_name("X,Y,W,H")->group("Camera");
  verb->add_option(
          "--mask", o->view.mask,
          "only pixels that are white in FILE, a picture of the whole view's size (mean of the colour at least 0.5); "
          "others are 0")
      ->type_name("FILE")
      ->group("Camera");
  CLI::Option* sensor = verb->add_option("--sensor", o->view.sensor, "sensor of the scene, from 0")
                            ->check(whole_in_range(0, 1 << 20))
                            ->type_name("N")
                            ->group("Camera");
  verb->add_option("--camera", o->view.camera_file, "JSON file with origin, target, up, fov")
      ->type_name("FILE")
      ->group("Camera");
  verb->add_option("--origin", o->view.origin, "look from here")->type_name("X,Y,Z")->group("Camera");
  verb->add_option("--target", o->view.target, "to here")->type_name("X,Y,Z")->group("Camera");
  verb->add_option("--up", o->view.up, "with this direction up; default 0,1,0")->type_name("X,Y,Z")->group("Camera");
  CLI::Option* fov = verb->add_option("--fov", o->view.fov, "field of view in degrees; default: the first sensor's")
                         ->check(in_range(0.01, 179.0))
                         ->type_name("DEG")
                         ->group("Camera");
  verb->add_option("--fov-axis", o->view.fov_axis, "x | y | diagonal | smaller | larger; default x")
      ->type_name("AXIS")
      ->needs(fov)
      ->group("Camera");
  verb->add_option("--path", o->view.path_file, "render the frames of a moving camera: JSON file with its key poses")
      ->type_name("FILE")
      ->group("Camera");
  verb->add_flag("--overwrite", o->overwrite, "with --path: render frames again that are there")->group("Camera");
  verb->add_flag(
      "--resume", o->resume,
      "path: go on where an interrupted picture, or one of fewer samples, ended, to the same bits; keeps what "
      "that takes in OUT.state");
  verb->add_option("--save-every", o->save_every, "with --resume: how often that is saved; default: 5m")
      ->type_name("T");
  o->exr.add_to(*verb);
  verb->add_flag("--denoise", o->denoise, "remove the noise with Intel Open Image Denoise")->group("Denoiser");
  o->denoiser.add_to(*verb, "denoise-", "Denoiser");
  add_tev_option(*verb, o->tev);
  add_permissive_option(*verb, program.common);
  add_log_option(*verb, program.common);
  verb->callback([&program, o, sensor] {
    o->view.sensor_given = sensor->count() > 0;
    program.run = [&program, o] { render_verb(program.common, *o); };
  });
}

}  // namespace octrad::cli
