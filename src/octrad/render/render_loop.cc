#include "octrad/render/render_loop.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "octrad/base/error.h"
#include "octrad/base/stopwatch.h"
#include "octrad/base/threads.h"

namespace octrad {
namespace {

constexpr int kTile = 16;  // pixels a side
// Camera samples of a pass: few enough to stop in time, enough to keep all threads busy.
constexpr long long kPassSamples = 1 << 17;

PictureWindow crop_window(const RenderOptions& o) {
  const Crop& c = o.crop;
  if (c.width == 0 && c.height == 0) return {0, 0, o.width, o.height};
  if (c.x < 0 || c.y < 0 || c.width < 1 || c.height < 1 || c.x + c.width > o.width || c.y + c.height > o.height) {
    throw UsageError(
        fmt::format("the crop {},{},{},{} (x, y, width, height) does not lie inside the picture of {} x {}", c.x, c.y,
                    c.width, c.height, o.width, o.height));
  }
  return {c.x, c.y, c.x + c.width, c.y + c.height};
}

// Samples [first, first + count) of every pixel of a tile; put(x, y, position, sample) gets them pixel by pixel.
template <typename Put>
SampleCounts render_tile(const RenderOptions& o, const SampleFunction& integrator, const PictureWindow& w, int first,
                         int count, const Put& put) {
  std::vector<CameraSample>
      samples;  // not thread_local: an integrator that runs in parallel inside may start other tiles in between
  samples.reserve(static_cast<std::size_t>(w.x1 - w.x0) * static_cast<std::size_t>(w.y1 - w.y0) *
                  static_cast<std::size_t>(count));
  const CameraView view = o.camera.view(o.width, o.height);
  for (int y = w.y0; y < w.y1; ++y) {
    for (int x = w.x0; x < w.x1; ++x) {
      for (int i = first; i < first + count; ++i) samples.push_back(camera_sample(view, o.seed, x, y, i));
    }
  }
  std::vector<PixelSample> found(samples.size());
  SampleCounts counts = integrator(samples, found);
  std::size_t n = 0;
  for (int y = w.y0; y < w.y1; ++y) {
    for (int x = w.x0; x < w.x1; ++x) {
      for (int i = 0; i < count; ++i, ++n) {
        if (!is_finite(found[n].radiance)) {
          found[n].radiance = Vec3f(0.0f);
          ++counts.non_finite;
        }
        put(x, y, samples[n].position, found[n]);
      }
    }
  }
  return counts;
}

}  // namespace

PassPlan plan_passes(const RenderOptions& options) {
  if (options.width < 1 || options.height < 1) {
    throw UsageError(
        fmt::format("a picture of {} x {} pixels: at least 1 x 1 is needed", options.width, options.height));
  }
  if (options.spp < 1 && !(options.seconds > 0.0)) throw UsageError("neither a number of samples nor a time was given");
  PassPlan plan{ReconstructionFilter(options.film), 0, crop_window(options), {}};
  plan.reach = plan.filter.is_box() ? 0 : static_cast<int>(std::ceil(plan.filter.radius()));
  if (plan.reach > kTile / 2) {
    throw InputError(fmt::format("reconstruction filter of radius {} pixels: at most {} are supported",
                                 plan.filter.radius(), kTile / 2));
  }
  plan.window = {std::max(0, plan.crop.x0 - plan.reach), std::max(0, plan.crop.y0 - plan.reach),
                 std::min(options.width, plan.crop.x1 + plan.reach),
                 std::min(options.height, plan.crop.y1 + plan.reach)};
  return plan;
}

RenderResult run_passes(const RenderOptions& options, const PassPlan& plan, int largest,
                        const std::function<void(int first, int count)>& pass) {
  RenderResult result;
  const Stopwatch watch;
  while (options.spp < 1 || result.spp < options.spp) {
    if (options.interrupted && options.interrupted()) {
      result.interrupted = true;
      break;
    }
    if (options.seconds > 0.0 && result.spp > 0 && watch.seconds() >= options.seconds) break;
    int count = std::min(std::max(1, result.spp), largest);
    if (options.spp > 0) count = std::min(count, options.spp - result.spp);
    pass(result.spp, count);
    result.spp += count;
    if (options.progress) options.progress(result.spp, watch.seconds());
  }
  result.seconds = watch.seconds();
  result.samples = static_cast<long long>(plan.window.width()) * plan.window.height() * result.spp;
  return result;
}

RenderResult render(const RenderOptions& options, const SampleFunction& integrator) {
  const PassPlan plan = plan_passes(options);
  const PictureWindow& window = plan.window;
  const int reach = plan.reach;
  FilmBuffer film(plan.crop.x0, plan.crop.y0, plan.crop.width(), plan.crop.height());

  // Tiles lie on a grid fixed to the picture. With filters that reach over a tile's rim they are added to the film in
  // four rounds, in each of which no two touch the same pixel: every pixel is summed in the same order whatever the
  // threads do.
  std::vector<PictureWindow> tiles;
  std::vector<std::vector<std::size_t>> rounds(reach > 0 ? 4 : 1);
  for (int ty = window.y0 / kTile; ty * kTile < window.y1; ++ty) {
    for (int tx = window.x0 / kTile; tx * kTile < window.x1; ++tx) {
      rounds[reach > 0 ? static_cast<std::size_t>((ty % 2) * 2 + tx % 2) : 0].push_back(tiles.size());
      tiles.push_back({std::max(window.x0, tx * kTile), std::max(window.y0, ty * kTile),
                       std::min(window.x1, (tx + 1) * kTile), std::min(window.y1, (ty + 1) * kTile)});
    }
  }

  // The largest pass depends on the picture alone.
  const long long pixels = static_cast<long long>(options.width) * options.height;
  const int largest = static_cast<int>(std::clamp<long long>(kPassSamples / pixels, 1, 64));
  std::vector<SampleCounts> counts(tiles.size());
  RenderResult result = run_passes(options, plan, largest, [&](int first, int count) {
    for (const std::vector<std::size_t>& round : rounds) {
      parallel_for(round.size(), [&](std::size_t i) {
        const PictureWindow& w = tiles[round[i]];
        SampleCounts c;
        if (reach == 0) {
          c = render_tile(options, integrator, w, first, count,
                          [&](int x, int y, Vec2f, const PixelSample& s) { film.add_to_pixel(x, y, s); });
        } else {
          FilmBuffer local(w.x0 - reach, w.y0 - reach, w.width() + 2 * reach, w.height() + 2 * reach);
          c = render_tile(options, integrator, w, first, count,
                          [&](int, int, Vec2f p, const PixelSample& s) { local.add(plan.filter, p, s); });
          film.add(local);
        }
        counts[round[i]] += c;
      });
    }
  });
  for (const SampleCounts& c : counts) result.counts += c;
  result.image = film.image();
  result.width = film.width();
  result.height = film.height();
  return result;
}

}  // namespace octrad
