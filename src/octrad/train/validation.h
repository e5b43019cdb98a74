// Error of a field against a reference picture while it trains: a fixed set of primary hits, queried again and again.
// Mirrors and glass are passed as in pictures (render.delta).
#pragma once

#include <vector>

#include "octrad/image/image.h"
#include "octrad/train/engine.h"
#include "octrad/transport/context.h"

namespace octrad {

class Validation {
 public:
  // At most `max_pixels` pixels spread over the reference (of the scene's first camera), `spp` jittered primary hits
  // each. Throws InputError for a reference without colour.
  Validation(const TransportContext& context, const Image& reference, const Config& config, int max_pixels, int spp);

  // MAPE of image/metrics.h over these pixels.
  double mape(TrainEngine& engine) const;

 private:
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
