#include "app/report/measure.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "octrad/image/ssim.h"
#include "octrad/image/tonemap.h"

namespace octrad::report {
namespace {

// Mean of a map over the pixels that are usable and have a value.
std::optional<double> mean_of(const Image& map, const std::vector<std::uint8_t>& usable) {
  double sum = 0.0;
  long long count = 0;
  for (std::size_t p = 0; p < usable.size(); ++p) {
    if (usable[p] == 0 || std::isnan(map.data[p])) continue;
    sum += static_cast<double>(map.data[p]);
    ++count;
  }
  if (count == 0) return std::nullopt;
  return sum / static_cast<double>(count);
}

// Black where a value of the pixel is not finite.
Image finite(Image rgb) {
  for (std::size_t p = 0; p < rgb.pixel_count(); ++p) {
    float* v = &rgb.data[3 * p];
    if (!std::isfinite(v[0]) || !std::isfinite(v[1]) || !std::isfinite(v[2])) std::fill_n(v, 3, 0.0f);
  }
  return rgb;
}

nlohmann::json number(std::optional<double> value) {
  return value && std::isfinite(*value) ? nlohmann::json(*value) : nlohmann::json();
}

}  // namespace

Reference::Reference(const Image& file, std::vector<std::uint8_t> mask, double flip_ppd, const Lpips* lpips)
    : linear_(linear_color(file)),
      display_referred_(is_display_referred(file)),
      mask_(std::move(mask)),
      usable_(mask_.empty() ? std::vector<std::uint8_t>(file.pixel_count(), 1) : mask_),
      flip_ppd_(flip_ppd),
      lpips_(lpips) {
  for (std::size_t p = 0; p < usable_.size(); ++p) {
    const float* v = &linear_.data[3 * p];
    if (!std::isfinite(v[0]) || !std::isfinite(v[1]) || !std::isfinite(v[2])) usable_[p] = 0;
  }
  all_usable_ = std::all_of(usable_.begin(), usable_.end(), [](std::uint8_t u) { return u != 0; });
  shown_ = shown_linear_color(finite(linear_));
  exposures_ = flip_exposures(finite(linear_));
  if (lpips_ != nullptr && std::min(file.width, file.height) >= lpips_->smallest_side())
    features_ = lpips_->features(display_color(shown_));
}

const Image& Reference::compared(const Image& file, Image& linear) const {
  const bool shown = display_referred_ || is_display_referred(file);
  linear = shown ? shown_linear_color(file) : linear_color(file);
  return shown ? shown_ : linear_;
}

Metrics Reference::metrics(const Image& file, std::span<const std::uint8_t> mask) const {
  Image linear;
  const Image& reference = compared(file, linear);
  return compare(reference, linear, mask);
}

Image Reference::flip_map(const Image& file) const {
  const Image image = finite(linear_color(file));
  if (display_referred_ || is_display_referred(file)) return flip_ldr(shown_, shown_linear_color(image), flip_ppd_);
  return flip_hdr(all_usable_ ? linear_ : finite(linear_), image, exposures_, flip_ppd_);
}

PictureErrors Reference::errors(const Image& file) const {
  PictureErrors errors;
  Image linear;
  const Image& reference = compared(file, linear);
  errors.hdr = !display_referred_ && !is_display_referred(file);
  // compare() looks for pixels that are not finite itself, but what a screen shows is always finite.
  errors.metrics = compare(reference, linear, errors.hdr ? mask_ : usable_);
  errors.flip = mean_of(flip_map(file), usable_);
  const Image displayed = display_color(finite(std::move(linear)));
  errors.ssim = mean_of(ssim_image(display_color(shown_), displayed), usable_);
  if (features_) {
    errors.lpips = lpips_->distance(*features_, lpips_->features(displayed),
                                    all_usable_ ? std::span<const std::uint8_t>() : std::span(usable_));
  }
  return errors;
}

nlohmann::json to_json(const PictureErrors& e) {
  const Metrics& m = e.metrics;
  return {{"mape", m.mape},
          {"mape_trimmed", m.mape_trimmed},
          {"mse", m.mse},
          {"relmse", m.relmse},
          {"psnr", number(m.psnr)},
          {"ssim", number(e.ssim)},
          {"flip", number(e.flip)},
          {"flip_range", e.hdr ? "hdr" : "ldr"},
          {"lpips", number(e.lpips)},
          {"mean_ratio", number(m.mean_ratio)},
          {"pixels", m.pixels},
          {"non_finite", m.non_finite_image}};
}

}  // namespace octrad::report
