#include "render/render_loop.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/error.h"
#include "base/stopwatch.h"
#include "base/threads.h"

namespace octrad {
namespace {

constexpr int kTile = 16;          // pixels a side
// Camera samples of a pass: few enough to stop in time, enough to keep all threads busy.
constexpr long long kPassSamples = 1 << 17;

struct Window {
  int x0, y0, x1, y1;              // half-open
};

Window crop_window(const RenderOptions& o) {
  const Crop& c = o.crop;
  if (c.width == 0 && c.height == 0) return {0, 0, o.width, o.height};
  if (c.x < 0 || c.y < 0 || c.width < 1 || c.height < 1 || c.x + c.width > o.width || c.y + c.height > o.height) {
    throw UsageError(fmt::format("the crop {},{},{},{} (x, y, width, height) does not lie inside the picture of {} x {}", c.x, c.y,
                                 c.width, c.height, o.width, o.height));
  }
  return {c.x, c.y, c.x + c.width, c.y + c.height};
}

// Samples [first, first + count) of every pixel of a tile; put(x, y, position, sample) gets them pixel by pixel.
template <typename Put>
SampleCounts render_tile(const RenderOptions& o, const SampleFunction& integrator, const Window& w, int first, int count, const Put& put) {
  std::vector<CameraSample> samples;  // not thread_local: an integrator that runs in parallel inside may start other tiles in between
  samples.reserve(static_cast<std::size_t>(w.x1 - w.x0) * static_cast<std::size_t>(w.y1 - w.y0) * static_cast<std::size_t>(count));
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

RenderResult render(const RenderOptions& options, const SampleFunction& integrator) {
  if (options.width < 1 || options.height < 1) {
    throw UsageError(fmt::format("a picture of {} x {} pixels: at least 1 x 1 is needed", options.width, options.height));
  }
  if (options.spp < 1 && !(options.seconds > 0.0)) throw UsageError("neither a number of samples nor a time was given");
  const ReconstructionFilter filter(options.film);
  const int reach = filter.is_box() ? 0 : static_cast<int>(std::ceil(filter.radius()));
  if (reach > kTile / 2) {
    throw InputError(fmt::format("reconstruction filter of radius {} pixels: at most {} are supported", filter.radius(), kTile / 2));
  }
  const Window crop = crop_window(options);
  FilmBuffer film(crop.x0, crop.y0, crop.x1 - crop.x0, crop.y1 - crop.y0);
  // Pixels around the crop whose samples reach into it are rendered too.
  const Window window{std::max(0, crop.x0 - reach), std::max(0, crop.y0 - reach), std::min(options.width, crop.x1 + reach),
                      std::min(options.height, crop.y1 + reach)};

  // Tiles lie on a grid fixed to the picture. With filters that reach over a tile's rim they are added to the film in four
  // rounds, in each of which no two touch the same pixel: every pixel is summed in the same order whatever the threads do.
  std::vector<Window> tiles;
  std::vector<std::vector<std::size_t>> rounds(reach > 0 ? 4 : 1);
  for (int ty = window.y0 / kTile; ty * kTile < window.y1; ++ty) {
    for (int tx = window.x0 / kTile; tx * kTile < window.x1; ++tx) {
      rounds[reach > 0 ? static_cast<std::size_t>((ty % 2) * 2 + tx % 2) : 0].push_back(tiles.size());
      tiles.push_back({std::max(window.x0, tx * kTile), std::max(window.y0, ty * kTile), std::min(window.x1, (tx + 1) * kTile),
                       std::min(window.y1, (ty + 1) * kTile)});
    }
  }

  // Passes of 1, 1, 2, 4, ... samples a pixel up to a limit that depends on the picture alone.
  const long long pixels = static_cast<long long>(options.width) * options.height;
  const int largest_pass = static_cast<int>(std::clamp<long long>(kPassSamples / pixels, 1, 64));
  std::vector<SampleCounts> counts(tiles.size());
  RenderResult result;
  const Stopwatch watch;
  while (options.spp < 1 || result.spp < options.spp) {
    if (options.interrupted && options.interrupted()) {
      result.interrupted = true;
      break;
    }
    if (options.seconds > 0.0 && result.spp > 0 && watch.seconds() >= options.seconds) break;
    int count = std::min(std::max(1, result.spp), largest_pass);
    if (options.spp > 0) count = std::min(count, options.spp - result.spp);
    for (const std::vector<std::size_t>& round : rounds) {
      parallel_for(round.size(), [&](std::size_t i) {
        const Window& w = tiles[round[i]];
        SampleCounts c;
        if (reach == 0) {
          c = render_tile(options, integrator, w, result.spp, count,
                          [&](int x, int y, Vec2f, const PixelSample& s) { film.add_to_pixel(x, y, s); });
        } else {
          FilmBuffer local(w.x0 - reach, w.y0 - reach, w.x1 - w.x0 + 2 * reach, w.y1 - w.y0 + 2 * reach);
          c = render_tile(options, integrator, w, result.spp, count, [&](int, int, Vec2f p, const PixelSample& s) { local.add(filter, p, s); });
          film.add(local);
        }
        SampleCounts& total = counts[round[i]];
        total.rays += c.rays;
        total.queries += c.queries;
        total.non_finite += c.non_finite;
      });
    }
    result.spp += count;
    if (options.progress) options.progress(result.spp, watch.seconds());
  }
  result.seconds = watch.seconds();
  result.samples = static_cast<long long>(window.x1 - window.x0) * (window.y1 - window.y0) * result.spp;
  for (const SampleCounts& c : counts) {
    result.counts.rays += c.rays;
    result.counts.queries += c.queries;
    result.counts.non_finite += c.non_finite;
  }
  result.image = film.image();
  result.width = film.width();
  result.height = film.height();
  return result;
}

}  // namespace octrad
