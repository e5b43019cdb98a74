// What all integrators share: camera samples in tiles, passes, accumulation with the film's reconstruction filter,
// first-hit attributes, time limit and interruption. An integrator is a SampleFunction.
#pragma once

#include <functional>
#include <span>
#include <string>

#include "octrad/base/rng.h"
#include "octrad/image/image.h"
#include "octrad/render/film.h"
#include "octrad/scene/scene.h"

namespace octrad {

struct Crop {
  int x = 0, y = 0, width = 0, height = 0;  // width 0: the whole picture
};

struct RenderOptions {
  Camera camera;
  int width = 0, height = 0;  // of the whole picture
  Crop crop;                  // only this part is rendered and returned
  int spp = 16;               // samples a pixel; 0: until `seconds` are over
  double seconds = 0.0;       // stop after this time (between passes); 0: no limit
  int max_depth = -1;         // path: Mitsuba's meaning, -1 unlimited
  int rr_depth = 5;           // path: Russian roulette from this depth on
  unsigned long long seed = 0;
  Film film;  // reconstruction filter
  std::function<bool()> interrupted;
  std::function<void(int spp_done, double seconds)> progress;  // after each pass
};

struct SampleCounts {
  long long rays = 0, queries = 0, non_finite = 0;
  SampleCounts& operator+=(const SampleCounts& b) {
    rays += b.rays;
    queries += b.queries;
    non_finite += b.non_finite;
    return *this;
  }
};

// Fills out[i] for samples[i], the samples of one tile; called from several threads for some hundred to a few thousand
// samples.
using SampleFunction = std::function<SampleCounts(std::span<CameraSample> samples, std::span<PixelSample> out)>;

struct RenderResult {
  Image image;  // R,G,B, albedo.R/G/B, normal.X/Y/Z, depth.Z, roughness.Y
  int width = 0, height = 0, spp = 0;
  double seconds = 0.0;  // of the rendering alone
  long long samples = 0;
  SampleCounts counts;
  bool interrupted = false;
};

// Every sample depends on (seed, pixel, number of the sample) alone and sums are formed in double in a fixed order: the
// same bits for a seed at any thread count, and a crop holds that part of the whole picture. The size of a pass (some
// 100,000 samples, at least one a pixel) does not depend on time either. Samples that are not finite count as black
// (SampleCounts::non_finite). Throws UsageError for sizes, crops and budgets that make no sense.
RenderResult render(const RenderOptions& options, const SampleFunction& integrator);

// What render() consists of, for integrators that are not called tile by tile (render/device_render.h).

// A part of the picture, half-open.
struct PictureWindow {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  int width() const { return x1 - x0; }
  int height() const { return y1 - y0; }
};

struct PassPlan {
  ReconstructionFilter filter;
  int reach = 0;         // of the filter beyond a sample's own pixel
  PictureWindow crop;    // what is returned
  PictureWindow window;  // what is sampled: pixels around the crop reach into it
};
// Throws as render() does.
PassPlan plan_passes(const RenderOptions& options);

// Calls pass(first, count), which takes samples [first, first + count) of every pixel of the window, until the budget
// is used up or the user interrupts. Passes of 1, 1, 2, 4, ... samples a pixel up to `largest`. Fills spp, seconds,
// samples, interrupted.
RenderResult run_passes(const RenderOptions& options, const PassPlan& plan, int largest,
                        const std::function<void(int first, int count)>& pass);

}  // namespace octrad
