// Views of what a field holds (method section 8).
#include <algorithm>
#include <cmath>

#include "octrad/base/error.h"
#include "octrad/render/cache_integrators.h"
#include "octrad/render/view_parts.h"
#include "octrad/transport/rhs_estimator.h"

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

}  // namespace

ViewKind parse_view(const RadianceField& field, const std::string& view) {
  if (view == "disparity") return {ViewKind::disparity};
  if (view == "traced") return {ViewKind::traced};
  for (int l = 1; l <= field.levels(); ++l) {
    if (view == "features" + std::to_string(l)) return {ViewKind::features, l};
    if (view == "occupancy" + std::to_string(l)) return {ViewKind::occupancy, l};
  }
  std::string known;
  for (const std::string& name : view_names(field)) known += (known.empty() ? "" : ", ") + name;
  throw UsageError("unknown view \"" + view + "\"" + did_you_mean(view, view_names(field)) + "; this model has " +
                   known);
}

Vec3f cell_color(Vec3f normalised, int level) {
  const float resolution = std::ldexp(1.0f, level + 1);
  const auto part = [&](float v) {
    return static_cast<unsigned long long>(static_cast<long long>(std::floor(v * resolution)));
  };
  const unsigned long long h = mix64(part(normalised.x) + 1 + (part(normalised.y) << 20) + (part(normalised.z) << 40));
  return {static_cast<float>(h & 255) / 255.0f, static_cast<float>((h >> 8) & 255) / 255.0f,
          static_cast<float>((h >> 16) & 255) / 255.0f};
}

void FeaturePicture::paint(const Crop& crop, Image& image) const {
  std::vector<float> hit;
  for (std::size_t p = 0; p < seen_.size(); ++p) {
    if (seen_[p])
      hit.insert(hit.end(), values_.begin() + static_cast<std::ptrdiff_t>(p * features_),
                 values_.begin() + static_cast<std::ptrdiff_t>((p + 1) * features_));
  }
  if (hit.empty()) return;
  const std::vector<Vec3f> colors = principal_components(hit, hit.size() / features_, features_);
  std::size_t next = 0;
  for (std::size_t p = 0; p < seen_.size(); ++p) {
    if (!seen_[p]) continue;
    const int x = static_cast<int>(p % static_cast<std::size_t>(width_)) - crop.x;
    const int y = static_cast<int>(p / static_cast<std::size_t>(width_)) - crop.y;
    const Vec3f color = colors[next++];
    // A wide reconstruction filter draws samples around the crop too.
    if (x >= 0 && y >= 0 && x < image.width && y < image.height) image.set_rgb(x, y, color);
  }
}

std::vector<std::string> view_names(const RadianceField& field) {
  std::vector<std::string> names = {"disparity", "traced"};
  for (int l = 1; l <= field.levels(); ++l) {
    names.push_back("features" + std::to_string(l));
    names.push_back("occupancy" + std::to_string(l));
  }
  return names;
}

RenderResult render_view(const RenderOptions& options, const TransportContext& context, const RadianceField& field,
                         const Config& config, const std::string& view) {
  const ViewKind kind = parse_view(field, view);
  const auto count = static_cast<std::size_t>(field.feature_count());
  const std::size_t width = count / static_cast<std::size_t>(field.levels());

  FeaturePicture picture;
  const auto inspect = [&](std::span<CameraSample> samples, std::span<PixelSample> out) {
    SampleCounts counts;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const RayEnd end = follow_ray(context, samples[i].ray.origin, nullptr, samples[i].ray.direction, samples[i].rng,
                                    false, config.train_max_chain, samples[i].ray.t_max);
      counts.rays += end.rays;
      if (!end.surface) continue;
      SurfacePoint point = surface_point(end.point);
      out[i].albedo = point.albedo;
      out[i].normal = point.n;
      out[i].depth = length(point.x - samples[i].ray.origin);
      out[i].roughness = point.alpha;
      if (kind.kind == ViewKind::traced || config.lookup_offset == LookupOffset::traced) {
        point.disparity = traced_disparity(context, point, end.point.surface.geometric_normal);
      }
      if (kind.kind == ViewKind::traced) {
        out[i].radiance = Vec3f(point.disparity);
      } else if (kind.kind == ViewKind::disparity) {
        float disparity = 0.0f;
        field.inspect(std::span(&point, 1), {}, std::span(&disparity, 1));
        out[i].radiance = Vec3f(disparity);
      } else if (kind.kind == ViewKind::occupancy) {
        out[i].radiance = cell_color(field.normalized(point.x), kind.level);
      } else {
        std::vector<float> all(count);
        field.inspect(std::span(&point, 1), all, {});
        std::copy_n(all.begin() + static_cast<std::ptrdiff_t>(static_cast<std::size_t>(kind.level - 1) * width), width,
                    picture.pixel(static_cast<int>(samples[i].position.x), static_cast<int>(samples[i].position.y)));
      }
      ++counts.queries;
    }
    return counts;
  };
  RenderOptions once = options;
  if (kind.kind == ViewKind::features) {
    once.spp = 1;
    once.seconds = 0.0;
    picture = FeaturePicture(options.width, options.height, width);
  }
  RenderResult result = render(once, inspect);
  if (kind.kind == ViewKind::features) picture.paint(options.crop, result.image);
  return result;
}

}  // namespace octrad
