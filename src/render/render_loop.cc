#include "render/render_loop.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/error.h"
#include "base/stopwatch.h"
#include "base/threads.h"

namespace octrad {
namespace {

constexpr int kTile = 32;          // pixels a side: a thousand samples a call of the integrator
constexpr int kChannels = 11;

using Values = float[kChannels];

void pack(const PixelSample& s, float* v) {
  const float packed[kChannels] = {s.radiance.x, s.radiance.y, s.radiance.z, s.albedo.x, s.albedo.y, s.albedo.z,
                                   s.normal.x, s.normal.y, s.normal.z, s.depth, s.roughness};
  std::copy(packed, packed + kChannels, v);
}

// The film's filter as Mitsuba defines it: box of one pixel, tent and truncated Gaussian of a given radius.
class Filter {
 public:
  explicit Filter(const Film& film) : kind_(film.filter), radius_(film.filter_radius), stddev_(film.filter_stddev) {
    if (kind_ == Film::Filter::box) radius_ = 0.5f;
    if (kind_ == Film::Filter::tent && radius_ <= 0.0f) radius_ = 1.0f;
    if (kind_ == Film::Filter::gaussian && radius_ <= 0.0f) radius_ = 4.0f * stddev_;
  }
  bool box() const { return kind_ == Film::Filter::box; }
  int reach() const { return box() ? 0 : static_cast<int>(std::ceil(radius_ - 0.5f)); }  // neighbouring pixels whose samples count
  float weight(float dx, float dy) const { return along(dx) * along(dy); }

 private:
  float along(float d) const {
    d = std::abs(d);
    if (kind_ == Film::Filter::tent) return std::max(0.0f, 1.0f - d / radius_);
    const float a = -1.0f / (2.0f * stddev_ * stddev_);
    return std::max(0.0f, std::exp(a * d * d) - std::exp(a * radius_ * radius_));
  }
  Film::Filter kind_;
  float radius_, stddev_;
};

}  // namespace

RenderResult render(const RenderOptions& options, const SampleFunction& integrator) {
  if (options.width < 1 || options.height < 1) throw UsageError("a picture needs at least 1 x 1 pixels");
  if (options.spp < 1 && options.seconds <= 0.0) throw UsageError("neither a number of samples nor a time was given");
  Crop crop = options.crop;
  if (crop.width == 0) crop = {0, 0, options.width, options.height};
  if (crop.x < 0 || crop.y < 0 || crop.width < 1 || crop.height < 1 || crop.x + crop.width > options.width || crop.y + crop.height > options.height) {
    throw UsageError("the crop does not lie inside the picture of " + std::to_string(options.width) + " x " + std::to_string(options.height));
  }
  const Filter filter(options.film);
  // Samples are drawn for a border as wide as the filter reaches too, so that a crop equals that part of the whole picture.
  const int reach = filter.reach();
  const int x0 = std::max(0, crop.x - reach), y0 = std::max(0, crop.y - reach);
  const int x1 = std::min(options.width, crop.x + crop.width + reach), y1 = std::min(options.height, crop.y + crop.height + reach);
  const int w = x1 - x0, h = y1 - y0;
  const auto pixels = static_cast<std::size_t>(w) * static_cast<std::size_t>(h);

  RenderResult result;
  std::vector<double> sums(static_cast<std::size_t>(crop.width) * static_cast<std::size_t>(crop.height) * (kChannels + 1));
  std::vector<Values> pass(pixels);
  std::vector<Vec2f> positions(pixels);
  const int tiles_x = (w + kTile - 1) / kTile, tiles_y = (h + kTile - 1) / kTile;
  std::vector<SampleCounts> counts(static_cast<std::size_t>(tiles_x) * static_cast<std::size_t>(tiles_y));
  const Stopwatch watch;

  while (options.spp < 1 || result.spp < options.spp) {
    if (options.interrupted && options.interrupted()) {
      result.interrupted = true;
      break;
    }
    if (options.seconds > 0.0 && result.spp > 0 && watch.seconds() >= options.seconds) break;
    const auto sample_index = static_cast<unsigned long long>(result.spp);
    parallel_for(counts.size(), [&](std::size_t t) {
      const int tx = static_cast<int>(t) % tiles_x * kTile, ty = static_cast<int>(t) / tiles_x * kTile;
      const int tw = std::min(kTile, w - tx), th = std::min(kTile, h - ty);
      thread_local std::vector<CameraSample> samples;
      thread_local std::vector<PixelSample> found;
      samples.clear();
      for (int y = 0; y < th; ++y) {
        for (int x = 0; x < tw; ++x) {
          const int px = x0 + tx + x, py = y0 + ty + y;
          const auto pixel = static_cast<unsigned long long>(py) * static_cast<unsigned long long>(options.width) + static_cast<unsigned long long>(px);
          Rng rng(options.seed, RngPurpose::pixel, mix64(pixel + 1) ^ sample_index);
          const Vec2f u = rng.uniform2();
          const Vec2f position{static_cast<float>(px) + u.x, static_cast<float>(py) + u.y};
          samples.push_back({options.camera.generate(position, options.width, options.height), rng, position});
        }
      }
      found.assign(samples.size(), PixelSample{});
      const SampleCounts c = integrator(samples, found);
      counts[t].rays += c.rays;
      counts[t].queries += c.queries;
      counts[t].non_finite += c.non_finite;
      for (std::size_t i = 0; i < samples.size(); ++i) {
        if (!is_finite(found[i].radiance)) {
          found[i].radiance = Vec3f(0.0f);
          ++counts[t].non_finite;
        }
        const int x = tx + static_cast<int>(i) % tw, y = ty + static_cast<int>(i) / tw;
        const auto p = static_cast<std::size_t>(y) * static_cast<std::size_t>(w) + static_cast<std::size_t>(x);
        pack(found[i], pass[p]);
        positions[p] = samples[i].position;
      }
    });
    parallel_for(static_cast<std::size_t>(crop.height), [&](std::size_t row) {
      for (int x = 0; x < crop.width; ++x) {
        double* sum = &sums[(row * static_cast<std::size_t>(crop.width) + static_cast<std::size_t>(x)) * (kChannels + 1)];
        const int px = crop.x + x - x0, py = crop.y + static_cast<int>(row) - y0;  // in the pass buffer
        for (int ny = std::max(0, py - reach); ny <= std::min(h - 1, py + reach); ++ny) {
          for (int nx = std::max(0, px - reach); nx <= std::min(w - 1, px + reach); ++nx) {
            const auto p = static_cast<std::size_t>(ny) * static_cast<std::size_t>(w) + static_cast<std::size_t>(nx);
            float weight = 1.0f;
            if (!filter.box()) {
              weight = filter.weight(positions[p].x - (static_cast<float>(px + x0) + 0.5f), positions[p].y - (static_cast<float>(py + y0) + 0.5f));
              if (weight <= 0.0f) continue;
            }
            for (int c = 0; c < kChannels; ++c) sum[c] += static_cast<double>(weight * pass[p][c]);
            sum[kChannels] += static_cast<double>(weight);
          }
        }
      }
    });
    ++result.spp;
    result.samples += static_cast<long long>(pixels);
    if (options.progress) options.progress(result.spp, watch.seconds());
  }
  result.seconds = watch.seconds();
  for (const SampleCounts& c : counts) {
    result.counts.rays += c.rays;
    result.counts.queries += c.queries;
    result.counts.non_finite += c.non_finite;
  }
  result.width = crop.width;
  result.height = crop.height;
  result.image = Image(crop.width, crop.height, {"R", "G", "B", "albedo.R", "albedo.G", "albedo.B", "normal.X", "normal.Y", "normal.Z", "depth.Z", "roughness.Y"});
  for (std::size_t p = 0; p < sums.size() / (kChannels + 1); ++p) {
    const double* sum = &sums[p * (kChannels + 1)];
    const double scale = sum[kChannels] > 0.0 ? 1.0 / sum[kChannels] : 0.0;
    for (int c = 0; c < kChannels; ++c) result.image.data[p * kChannels + static_cast<std::size_t>(c)] = static_cast<float>(sum[c] * scale);
  }
  return result;
}

}  // namespace octrad
