#include "octrad/render/renderer_device.h"

#include <algorithm>

#include "octrad/base/bytes.h"
#include "octrad/base/error.h"
#include "octrad/device/array.h"
#include "octrad/model/device_field.h"
#include "octrad/render/film_device.h"

namespace octrad {
namespace {

constexpr int kWarmFrames = 10;
constexpr std::size_t kLargestPassOfFew = 4096;  // samples a pixel, which the film sums one after the other

class StreamRenderer : public Renderer {
 public:
  StreamRenderer(Stream& stream, const PreparedScene& scene, const IntegratorChoice& choice,
                 const RenderSettings& settings, RadianceField* field, const Config& config)
      : Renderer(scene, choice, settings, field, config),
        stream_(stream),
        scene_bytes_(scene.bytes_to_upload(stream)) {}

  // The few pixels of a mask get as many samples at once as a job has room for.
  int largest_pass() const override {
    if (passes_matter()) return static_cast<int>(std::clamp<std::size_t>(job_samples_ / pixels(), 1, kLargestPass));
    return static_cast<int>(std::clamp<std::size_t>(job_samples_ / listed_numbers_.size(), 1, kLargestPassOfFew));
  }
  bool passes_matter() const override { return listed_numbers_.empty() || film_->reach() > 0; }

  std::vector<double> sums() override { return film_->download(); }

  SampleCounts take_counts() override {
    SampleCounts counts = integrator_->take_counts();
    counts.non_finite += static_cast<long long>(film_->take_non_finite());
    if (device_field_) counts.empty_lookups += device_field_->take_empty_lookups();
    return counts;
  }

  FrameTimes time_frames(int count, int spp) override {
    if (!choice_.info->recordable)
      throw UsageError(std::string("frames of the view ") + choice_.info->name + " cannot be timed on a GPU");
    if (pixels() * static_cast<std::size_t>(spp) > capacity_) {
      throw MemoryError(
          "a frame of " + std::to_string(spp) +
          " samples a pixel does not fit into device memory at once; use fewer samples or a smaller picture");
    }
    const CameraJob job = job_of(window_.sampled.y0, window_.sampled.height(), 0, spp);
    DeviceArray<unsigned char> screen(stream_, 4 * film_->pixels(), "the screen");
    const bool single = stream_.tuning.direct_film && spp == 1 && film_->reach() == 0;
    const auto frame = [&] {
      if (!single) film_->clear();
      integrator_->run(job.size());
      if (single) {
        film_->show_only(integrator_->job(), integrator_->samples(), {}, screen.data());
      } else {
        film_->add(integrator_->job(), integrator_->samples());
        stream_.mark("film");
        film_->show({}, screen.data());
      }
      stream_.mark("tone mapping");
    };
    integrator_->set(job);
    frame();  // what is set up once must not be recorded
    const std::unique_ptr<LaunchGraph> graph = stream_.capture(frame);

    FrameTimes times;
    std::vector<double> whole;
    for (int f = 0; f < kWarmFrames + count; ++f) {
      const auto start = stream_.record();
      stream_.replay(*graph);
      const auto end = stream_.record();
      const double ms = stream_.milliseconds(*start, *end);
      if (f >= kWarmFrames) whole.push_back(ms);
    }
    times.median = percentile(whole, 0.5);
    times.p95 = percentile(whole, 0.95);

    StageTimes stages(stream_);
    for (int f = 0; f < kWarmFrames + count; ++f) {
      stages.begin();
      frame();
      stages.end();
      if (f < kWarmFrames) stages.forget();
      else stages.settle();
    }
    times.stages = stages.medians();
    clear();
    take_counts();
    return times;
  }

 private:
  Image film_image(const ChannelRange& channels) override {
    Image image = film_->image(channels);
    if (channels.contains(channels_of(""))) integrator_->finish(image);
    return image;
  }

  std::size_t columns() const { return static_cast<std::size_t>(window_.sampled.width()); }
  std::size_t pixels() const { return columns() * static_cast<std::size_t>(window_.sampled.height()); }

  CameraJob job_of(int y, int rows, int first, int count) const {
    CameraJob job;
    job.view = view_.camera.view(view_.width, view_.height);
    job.seed = settings_.seed;
    job.x0 = window_.sampled.x0;
    job.y0 = y;
    job.width = window_.sampled.width();
    job.height = std::min(rows, window_.sampled.y1 - y);
    job.first = first;
    job.count = count;
    job.tiles = stream_.tuning.pixel_tiles;
    return job;
  }

  DeviceFieldOptions field_options(std::size_t capacity) const {
    DeviceFieldOptions options;
    options.max_points = capacity;
    options.tuning = stream_.tuning;
    return options;
  }

  // What a view allocates, with jobs of `capacity` samples.
  std::vector<MemoryPart> memory(std::size_t capacity) const {
    std::vector<MemoryPart> parts;
    if (field_) parts = estimate_device_memory(config_, field_->cells_per_level(), field_options(capacity));
    parts.push_back({"scene", scene_bytes_});
    parts.push_back({"film", DeviceFilm::bytes(window_.crop.width(), window_.crop.height())});
    parts.push_back({"samples in flight", choice_.info->device_bytes(input(), capacity)});
    if (!window_.needed.empty())
      parts.push_back({"mask", (window_.needed.size() + static_cast<std::size_t>(window_.sampled_pixels())) *
                                   sizeof(std::uint32_t)});
    return parts;
  }

  // Buffers are made for the largest view so far, and kept for others.
  void view_changed() override {
    if (choice_.info->one_sample) window_.needed.clear();  // features: their colours depend on all pixels
    const auto total = [&](std::size_t capacity) { return total_bytes(memory(capacity)); };
    const std::size_t spp =
        choice_.info->one_sample ? 1 : static_cast<std::size_t>(std::max(1, settings_.expected_spp));
    const auto most = static_cast<std::size_t>(stream_.tuning.frame_samples);
    job_samples_ = std::clamp(pixels() * spp, columns(), std::max(most, columns()));
    const std::uint64_t budget = settings_.max_memory;
    while (budget > 0 && total(job_samples_) > budget && job_samples_ > columns())
      job_samples_ = std::max(columns(), job_samples_ / 2);
    if (!integrator_ || job_samples_ > capacity_) {
      require_memory(budget, "the picture", memory(job_samples_), "  --width, --height and --crop make it smaller");
      integrator_.reset();
      device_field_.reset();
      capacity_ = job_samples_;
      const DeviceWorld& world = scene_.world(stream_);
      if (field_) device_field_ = make_device_field(stream_, *field_, config_, field_options(capacity_));
      integrator_ = choice_.info->make_device(input(), stream_, world, device_field_.get(), capacity_);
    }
    list_pixels();
    const PixelRect& crop = window_.crop;
    if (film_ && crop == film_window_) return;
    film_.reset();
    film_window_ = crop;
    film_ = std::make_unique<DeviceFilm>(stream_, crop.x0, crop.y0, crop.width(), crop.height(), settings_.film);
  }

  // Those that the mask needs.
  void list_pixels() {
    std::vector<std::uint32_t> numbers, places(window_.needed.size(), ListedPixels::kNone);
    for (std::size_t p = 0; p < places.size(); ++p) {
      if (window_.needed[p] == 0) continue;
      places[p] = static_cast<std::uint32_t>(numbers.size());
      numbers.push_back(static_cast<std::uint32_t>(p));
    }
    listed_numbers_ = {stream_, std::span<const std::uint32_t>(numbers), "the mask"};
    listed_places_ = {stream_, std::span<const std::uint32_t>(places), "the mask"};
  }

  void model_changed(bool same_shape) override {
    if (device_field_ && same_shape) {
      device_field_->upload_from(*field_);
      return;
    }
    integrator_.reset();  // set_view() makes it again
    device_field_.reset();
  }

  void seed_changed() override {
    if (!integrator_) return;  // set_view() makes it
    integrator_.reset();
    integrator_ = choice_.info->make_device(input(), stream_, scene_.world(stream_), device_field_.get(), capacity_);
  }

  void set_sums(std::span<const double> sums) override { film_->upload(sums); }

  void clear_film() override {
    film_->clear();
    integrator_->begin(view_);
  }

  // A pass is short there: never stopped.
  bool sample(int first, int count, const std::function<bool()>&) override {
    const auto run = [&](const CameraJob& job) {
      integrator_->set(job);
      integrator_->run(job.size());
      film_->add(integrator_->job(), integrator_->samples());
    };
    const PixelRect& window = window_.sampled;
    const std::size_t pixels = std::max<std::size_t>(1, job_samples_ / static_cast<std::size_t>(count));  // of a job
    if (const std::size_t listed = listed_numbers_.size(); listed > 0) {
      for (std::size_t place = 0; place < listed; place += pixels) {
        CameraJob job = job_of(window.y0, window.height(), first, count);
        job.listed = {listed_numbers_.data(), listed_places_.data(), static_cast<std::uint32_t>(place),
                      static_cast<std::uint32_t>(std::min(pixels, listed - place))};
        run(job);
      }
    } else {
      const auto rows = static_cast<int>(std::max<std::size_t>(1, pixels / columns()));
      for (int y = window.y0; y < window.y1; y += rows) run(job_of(y, rows, first, count));
    }
    stream_.synchronize();  // time limits and interrupts count what is done
    return true;
  }

  Stream& stream_;
  std::unique_ptr<DeviceField> device_field_;  // null without a model
  std::unique_ptr<DeviceIntegrator> integrator_;
  std::unique_ptr<DeviceFilm> film_;
  PixelRect film_window_;                                      // of film_
  DeviceArray<std::uint32_t> listed_numbers_, listed_places_;  // ListedPixels of a view with a mask, else empty
  const std::size_t scene_bytes_;  // that this renderer's use of the scene has yet to allocate
  std::size_t capacity_ = 0;       // samples that buffers are made for
  std::size_t job_samples_ = 0;    // of a job of this view; depends on the view alone, so that sums are formed alike
};

}  // namespace

std::unique_ptr<Renderer> make_stream_renderer(Stream& stream, const PreparedScene& scene,
                                               const IntegratorChoice& choice, const RenderSettings& settings,
                                               RadianceField* field, const Config& config) {
  return std::make_unique<StreamRenderer>(stream, scene, choice, settings, field, config);
}

}  // namespace octrad
