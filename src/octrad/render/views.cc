// Views of what a field holds (method section 8).
#include <algorithm>
#include <cmath>

#include "octrad/base/rng.h"
#include "octrad/model/radiance_field.h"
#include "octrad/render/integrators.h"
#include "octrad/render/view_parts.h"
#include "octrad/transport/prepared_scene.h"
#include "octrad/transport/query_point.h"

namespace octrad {
namespace {

// First three principal components of n vectors of `width` floats, by power iteration with deflation; each scaled to
// [0, 1] over the 1st to 99th percentile.
std::vector<Vec3f> principal_components(const std::vector<float>& features, std::size_t n, std::size_t width) {
  std::vector<double> mean(width), covariance(width * width);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t f = 0; f < width; ++f)
      mean[f] += static_cast<double>(features[i * width + f]) / static_cast<double>(n);
  }
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t a = 0; a < width; ++a) {
      for (std::size_t b = 0; b < width; ++b) {
        covariance[a * width + b] += (static_cast<double>(features[i * width + a]) - mean[a]) *
                                     (static_cast<double>(features[i * width + b]) - mean[b]);
      }
    }
  }
  std::vector<Vec3f> colors(n);
  for (int c = 0; c < 3 && static_cast<std::size_t>(c) < width; ++c) {
    std::vector<double> axis(width, 0.0);
    for (std::size_t f = 0; f < width; ++f) axis[f] = 1.0 + static_cast<double>(f) * 0.1;
    double eigenvalue = 0.0;
    for (int iteration = 0; iteration < 200; ++iteration) {
      std::vector<double> next(width, 0.0);
      for (std::size_t a = 0; a < width; ++a) {
        for (std::size_t b = 0; b < width; ++b) next[a] += covariance[a * width + b] * axis[b];
      }
      double norm = 0.0;
      for (const double v : next) norm += v * v;
      eigenvalue = std::sqrt(norm);
      if (eigenvalue <= 0.0) break;
      for (std::size_t f = 0; f < width; ++f) axis[f] = next[f] / eigenvalue;
    }
    std::vector<float> along(n);
    for (std::size_t i = 0; i < n; ++i) {
      double sum = 0.0;
      for (std::size_t f = 0; f < width; ++f) sum += (static_cast<double>(features[i * width + f]) - mean[f]) * axis[f];
      along[i] = static_cast<float>(sum);
    }
    std::vector<float> sorted = along;
    std::sort(sorted.begin(), sorted.end());
    const float low = sorted[n / 100], high = sorted[n - 1 - n / 100];
    for (std::size_t i = 0; i < n; ++i)
      colors[i][c] = high > low ? std::clamp((along[i] - low) / (high - low), 0.0f, 1.0f) : 0.5f;
    for (std::size_t a = 0; a < width; ++a) {
      for (std::size_t b = 0; b < width; ++b) covariance[a * width + b] -= eigenvalue * axis[a] * axis[b];
    }
  }
  return colors;
}

class ViewIntegrator : public Integrator {
 public:
  ViewIntegrator(const IntegratorInput& input, FieldView view)
      : context_(input.scene.context()),
        field_(*input.field),
        view_(view),
        level_(input.choice.level),
        width_(level_width(field_)),
        rays_(view_rays(input.config, view)) {
    options_.max_chain = input.config.train_max_chain;
  }

  void begin(const View& view) override {
    if (view_ == FieldView::features) picture_ = FeaturePicture(view, width_);
  }

  SampleCounts sample(std::span<CameraSample> samples, std::span<PixelSample> out) override {
    SampleCounts counts;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      RayEnd end;
      FirstHit first;
      const FirstHitQuery query = trace_first_hit(context_, options_, samples[i], end, first);
      counts.rays += end.rays;
      out[i] = pixel_sample(Vec3f(0.0f), first);
      if (query.next != FirstHitQuery::Next::query) continue;
      const SurfacePoint point = field_query_point(context_, end.point, rays_, samples[i].rng);
      counts.rays += rays_.count(point.alpha);
      ++counts.queries;
      if (view_ == FieldView::traced) {
        out[i].radiance = Vec3f(point.disparity);
      } else if (view_ == FieldView::disparity) {
        float disparity = 0.0f;
        field_.inspect(std::span(&point, 1), {}, std::span(&disparity, 1));
        out[i].radiance = Vec3f(disparity);
      } else if (view_ == FieldView::occupancy) {
        out[i].radiance = cell_color(field_.normalized(point.x), level_);
      } else if (float* pixel =
                     picture_.pixel(static_cast<int>(samples[i].position.x), static_cast<int>(samples[i].position.y))) {
        std::vector<float> all(static_cast<std::size_t>(field_.feature_count()));
        field_.inspect(std::span(&point, 1), all, {});
        std::copy_n(all.begin() + static_cast<std::ptrdiff_t>(static_cast<std::size_t>(level_ - 1) * width_), width_,
                    pixel);
      }
    }
    return counts;
  }

  void finish(Image& image) const override {
    if (view_ == FieldView::features) picture_.paint(image);
  }

 private:
  const TransportContext context_;
  const RadianceField& field_;
  const FieldView view_;
  const int level_;
  const std::size_t width_;  // features of a level
  QueryRays rays_;
  FirstHitOptions options_;
  FeaturePicture picture_;
};

}  // namespace

Vec3f cell_color(Vec3f normalised, int level) {
  const float resolution = std::ldexp(1.0f, level + 1);
  const auto part = [&](float v) {
    return static_cast<unsigned long long>(static_cast<long long>(std::floor(v * resolution)));
  };
  const unsigned long long h = mix64(part(normalised.x) + 1 + (part(normalised.y) << 20) + (part(normalised.z) << 40));
  return {static_cast<float>(h & 255) / 255.0f, static_cast<float>((h >> 8) & 255) / 255.0f,
          static_cast<float>((h >> 16) & 255) / 255.0f};
}

void FeaturePicture::paint(Image& image) const {
  std::vector<float> hit;
  for (std::size_t p = 0; p < seen_.size(); ++p) {
    if (seen_[p])
      hit.insert(hit.end(), values_.begin() + static_cast<std::ptrdiff_t>(p * features_),
                 values_.begin() + static_cast<std::ptrdiff_t>((p + 1) * features_));
  }
  if (hit.empty()) return;
  const std::vector<Vec3f> colors = principal_components(hit, hit.size() / features_, features_);
  const auto width = static_cast<std::size_t>(rect_.width());
  std::size_t next = 0;
  for (std::size_t p = 0; p < seen_.size(); ++p) {
    if (seen_[p]) image.set_rgb(static_cast<int>(p % width), static_cast<int>(p / width), colors[next++]);
  }
}

QueryRays view_rays(const Config& config, FieldView view) {
  QueryRays rays;
  rays.offset = query_rays(config).offset;
  if (view == FieldView::traced) {
    rays.offset = {true, lookup_rule(config)};
    rays.offset.rule.rough_offset = true;
  }
  return rays;
}

std::unique_ptr<Integrator> make_view_integrator(const IntegratorInput& input, FieldView view) {
  return std::make_unique<ViewIntegrator>(input, view);
}

}  // namespace octrad
