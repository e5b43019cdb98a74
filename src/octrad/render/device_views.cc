#include <algorithm>

#include "octrad/device/array.h"
#include "octrad/render/device_integrator.h"
#include "octrad/render/view_parts.h"
#include "octrad/transport/gbuffer_device.h"

namespace octrad {
namespace {

constexpr int kDisparityNumber = kSurfacePointNumbers - 1;  // of SurfacePointArray

bool traces_disparity(const Config& config, const ViewKind& kind) {
  return kind.kind == ViewKind::traced || config.lookup_offset == LookupOffset::traced;
}

class ViewIntegrator : public DeviceIntegrator {
 public:
  ViewIntegrator(Stream& stream, const DeviceWorld& world, DeviceField& device_field, const RadianceField& field,
                 const Config& config, const ViewKind& kind, const RenderOptions& options, std::size_t capacity)
      : stream_(stream),
        device_field_(device_field),
        field_(field),
        kind_(kind),
        width_(static_cast<std::size_t>(field.feature_count() / field.levels())),
        crop_(options.crop),
        gbuffer_(stream, world, capacity, false, traces_disparity(config, kind)),
        answers_(stream, capacity, "colours of a view"),
        disparity_(stream, kind.kind == ViewKind::disparity ? capacity : 0, "disparities"),
        features_(stream,
                  kind.kind == ViewKind::features ? capacity * static_cast<std::size_t>(field.feature_count()) : 0,
                  "features"),
        capacity_(capacity) {
    options_.max_chain = config.train_max_chain;
    if (kind.kind == ViewKind::features) picture_ = FeaturePicture(options.width, options.height, width_);
  }

  void set(const CameraJob& job) override {
    host_job_ = job;
    gbuffer_.set(job);
  }

  void run(std::size_t samples, const StageMark& mark) override {
    gbuffer_.run(options_, samples);
    // Emission and sky are no part of a view.
    const SamplePlanes planes = gbuffer_.samples();
    stream_.fill(planes.data, 0, 3 * planes.stride * sizeof(float));
    std::uint32_t queries = 0;
    stream_.download(&queries, gbuffer_.query_count(), sizeof(queries));
    const std::size_t n = queries;
    colors_.assign(n, Vec3f(0.0f));
    if (n > 0) look(n);
    answers_.upload(colors_);
    gbuffer_.add(answers_.data(), nullptr, samples);
    mark("view");
  }

  const CameraJob* job() const override { return gbuffer_.job(); }
  SamplePlanes samples() const override { return gbuffer_.samples(); }
  SampleCounts take_counts() override {
    const TraceCounts counts = gbuffer_.take_counts();
    return {static_cast<long long>(counts.rays), static_cast<long long>(counts.queries),
            static_cast<long long>(counts.non_finite)};
  }
  bool can_be_recorded() const override { return false; }
  void finish(RenderResult& result) override {
    if (kind_.kind == ViewKind::features) picture_.paint(crop_, result.image);
  }

 private:
  // Colours of the job's first `n` queries.
  void look(std::size_t n) {
    const SurfacePointArray queries = gbuffer_.queries();
    if (kind_.kind == ViewKind::features) {
      device_field_.inspect(queries, n, {features_.data(), capacity_}, nullptr);
      owners_.resize(n);
      stream_.download(owners_.data(), gbuffer_.query_owners(), n * sizeof(std::uint32_t));
      plane_.resize(n);
      for (std::size_t f = 0; f < width_; ++f) {
        const std::size_t row = static_cast<std::size_t>(kind_.level - 1) * width_ + f;
        stream_.download(plane_.data(), features_.data() + row * capacity_, n * sizeof(float));
        for (std::size_t q = 0; q < n; ++q) {
          const CameraJob::Place place = host_job_.place(owners_[q]);
          picture_.pixel(place.x, place.y)[f] = plane_[q];
        }
      }
      return;
    }
    if (kind_.kind == ViewKind::occupancy) {
      positions_.resize(3 * n);
      for (std::size_t a = 0; a < 3; ++a)
        stream_.download(&positions_[a * n], queries.data + a * queries.stride, n * sizeof(float));
      for (std::size_t q = 0; q < n; ++q) {
        colors_[q] =
            cell_color(field_.normalized({positions_[q], positions_[n + q], positions_[2 * n + q]}), kind_.level);
      }
      return;
    }
    plane_.resize(n);
    if (kind_.kind == ViewKind::disparity) {
      device_field_.inspect(queries, n, {}, disparity_.data());
      stream_.download(plane_.data(), disparity_.data(), n * sizeof(float));
    } else {
      stream_.download(plane_.data(), queries.data + static_cast<std::size_t>(kDisparityNumber) * queries.stride,
                       n * sizeof(float));
    }
    for (std::size_t q = 0; q < n; ++q) colors_[q] = Vec3f(plane_[q]);
  }

  Stream& stream_;
  DeviceField& device_field_;
  const RadianceField& field_;
  const ViewKind kind_;
  const std::size_t width_;  // features of a level
  const Crop crop_;
  DeviceGBuffer gbuffer_;
  DeviceArray<Vec3f> answers_;
  DeviceArray<float> disparity_, features_;
  const std::size_t capacity_;
  FirstHitOptions options_;
  CameraJob host_job_;
  FeaturePicture picture_;
  std::vector<Vec3f> colors_;
  std::vector<float> plane_, positions_;
  std::vector<std::uint32_t> owners_;
};

}  // namespace

std::unique_ptr<DeviceIntegrator> make_view_integrator(Stream& stream, const DeviceWorld& world,
                                                       DeviceField& device_field, const RadianceField& field,
                                                       const Config& config, const std::string& view,
                                                       const RenderOptions& options, std::size_t capacity) {
  return std::make_unique<ViewIntegrator>(stream, world, device_field, field, config, parse_view(field, view), options,
                                          capacity);
}

std::size_t view_integrator_bytes(const RadianceField& field, const Config& config, const std::string& view,
                                  std::size_t capacity) {
  const ViewKind kind = parse_view(field, view);
  return DeviceGBuffer::bytes(capacity, false, traces_disparity(config, kind)) +
         capacity * (sizeof(Vec3f) + sizeof(float) * (kind.kind == ViewKind::features
                                                          ? static_cast<std::size_t>(field.feature_count())
                                                      : kind.kind == ViewKind::disparity ? 1
                                                                                         : 0));
}

}  // namespace octrad
