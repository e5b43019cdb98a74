// Every metric of a picture against a reference, with what they share: masks, activations of the reference, exposures.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <vector>

#include "octrad/image/flip.h"
#include "octrad/image/image.h"
#include "octrad/image/metrics.h"
#include "octrad/perceptual/lpips.h"

namespace octrad::report {

// All metrics of one picture. Those without a value: SSIM of a picture (or a mask) in which no window fits, LPIPS
// without weights or of a picture too small for its network.
struct PictureErrors {
  Metrics metrics;
  std::optional<double> ssim, flip, lpips;
  bool hdr = true;  // FLIP was HDR-FLIP; false: LDR-FLIP, because a picture is display-referred
};

// A reference and what is computed of it once. Where it or a picture is display-referred (PNG, JPEG), both are compared
// as the screen shows them: limited to [0, 1], linear for `metrics`, sRGB-encoded for SSIM and LPIPS.
class Reference {
 public:
  // `mask`: as compare() takes it. `lpips` may be null and must outlive this object. Throws InputError without colour.
  Reference(const Image& file, std::vector<std::uint8_t> mask, double flip_ppd, const Lpips* lpips);

  // Throws as compare() does. The same bits at any number of threads.
  PictureErrors errors(const Image& file) const;
  // The errors within another mask, of linear values only.
  Metrics metrics(const Image& file, std::span<const std::uint8_t> mask) const;
  // FLIP at each pixel (channel "Y"), as errors() has its mean.
  Image flip_map(const Image& file) const;
  // The linear values that errors() compares, of the reference and of `file`.
  const Image& compared(const Image& file, Image& linear) const;
  const std::vector<std::uint8_t>& mask() const { return mask_; }

 private:
  Image linear_, shown_;  // linear values; those in [0, 1] that a screen shows
  bool display_referred_ = false;
  std::vector<std::uint8_t> mask_;    // as given
  std::vector<std::uint8_t> usable_;  // the same without pixels that are not finite
  bool all_usable_ = true;
  FlipExposures exposures_;
  double flip_ppd_;
  const Lpips* lpips_;
  std::optional<Lpips::Features> features_;
};

// The object that `compare --json` has for a picture: every column, and non_finite. Values that are not finite are
// null.
nlohmann::json to_json(const PictureErrors& errors);

}  // namespace octrad::report
