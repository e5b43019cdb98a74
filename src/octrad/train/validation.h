// Error of a field against a reference picture while it trains: a fixed set of primary hits, queried again and again.
#pragma once

#include <vector>

#include "octrad/image/image.h"
#include "octrad/train/engine.h"
#include "octrad/transport/context.h"

namespace octrad {

class Validation {
 public:
  // At most `max_pixels` pixels spread over the reference (of the scene's first camera), `spp` jittered primary hits
  // each.
  Validation(const TransportContext& context, const Image& reference, const Config& config, int max_pixels, int spp);

  // MAPE of method section 10: mean of |I - R| / (R + 0.01) over the pixels and RGB.
  double mape(TrainEngine& engine) const;

 private:
  struct Pixel {
    Vec3f reference, known;
  };  // known: emission and environment seen directly
  int spp_;
  std::vector<Pixel> pixels_;
  std::vector<SurfacePoint> points_;
  std::vector<std::size_t> owner_;  // pixel of each point
};

}  // namespace octrad
