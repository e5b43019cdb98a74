// Error of a field against a reference picture while it trains: a fixed set of primary hits, queried again and again.
// Mirrors and glass are passed as in pictures (render.delta).
#pragma once

#include <vector>

#include "octrad/image/metrics.h"
#include "octrad/train/engine.h"
#include "octrad/transport/context.h"

namespace octrad {

class Validation {
 public:
  // At most `max_pixels` pixels spread over the reference (of the scene's first camera), `spp` jittered primary hits
  // each. Throws InputError for a reference without colour, and where none of these pixels is finite.
  Validation(const TransportContext& context, const Image& reference, const Config& config, int max_pixels, int spp);
  // The MAPE of so many pixels, without keeping them all in memory.
  static double mape_once(const TransportContext& context, const Image& reference, const Config& config, int max_pixels,
                          int spp, TrainEngine& engine);

  // MAPE of image/metrics.h over these pixels.
  double mape(TrainEngine& engine) const;

 private:
  struct Pixels;  // of the reference, with their colours
  Validation(const TransportContext& context, const Pixels& pixels, const Config& config, int spp);
  Validation(const TransportContext& context, const Pixels& pixels, std::size_t begin, std::size_t end,
             const Config& config, int spp);
  Metrics metrics(TrainEngine& engine) const;

  int spp_;
  Image reference_;           // the chosen pixels, in one row
  std::vector<Vec3f> known_;  // radiance of each pixel that needs no field, summed over its samples
  std::vector<SurfacePoint> points_;
  struct Owner {
    std::size_t pixel;
    Vec3f weight;  // of the delta surfaces passed before the point
  };
  std::vector<Owner> owners_;  // of each point
};

}  // namespace octrad
