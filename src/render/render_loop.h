// What all integrators share: camera samples in tiles, passes of one sample a pixel, accumulation with the film's
// reconstruction filter, first-hit attributes, time limit and interruption. An integrator is a SampleFunction.
#pragma once

#include <functional>
#include <span>
#include <string>

#include "base/rng.h"
#include "image/image.h"
#include "scene/scene.h"

namespace octrad {

struct Crop {
  int x = 0, y = 0, width = 0, height = 0;  // width 0: the whole picture
};

struct RenderOptions {
  Camera camera;
  int width = 0, height = 0;       // of the whole picture
  Crop crop;                       // only this part is rendered and returned
  int spp = 16;                    // samples a pixel; 0: until `seconds` are over
  double seconds = 0.0;            // stop after this time (between passes); 0: no limit
  int max_depth = -1;              // path: Mitsuba's meaning, -1 unlimited
  int rr_depth = 5;                // path: Russian roulette from this depth on
  unsigned long long seed = 0;
  Film film;                       // reconstruction filter
  std::function<bool()> interrupted;
  std::function<void(int spp_done, double seconds)> progress;  // after each pass
};

// One primary ray with the random stream of its pixel and sample.
struct CameraSample {
  Ray ray;
  Rng rng;
  Vec2f position;                  // on the film, pixels
};

// What an integrator finds for it. Attributes are those of the first hit (method section 1); zero where nothing is hit.
struct PixelSample {
  Vec3f radiance, albedo, normal;
  float depth = 0.0f;              // distance along the ray
  float roughness = 0.0f;
};

struct SampleCounts {
  long long rays = 0, queries = 0, non_finite = 0;
};

// Fills out[i] for samples[i]; called from several threads for about a thousand samples at a time.
using SampleFunction = std::function<SampleCounts(std::span<CameraSample> samples, std::span<PixelSample> out)>;

struct RenderResult {
  Image image;                     // R,G,B, albedo.R/G/B, normal.X/Y/Z, depth.Z, roughness.Y
  int width = 0, height = 0, spp = 0;
  double seconds = 0.0;            // of the rendering alone
  long long samples = 0;
  SampleCounts counts;
  bool interrupted = false;
};

// The same bits for a seed at any thread count. Samples that are not finite count as black (SampleCounts::non_finite).
RenderResult render(const RenderOptions& options, const SampleFunction& integrator);

}  // namespace octrad
