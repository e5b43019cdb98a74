#include "octrad/render/renderer.h"

#include <fmt/format.h>

#include <algorithm>

#include "octrad/base/error.h"
#include "octrad/base/stopwatch.h"
#include "octrad/render/cpu_renderer.h"
#include "octrad/render/renderer_device.h"

namespace octrad {

void require_crop_inside(const View& view) {
  const Crop& c = view.crop;
  if (c.width == 0 && c.height == 0) return;
  if (c.x >= 0 && c.y >= 0 && c.width >= 1 && c.height >= 1 && c.x <= view.width - c.width &&
      c.y <= view.height - c.height)
    return;
  throw UsageError(fmt::format("the crop {},{},{},{} (x, y, width, height) does not lie inside the picture of {} x {}",
                               c.x, c.y, c.width, c.height, view.width, view.height));
}

namespace {

constexpr int kLargestReach = 8;  // of a reconstruction filter, pixels; half a tile of the CPU's renderer

// FilmWindow::needed of a view with a mask, for a filter of this reach.
std::vector<std::uint8_t> needed_pixels(const View& view, const FilmWindow& window, int reach) {
  if (view.mask->size() != static_cast<std::size_t>(view.width) * static_cast<std::size_t>(view.height))
    throw UsageError(
        fmt::format("a mask of {} pixels for a picture of {} x {}", view.mask->size(), view.width, view.height));
  const PixelRect &crop = window.crop, &sampled = window.sampled;
  std::vector<std::uint8_t> needed(static_cast<std::size_t>(sampled.width()) *
                                   static_cast<std::size_t>(sampled.height()));
  bool any = false;
  for (int y = crop.y0; y < crop.y1; ++y) {
    for (int x = crop.x0; x < crop.x1; ++x) {
      if (!view.wants(x, y)) continue;
      any = true;
      const int x0 = std::max(sampled.x0, x - reach), x1 = std::min(sampled.x1, x + reach + 1);
      for (int row = std::max(sampled.y0, y - reach); row < std::min(sampled.y1, y + reach + 1); ++row) {
        const auto begin = needed.begin() + static_cast<std::ptrdiff_t>(row - sampled.y0) * sampled.width();
        std::fill(begin + (x0 - sampled.x0), begin + (x1 - sampled.x0), std::uint8_t{1});
      }
    }
  }
  if (!any) throw UsageError("the mask leaves out every pixel of the picture or its crop");
  return needed;
}

FilmWindow film_window(const View& view, const Film& film) {
  if (view.width < 1 || view.height < 1) {
    throw UsageError(fmt::format("a picture of {} x {} pixels: at least 1 x 1 is needed", view.width, view.height));
  }
  require_crop_inside(view);
  FilmWindow window;
  window.crop = view.part();
  const ReconstructionFilter filter(film);
  const int reach = filter.reach();
  if (reach > kLargestReach) {
    throw InputError(fmt::format("reconstruction filter of radius {} pixels: at most {} are supported", filter.radius(),
                                 kLargestReach));
  }
  window.sampled = {std::max(0, window.crop.x0 - reach), std::max(0, window.crop.y0 - reach),
                    std::min(view.width, window.crop.x1 + reach), std::min(view.height, window.crop.y1 + reach)};
  if (view.mask) window.needed = needed_pixels(view, window, reach);
  return window;
}

}  // namespace

void Renderer::set_view(const View& view) {
  window_ = film_window(view, settings_.film);
  view_ = view;
  view_changed();
  clear();
}

Image Renderer::image(const ChannelRange& channels) {
  Image image = film_image(channels);
  if (!view_.mask) return image;
  const PixelRect& crop = window_.crop;
  for (int y = crop.y0; y < crop.y1; ++y) {
    for (int x = crop.x0; x < crop.x1; ++x) {
      if (view_.wants(x, y)) continue;
      for (int c = 0; c < static_cast<int>(image.channels.size()); ++c) image.at(x - crop.x0, y - crop.y0, c) = 0.0f;
    }
  }
  return image;
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

void Renderer::set_seed(unsigned long long seed) {
  settings_.seed = seed;
  seed_changed();
  if (view_.width > 0) clear();
}

void Renderer::restore(const FilmState& state) {
  const PixelRect& crop = window_.crop;
  const std::size_t expected =
      static_cast<std::size_t>(crop.width()) * static_cast<std::size_t>(crop.height()) * kFilmNumbers;
  if (state.sums.size() != expected)
    throw InputError(fmt::format("a film of {} numbers, where the view has {}", state.sums.size(), expected));
  int samples = 0;
  while (samples < state.samples && next_pass(samples, largest_pass()) == next_pass(samples, state.largest_pass))
    samples += next_pass(samples, largest_pass());
  if (passes_matter() && samples != state.samples)
    throw InputError(
        fmt::format("its samples were taken in passes of up to {}, here they are of up to {}: the bits would "
                    "not be those of one run",
                    state.largest_pass, largest_pass()));
  clear();
  set_sums(state.sums);
  samples_ = state.samples;
}

void Renderer::clear() {
  clear_film();
  samples_ = 0;
}

bool Renderer::add_samples(int count, const std::function<bool()>& stop) {
  if (!sample(samples_, count, stop)) return false;
  samples_ += count;
  return true;
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

int next_pass(int samples, int largest_pass) { return std::min(std::max(1, samples), largest_pass); }

RenderResult render(Renderer& renderer, const RenderBudget& asked) {
  RenderBudget budget = asked;
  if (renderer.integrator().one_sample) {
    budget.spp = 1;
    budget.seconds = 0.0;
  }
  if (budget.spp < 1 && !(budget.seconds > 0.0)) throw UsageError("neither a number of samples nor a time was given");
  RenderResult result;
  renderer.clear();
  if (budget.from) renderer.restore(*budget.from);
  const double before = budget.from ? budget.from->seconds : 0.0;
  if (budget.from) result.counts = budget.from->counts;
  renderer.take_counts();
  const int largest = renderer.largest_pass();
  const Stopwatch watch;
  Stopwatch since_save;
  int saved = renderer.samples();
  const auto save = [&] {
    if (!budget.save || renderer.samples() == saved) return;
    result.counts += renderer.take_counts();
    budget.save({renderer.samples(), largest, before + watch.seconds(), result.counts, renderer.sums()});
    saved = renderer.samples();
    since_save = {};
  };
  bool whole = true;
  while (budget.spp < 1 || renderer.samples() < budget.spp) {
    if (budget.interrupted && budget.interrupted()) {
      result.interrupted = true;
      break;
    }
    if (budget.seconds > 0.0 && renderer.samples() > 0 && before + watch.seconds() >= budget.seconds) break;
    int count = next_pass(renderer.samples(), largest);
    whole = budget.spp < 1 || count <= budget.spp - renderer.samples();
    if (!whole) {
      save();
      count = budget.spp - renderer.samples();
    } else if (since_save.seconds() >= budget.save_every) {
      save();
    }
    if (!renderer.add_samples(count, budget.interrupted)) {
      result.interrupted = true;
      break;
    }
    if (budget.progress) budget.progress(renderer.samples(), before + watch.seconds());
  }
  if (whole) save();
  result.seconds = before + watch.seconds();
  result.spp = renderer.samples();
  result.samples = renderer.window().sampled_pixels() * result.spp;
  result.counts += renderer.take_counts();
  result.image = renderer.image();
  return result;
}

}  // namespace octrad
