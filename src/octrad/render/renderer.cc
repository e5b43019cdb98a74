#include "octrad/render/renderer.h"

#include <fmt/format.h>

#include <algorithm>

#include "octrad/base/error.h"
#include "octrad/base/stopwatch.h"
#include "octrad/render/cpu_renderer.h"
#include "octrad/render/renderer_device.h"

namespace octrad {
namespace {

constexpr int kLargestReach = 8;  // of a reconstruction filter, pixels; half a tile of the CPU's renderer

FilmWindow film_window(const View& view, const Film& film) {
  if (view.width < 1 || view.height < 1) {
    throw UsageError(fmt::format("a picture of {} x {} pixels: at least 1 x 1 is needed", view.width, view.height));
  }
  FilmWindow window;
  const Crop& c = view.crop;
  window.crop = {0, 0, view.width, view.height};
  if (c.width != 0 || c.height != 0) {
    if (c.x < 0 || c.y < 0 || c.width < 1 || c.height < 1 || c.x > view.width - c.width ||
        c.y > view.height - c.height) {
      throw UsageError(
          fmt::format("the crop {},{},{},{} (x, y, width, height) does not lie inside the picture of {} x {}", c.x, c.y,
                      c.width, c.height, view.width, view.height));
    }
    window.crop = {c.x, c.y, c.x + c.width, c.y + c.height};
  }
  const ReconstructionFilter filter(film);
  const int reach = filter.reach();
  if (reach > kLargestReach) {
    throw InputError(fmt::format("reconstruction filter of radius {} pixels: at most {} are supported", filter.radius(),
                                 kLargestReach));
  }
  window.sampled = {std::max(0, window.crop.x0 - reach), std::max(0, window.crop.y0 - reach),
                    std::min(view.width, window.crop.x1 + reach), std::min(view.height, window.crop.y1 + reach)};
  return window;
}

}  // namespace

void Renderer::set_view(const View& view) {
  window_ = film_window(view, settings_.film);
  view_ = view;
  view_changed();
  clear();
}

void Renderer::set_model(RadianceField& field, const Config& config) {
  const std::string name = choice_.info->name + (choice_.level > 0 ? std::to_string(choice_.level) : "");
  find_integrator(name, &field);
  const bool same_shape = &field == field_ && config == config_;
  field_ = &field;
  config_ = config;
  model_changed(same_shape);
  if (view_.width > 0) set_view(view_);
}

void Renderer::clear() {
  clear_film();
  samples_ = 0;
}

void Renderer::add_samples(int count) {
  sample(samples_, count);
  samples_ += count;
}

std::unique_ptr<Renderer> make_renderer(const PreparedScene& scene, const std::string& integrator,
                                        const RenderSettings& settings, RadianceField* field, const Config& config,
                                        Stream* stream) {
  const IntegratorChoice choice = find_integrator(integrator, field);
  if (choice.info->needs_model && field == nullptr)
    throw UsageError(fmt::format("integrator {}: needs a model", integrator));
  if (!choice.info->needs_model) field = nullptr;
  if (stream == nullptr) return make_cpu_renderer(scene, choice, settings, field, config);
  if (choice.info->make_device == nullptr)
    throw UsageError(fmt::format("integrator {}: runs on the CPU only", integrator));
  return make_stream_renderer(*stream, scene, choice, settings, field, config);
}

RenderResult render(Renderer& renderer, const RenderBudget& asked) {
  RenderBudget budget = asked;
  if (renderer.integrator().one_sample) {
    budget.spp = 1;
    budget.seconds = 0.0;
  }
  if (budget.spp < 1 && !(budget.seconds > 0.0)) throw UsageError("neither a number of samples nor a time was given");
  RenderResult result;
  renderer.clear();
  renderer.take_counts();
  const int largest = renderer.largest_pass();
  const Stopwatch watch;
  while (budget.spp < 1 || renderer.samples() < budget.spp) {
    if (budget.interrupted && budget.interrupted()) {
      result.interrupted = true;
      break;
    }
    if (budget.seconds > 0.0 && renderer.samples() > 0 && watch.seconds() >= budget.seconds) break;
    int count = std::min(std::max(1, renderer.samples()), largest);
    if (budget.spp > 0) count = std::min(count, budget.spp - renderer.samples());
    renderer.add_samples(count);
    if (budget.progress) budget.progress(renderer.samples(), watch.seconds());
  }
  result.seconds = watch.seconds();
  result.spp = renderer.samples();
  const PixelRect& sampled = renderer.window().sampled;
  result.samples = static_cast<long long>(sampled.width()) * sampled.height() * result.spp;
  result.counts = renderer.take_counts();
  result.image = renderer.image();
  return result;
}

}  // namespace octrad
