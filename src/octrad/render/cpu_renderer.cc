#include "octrad/render/cpu_renderer.h"

#include <algorithm>
#include <atomic>
#include <limits>
#include <mutex>
#include <vector>

#include "octrad/base/stopwatch.h"
#include "octrad/base/threads.h"
#include "octrad/image/tonemap.h"

namespace octrad {
namespace {

constexpr int kTile = 16;  // pixels a side; at least twice the reach of a filter
// Camera samples of a pass: few enough to stop in time, enough to keep all threads busy.
constexpr long long kPassSamples = 1 << 17;
constexpr double kUnknown = std::numeric_limits<double>::infinity();

// Tiles lie on a grid fixed to the picture. With filters that reach over a tile's rim they are added to the film in
// four rounds, in each of which no two touch the same pixel: every pixel is summed in the same order whatever the
// threads do.
class CpuRenderer : public Renderer {
 public:
  CpuRenderer(const PreparedScene& scene, const IntegratorChoice& choice, const RenderSettings& settings,
              RadianceField* field, const Config& config, std::unique_ptr<Integrator> integrator)
      : Renderer(scene, choice, settings, field, config),
        filter_(settings.film),
        integrator_(std::move(integrator)) {
    if (!integrator_) integrator_ = choice.info->make(input());
  }

  // It depends on the picture alone.
  int largest_pass() const override {
    const long long pixels = static_cast<long long>(view_.width) * view_.height;
    return static_cast<int>(std::clamp<long long>(kPassSamples / pixels, 1, kLargestPass));
  }

  std::vector<double> sums() override { return film_.sums(); }

  SampleCounts take_counts() override {
    SampleCounts sum;
    for (SampleCounts& c : counts_) sum += std::exchange(c, {});
    if (field_ != nullptr) sum.empty_lookups += field_->take_empty_lookups();
    return sum;
  }

  FrameTimes time_frames(int count, int spp) override {
    std::vector<double> whole, sampling, mapping;
    for (int f = -1; f < count; ++f) {  // the first warms up
      clear();
      const Stopwatch watch;
      for (int s = 0; s < spp; s += kLargestPass) add_samples(std::min(spp - s, kLargestPass));
      const double sampled = watch.seconds();
      tonemap(film_.image(), {});
      if (f < 0) continue;
      whole.push_back(1e3 * watch.seconds());
      sampling.push_back(1e3 * sampled);
      mapping.push_back(whole.back() - sampling.back());
    }
    clear();
    take_counts();
    return {percentile(whole, 0.5),
            percentile(whole, 0.95),
            {{"samples", percentile(sampling, 0.5)}, {"tone mapping", percentile(mapping, 0.5)}}};
  }

 private:
  Image film_image(const ChannelRange& channels) override {
    Image image = film_.image(channels);
    if (channels.contains(channels_of(""))) integrator_->finish(image);
    return image;
  }

  void view_changed() override {
    const PixelRect &crop = window_.crop, &window = window_.sampled;
    seconds_per_sample_ = kUnknown;
    before_ = {};
    film_ = FilmBuffer(crop.x0, crop.y0, crop.width(), crop.height());
    tiles_.clear();
    rounds_.assign(filter_.reach() > 0 ? 4 : 1, {});
    for (int ty = window.y0 / kTile; ty * kTile < window.y1; ++ty) {
      for (int tx = window.x0 / kTile; tx * kTile < window.x1; ++tx) {
        const PixelRect tile = {std::max(window.x0, tx * kTile), std::max(window.y0, ty * kTile),
                                std::min(window.x1, (tx + 1) * kTile), std::min(window.y1, (ty + 1) * kTile)};
        if (needed_pixels(tile) == 0) continue;
        const auto round = filter_.reach() > 0 ? static_cast<std::size_t>((ty % 2) * 2 + tx % 2) : 0;
        rounds_[round].push_back(tiles_.size());
        tiles_.push_back(tile);
      }
    }
    counts_.assign(tiles_.size(), {});
  }

  void model_changed(bool) override { integrator_ = choice_.info->make(input()); }
  void seed_changed() override {
    if (choice_.info->make != nullptr) integrator_ = choice_.info->make(input());
  }
  void set_sums(std::span<const double> sums) override { film_.sums().assign(sums.begin(), sums.end()); }

  void clear_film() override {
    film_.clear();
    integrator_->begin(view_);
  }

  bool sample(int first, int count, const std::function<bool()>& stop) override {
    const int reach = filter_.reach();
    const bool long_pass = first == 0 || seconds_per_sample_ * count > settings_.long_pass;
    if (stop && long_pass && first > 0) remember();
    const std::vector<SampleCounts> counts_before = counts_;
    std::atomic<bool> stopped = false;
    std::mutex asking;
    const auto must_stop = [&] {
      if (stop && long_pass && !stopped) {
        const std::unique_lock one(asking, std::try_to_lock);
        if (one && stop()) stopped = true;
      }
      return stopped.load();
    };
    const Stopwatch watch;
    for (const std::vector<std::size_t>& round : rounds_) {
      parallel_for(round.size(), [&](std::size_t i) {
        if (must_stop()) return;
        const PixelRect& tile = tiles_[round[i]];
        SampleCounts& counts = counts_[round[i]];
        if (reach == 0) {
          counts += sample_tile(tile, first, count,
                                [&](int x, int y, Vec2f, const PixelSample& s) { film_.add_to_pixel(x, y, s); });
        } else {
          FilmBuffer local(tile.x0 - reach, tile.y0 - reach, tile.width() + 2 * reach, tile.height() + 2 * reach);
          counts += sample_tile(tile, first, count,
                                [&](int, int, Vec2f p, const PixelSample& s) { local.add(filter_, p, s); });
          film_.add(local);
        }
      });
    }
    if (stopped) {
      counts_ = counts_before;
      if (first > 0) film_.sums().swap(before_);
      else film_.clear();
      return false;
    }
    seconds_per_sample_ = watch.seconds() / count;
    return true;
  }

  void remember() {
    const std::vector<double>& sums = film_.sums();
    before_.resize(sums.size());
    parallel_blocks(sums.size(), 1 << 18, [&](std::size_t begin, std::size_t end) {
      std::copy(sums.data() + begin, sums.data() + end, before_.data() + begin);
    });
  }

  std::size_t needed_pixels(const PixelRect& tile) const {
    if (window_.needed.empty()) return static_cast<std::size_t>(tile.width()) * static_cast<std::size_t>(tile.height());
    std::size_t n = 0;
    for (int y = tile.y0; y < tile.y1; ++y) {
      for (int x = tile.x0; x < tile.x1; ++x) n += window_.needs(x, y) ? 1 : 0;
    }
    return n;
  }

  // Samples [first, first + count) of every pixel of a tile that needs them; put(x, y, position, sample) gets them
  // pixel by pixel.
  template <typename Put>
  SampleCounts sample_tile(const PixelRect& tile, int first, int count, const Put& put) {
    // Not thread_local: an integrator that runs in parallel inside may start other tiles in between.
    std::vector<CameraSample> samples;
    samples.reserve(needed_pixels(tile) * static_cast<std::size_t>(count));
    const CameraView view = view_.camera.view(view_.width, view_.height);
    for (int y = tile.y0; y < tile.y1; ++y) {
      for (int x = tile.x0; x < tile.x1; ++x) {
        if (!window_.needs(x, y)) continue;
        for (int i = first; i < first + count; ++i) samples.push_back(camera_sample(view, settings_.seed, x, y, i));
      }
    }
    std::vector<PixelSample> found(samples.size());
    SampleCounts counts = integrator_->sample(samples, found);
    std::size_t n = 0;
    for (int y = tile.y0; y < tile.y1; ++y) {
      for (int x = tile.x0; x < tile.x1; ++x) {
        if (!window_.needs(x, y)) continue;
        for (int i = 0; i < count; ++i, ++n) {
          if (!is_finite(found[n].radiance)) {
            found[n].radiance = Vec3f(0.0f);
            ++counts.non_finite;
          }
          put(x, y, samples[n].position, found[n]);
        }
      }
    }
    return counts;
  }

  const ReconstructionFilter filter_;
  std::unique_ptr<Integrator> integrator_;
  FilmBuffer film_;
  std::vector<PixelRect> tiles_;
  std::vector<std::vector<std::size_t>> rounds_;
  std::vector<SampleCounts> counts_;      // of each tile
  double seconds_per_sample_ = kUnknown;  // a pixel, in the last pass
  std::vector<double> before_;            // the film's sums before a long pass
};

}  // namespace

std::unique_ptr<Renderer> make_cpu_renderer(const PreparedScene& scene, const IntegratorChoice& choice,
                                            const RenderSettings& settings, RadianceField* field,
                                            const Config& config) {
  return std::make_unique<CpuRenderer>(scene, choice, settings, field, config, nullptr);
}

std::unique_ptr<Renderer> make_renderer(const PreparedScene& scene, std::unique_ptr<Integrator> integrator,
                                        const RenderSettings& settings) {
  static constexpr IntegratorInfo kCustom{"custom", "not in the list", 4};
  return std::make_unique<CpuRenderer>(scene, IntegratorChoice{&kCustom, 0}, settings, nullptr, Config{},
                                       std::move(integrator));
}

}  // namespace octrad
