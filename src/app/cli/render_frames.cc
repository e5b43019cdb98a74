// octrad render --path: the frames of a moving camera.
#include <fmt/format.h>

#include <filesystem>

#include "app/cli/render_session.h"
#include "octrad/base/duration.h"
#include "octrad/base/error.h"
#include "octrad/base/interrupt.h"
#include "octrad/base/log.h"
#include "octrad/image/io.h"
#include "octrad/scene/camera_path.h"

namespace octrad::cli {
namespace {

// The file of a frame: the last run of # in the pattern's file name becomes its number, with zeros in front.
std::string frame_file(const std::string& pattern, int frame) {
  const std::size_t end = pattern.rfind('#') + 1;
  const std::size_t before = pattern.find_last_not_of('#', end - 1),
                    begin = before == std::string::npos ? 0 : before + 1;
  return pattern.substr(0, begin) + fmt::format("{:0{}}", frame, end - begin) + pattern.substr(end);
}

// Whether the frame is there already. Throws InputError where it has other settings, as far as the file says.
bool is_there(const RenderSession& s, const std::string& file, const View& view, unsigned long long seed) {
  if (s.o.overwrite || !std::filesystem::exists(file)) return false;
  const Image image = read_image(file);
  if (picture_format(file) != PictureFormat::exr) return true;  // other formats have no metadata
  const std::string what = s.difference(image, view, seed, s.budget.spp);
  if (!what.empty())
    throw InputError(
        fmt::format("{}: was rendered with other settings ({}); --overwrite replaces the frames", file, what));
  return true;
}

}  // namespace

void render_frames(RenderSession& s) {
  const std::string& pattern = s.o.output;
  const std::size_t mark = pattern.rfind('#');
  if (mark == std::string::npos || pattern.find('/', mark) != std::string::npos)
    throw UsageError(
        fmt::format("-o {}: --path needs # in the file's name for the frame's number: frame_####.exr", pattern));
  choose_camera(s.scene(), s.o.view);  // refuses other cameras
  const CameraPath path(s.o.view.path_file);
  std::vector<View> views;
  std::vector<int> missing;
  std::vector<std::string> inputs = s.scene().other_files;
  inputs.insert(inputs.end(), {s.o.scene, s.o.model, s.o.view.path_file, s.common.log_json});
  const auto seed_of = [&](int frame) { return s.settings.seed + static_cast<unsigned long long>(frame); };
  std::vector<std::string> files;
  for (int f = 0; f < path.frames(); ++f) files.push_back(frame_file(pattern, f));
  refuse_inputs_as_outputs("-o", files, inputs);
  for (int f = 0; f < path.frames(); ++f) {
    views.push_back(choose_view(s.scene(), s.o.view, path.camera(f)));
    if (!is_there(s, files[static_cast<std::size_t>(f)], views.back(), seed_of(f))) missing.push_back(f);
  }
  RenderResult total;
  int rendered = 0;
  if (!missing.empty()) s.start(views.front());
  for (const int f : missing) {
    const auto n = static_cast<double>(missing.size());
    const View& view = views[static_cast<std::size_t>(f)];
    s.renderer->set_view(view);
    s.renderer->set_seed(seed_of(f));
    const double denoised = s.denoise_seconds;
    RenderResult result = s.render_picture(rendered / n, 1.0 / n);
    total.interrupted = result.interrupted;
    if (total.interrupted) break;  // a frame that is there is a whole one
    const std::string& file = files[static_cast<std::size_t>(f)];
    s.save(result, view, seed_of(f), file);
    ++rendered;
    total.spp = result.spp;
    total.seconds += result.seconds;
    total.samples += result.samples;
    total.counts += result.counts;
    s.log_event("frame", {{"frame", f},
                          {"output", file},
                          {"spp", result.spp},
                          {"seconds", result.seconds},
                          {"denoise_seconds", s.denoise_seconds - denoised}});
  }
  nlohmann::json report = s.report(total, views.front());
  const int skipped = path.frames() - static_cast<int>(missing.size());
  report["path"] = {{"file", s.o.view.path_file},
                    {"frames", path.frames()},
                    {"rendered", rendered},
                    {"skipped", skipped},
                    {"fps", path.fps()}};
  s.log_event("done", report);
  if (s.common.json) print_json(report);
  else
    log_info("{}: {} of {} frames rendered in {}{}, {} there before{}", pattern, rendered, path.frames(),
             format_duration(total.seconds),
             s.denoiser ? fmt::format(", denoised in {}", format_duration(s.denoise_seconds)) : "", skipped,
             total.interrupted ? "; interrupted: the same command goes on" : "");
  if (s.log) s.log->finish();
}

}  // namespace octrad::cli
