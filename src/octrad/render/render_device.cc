#include <algorithm>

#include "octrad/base/bytes.h"
#include "octrad/base/error.h"
#include "octrad/device/array.h"
#include "octrad/device/launch.h"
#include "octrad/image/tonemap_math.h"
#include "octrad/model/device_field.h"
#include "octrad/render/device_integrator.h"
#include "octrad/render/device_render.h"
#include "octrad/render/film_device.h"
#include "octrad/transport/gbuffer_device.h"
#include "octrad/transport/path_device.h"
#include "octrad/transport/rhs_device.h"

namespace octrad {
namespace {

constexpr std::size_t kMostSamples = std::size_t{1} << 21;  // of a job: enough to fill any device
constexpr int kWarmFrames = 10;

class PathIntegrator : public DeviceIntegrator {
 public:
  PathIntegrator(Stream& stream, const DeviceWorld& world, const PathLimits& limits, std::size_t capacity)
      : tracer_(stream, world, capacity),
        limits_(limits) {}
  void set(const CameraJob& job) override { tracer_.set(job); }
  void run(std::size_t samples, const StageMark& mark) override {
    tracer_.run(limits_, samples);
    mark("paths");
  }
  const CameraJob* job() const override { return tracer_.job(); }
  SamplePlanes samples() const override { return tracer_.samples(); }
  SampleCounts take_counts() override {
    SampleCounts counts;
    counts.rays = static_cast<long long>(tracer_.take_rays());
    return counts;
  }

 private:
  DevicePathTracer tracer_;
  PathLimits limits_;
};

class CacheIntegrator : public DeviceIntegrator {
 public:
  CacheIntegrator(Stream& stream, const DeviceWorld& world, DeviceField& field, const Config& config,
                  FirstHitOptions::Bounce bounce, unsigned long long seed, std::size_t capacity)
      : field_(field),
        gbuffer_(stream, world, capacity, bounce != FirstHitOptions::Bounce::none,
                 config.lookup_offset == LookupOffset::traced),
        answers_(stream, capacity, "answers of the cache") {
    options_.follow_delta = config.render_delta == DeltaSurfaces::trace;
    options_.max_chain = config.train_max_chain;
    options_.emission_inside = config.target_emission == TargetEmission::inside;
    options_.bounce = bounce;
    options_.rough_threshold = static_cast<float>(config.lookup_rough_threshold);
    if (bounce == FirstHitOptions::Bounce::none) return;
    rhs_options_.directions = 1;
    rhs_options_.max_chain = config.train_max_chain;
    rhs_options_.emission_inside = options_.emission_inside;
    rhs_options_.seed = seed;
    rhs_ = std::make_unique<DeviceRhs>(stream, world, capacity, config.lookup_offset == LookupOffset::traced);
    rhs_answers_ = DeviceArray<Vec3f>(stream, capacity, "answers of the cache");
    targets_ = DeviceArray<Vec3f>(stream, capacity, "right-hand sides");
  }

  void set(const CameraJob& job) override { gbuffer_.set(job); }
  void run(std::size_t samples, const StageMark& mark) override {
    gbuffer_.run(options_, samples);
    mark("first hits");
    field_.radiance(gbuffer_.queries(), gbuffer_.query_count(), samples, answers_.data());
    mark("field");
    if (rhs_) {
      const DeviceRhsPoints points{gbuffer_.bounce_points(), gbuffer_.bounce_count(), samples, nullptr,
                                   gbuffer_.bounce_keys()};
      rhs_->trace(points, rhs_options_);
      mark("bounces");
      field_.radiance(rhs_->queries(), rhs_->query_count(), samples, rhs_answers_.data());
      rhs_->reduce(points, rhs_options_, rhs_answers_.data(), targets_.data());
      mark("field at bounces");
    }
    gbuffer_.add(answers_.data(), rhs_ ? targets_.data() : nullptr, samples);
  }
  const CameraJob* job() const override { return gbuffer_.job(); }
  SamplePlanes samples() const override { return gbuffer_.samples(); }
  SampleCounts take_counts() override {
    TraceCounts sum = gbuffer_.take_counts();
    if (rhs_) {
      const TraceCounts more = rhs_->take_counts();
      sum.rays += more.rays;
      sum.queries += more.queries;
      sum.non_finite += more.non_finite;
    }
    return {static_cast<long long>(sum.rays), static_cast<long long>(sum.queries),
            static_cast<long long>(sum.non_finite)};
  }

 private:
  DeviceField& field_;
  DeviceGBuffer gbuffer_;
  FirstHitOptions options_;
  DeviceArray<Vec3f> answers_, rhs_answers_, targets_;
  std::unique_ptr<DeviceRhs> rhs_;
  DeviceRhsOptions rhs_options_;
};

// Film to what a screen shows, as octrad tonemap without options.
struct ToneMap : Kernel {
  const double* sums;  // planes of DeviceFilm
  std::size_t pixels;
  ToneMapping mapping;
  unsigned char* out;  // [pixels][4]
  OCTRAD_HD void operator()(std::uint32_t i) const {
    const double weight = sums[kPictureChannelCount * pixels + i];
    for (std::size_t c = 0; c < 3; ++c) {
      const float value = weight > 0.0 ? static_cast<float>(sums[c * pixels + i] / weight) : 0.0f;
      out[4 * static_cast<std::size_t>(i) + c] = to_byte(tonemap(value, mapping));
    }
    out[4 * static_cast<std::size_t>(i) + 3] = 255;
  }
};

RenderOptions one_sample(RenderOptions options) {
  options.spp = 1;
  options.seconds = 0.0;
  return options;
}

}  // namespace

struct DeviceRenderer::Impl {
  Stream& stream;
  RenderOptions options;
  PassPlan plan;
  std::size_t capacity = 0;
  std::unique_ptr<DeviceField> field;
  std::unique_ptr<DeviceIntegrator> integrator;
  std::unique_ptr<DeviceFilm> film;

  Impl(Stream& s, const RenderOptions& o) : stream(s), options(o), plan(plan_passes(options)) {}

  std::size_t columns() const { return static_cast<std::size_t>(plan.window.width()); }
  std::size_t pixels() const { return columns() * static_cast<std::size_t>(plan.window.height()); }

  CameraJob job(int y, int rows, int first, int count) const {
    CameraJob job;
    job.view = options.camera.view(options.width, options.height);
    job.seed = options.seed;
    job.x0 = plan.window.x0;
    job.y0 = y;
    job.width = plan.window.width();
    job.height = std::min(rows, plan.window.y1 - y);
    job.first = first;
    job.count = count;
    return job;
  }
};

DeviceRenderer::DeviceRenderer(Stream& stream, const PreparedScene& scene, const RenderOptions& options,
                               RadianceField* field, const Config& config, const std::string& integrator,
                               std::uint64_t max_memory)
    : impl_(std::make_unique<Impl>(stream, integrator.rfind("features", 0) == 0 ? one_sample(options) : options)) {
  Impl& r = *impl_;
  const bool path = integrator == "path", bounces = integrator == "rhs" || integrator == "deferred",
             traced = config.lookup_offset == LookupOffset::traced;
  const bool view = !path && !bounces && integrator != "lhs";
  const PictureWindow& crop = r.plan.crop;
  const auto memory = [&](std::size_t capacity) {
    std::vector<MemoryPart> parts;
    if (!path) parts = estimate_device_memory(config, field->cells_per_level(), {capacity});
    parts.push_back({"scene", scene.bytes_to_upload(stream)});
    parts.push_back({"film", DeviceFilm::bytes(crop.width(), crop.height())});
    parts.push_back({"samples in flight",
                     path   ? DevicePathTracer::bytes(capacity)
                     : view ? view_integrator_bytes(*field, config, integrator, capacity)
                            : DeviceGBuffer::bytes(capacity, bounces, traced) + capacity * sizeof(Vec3f) +
                                  (bounces ? DeviceRhs::bytes(capacity, traced) + 2 * capacity * sizeof(Vec3f) : 0)});
    return parts;
  };
  const auto total = [&](std::size_t capacity) {
    std::uint64_t sum = 0;
    for (const MemoryPart& part : memory(capacity)) sum += part.bytes;
    return sum;
  };
  r.capacity = std::clamp(r.pixels() * static_cast<std::size_t>(std::max(1, r.options.spp)), r.columns(),
                          std::max(kMostSamples, r.columns()));
  while (max_memory > 0 && total(r.capacity) > max_memory && r.capacity > r.columns())
    r.capacity = std::max(r.columns(), r.capacity / 2);
  require_memory(max_memory, "the picture", memory(r.capacity), "  --width, --height and --crop make it smaller");

  const DeviceWorld& world = scene.world(stream);
  if (path) {
    r.integrator =
        std::make_unique<PathIntegrator>(stream, world, PathLimits{options.max_depth, options.rr_depth}, r.capacity);
  } else {
    r.field = make_device_field(stream, *field, config, {r.capacity});
    if (view)
      r.integrator = make_view_integrator(stream, world, *r.field, *field, config, integrator, r.options, r.capacity);
    using Bounce = FirstHitOptions::Bounce;
    const Bounce bounce = integrator == "rhs" ? Bounce::all : integrator == "deferred" ? Bounce::glossy : Bounce::none;
    if (!view)
      r.integrator =
          std::make_unique<CacheIntegrator>(stream, world, *r.field, config, bounce, options.seed, r.capacity);
  }
  r.film = std::make_unique<DeviceFilm>(stream, crop.x0, crop.y0, crop.width(), crop.height(), options.film);
}

DeviceRenderer::~DeviceRenderer() = default;

RenderResult DeviceRenderer::render() {
  Impl& r = *impl_;
  r.film->clear();
  r.integrator->take_counts();
  const auto largest = static_cast<int>(std::clamp<std::size_t>(r.capacity / r.pixels(), 1, 64));
  RenderResult result = run_passes(r.options, r.plan, largest, [&](int first, int count) {
    const auto rows = static_cast<int>(r.capacity / (r.columns() * static_cast<std::size_t>(count)));
    for (int y = r.plan.window.y0; y < r.plan.window.y1; y += rows) {
      const CameraJob job = r.job(y, rows, first, count);
      r.integrator->set(job);
      r.integrator->run(job.size(), no_mark);
      r.film->add(r.integrator->job(), r.integrator->samples());
    }
    r.stream.synchronize();  // time limits and interrupts count what is done
  });
  result.counts = r.integrator->take_counts();
  result.counts.non_finite += static_cast<long long>(r.film->take_non_finite());
  result.image = r.film->image();
  r.integrator->finish(result);
  result.width = result.image.width;
  result.height = result.image.height;
  return result;
}

FrameTimes DeviceRenderer::time_frames(int count) {
  Impl& r = *impl_;
  const int spp = std::max(1, r.options.spp);
  if (!r.integrator->can_be_recorded()) throw UsageError("frames are timed of path, lhs, rhs and deferred only");
  if (r.pixels() * static_cast<std::size_t>(spp) > r.capacity) {
    throw MemoryError(
        "a frame of " + std::to_string(spp) +
        " samples a pixel does not fit into device memory at once; use fewer samples or a smaller picture");
  }
  const CameraJob job = r.job(r.plan.window.y0, r.plan.window.height(), 0, spp);
  DeviceArray<unsigned char> screen(r.stream, 4 * r.film->pixels(), "the screen");
  const auto frame = [&](const StageMark& mark) {
    r.film->clear();
    r.integrator->run(job.size(), mark);
    r.film->add(r.integrator->job(), r.integrator->samples());
    mark("film");
    launch(r.stream, r.film->pixels(), ToneMap{{}, r.film->sums(), r.film->pixels(), {}, screen.data()});
    mark("tone mapping");
  };
  r.integrator->set(job);
  frame(no_mark);  // what is set up once must not be recorded
  const std::unique_ptr<LaunchGraph> graph = r.stream.capture([&] { frame(no_mark); });

  FrameTimes times;
  std::vector<double> whole;
  for (int f = 0; f < kWarmFrames + count; ++f) {
    const auto start = r.stream.record();
    r.stream.replay(*graph);
    const auto end = r.stream.record();
    const double ms = r.stream.milliseconds(*start, *end);
    if (f >= kWarmFrames) whole.push_back(ms);
  }
  times.median = percentile(whole, 0.5);
  times.p95 = percentile(whole, 0.95);

  StageTimes stages(r.stream);
  for (int f = 0; f < kWarmFrames + count; ++f) {
    stages.begin();
    frame([&](const char* name) { stages.mark(name); });
    if (f < kWarmFrames) stages.forget();
    else stages.settle();
  }
  times.stages = stages.medians();
  r.integrator->take_counts();
  return times;
}

}  // namespace octrad
