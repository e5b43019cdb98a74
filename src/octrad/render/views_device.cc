#include "octrad/device/array.h"
#include "octrad/model/device_field.h"
#include "octrad/render/integrators.h"
#include "octrad/render/view_parts.h"
#include "octrad/shading/device_world.h"
#include "octrad/transport/gbuffer_device.h"

namespace octrad {
namespace {

class ViewIntegrator : public DeviceIntegrator {
 public:
  ViewIntegrator(const IntegratorInput& input, Stream& stream, const DeviceWorld& world, DeviceField& device_field,
                 std::size_t capacity, FieldView view)
      : stream_(stream),
        device_field_(device_field),
        field_(*input.field),
        view_(view),
        level_(input.choice.level),
        width_(level_width(field_)),
        gbuffer_(stream, world, capacity, false, view_rays(input.config, view)),
        answers_(stream, capacity, "colours of a view"),
        disparity_(stream, view == FieldView::disparity ? capacity : 0, "disparities"),
        features_(stream, view == FieldView::features ? capacity * static_cast<std::size_t>(field_.feature_count()) : 0,
                  "features"),
        capacity_(capacity) {
    options_.max_chain = input.config.train_max_chain;
  }

  void begin(const View& view) override {
    if (view_ == FieldView::features) picture_ = FeaturePicture(view, width_);
  }

  void set(const CameraJob& job) override {
    host_job_ = job;
    gbuffer_.set(job);
  }

  void run(std::size_t samples) override {
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
    stream_.mark("view");
  }

  const CameraJob* job() const override { return gbuffer_.job(); }
  SamplePlanes samples() const override { return gbuffer_.samples(); }
  SampleCounts take_counts() override { return sample_counts(gbuffer_.take_counts()); }
  void finish(Image& image) const override {
    if (view_ == FieldView::features) picture_.paint(image);
  }

 private:
  // Colours of the job's first `n` queries.
  void look(std::size_t n) {
    const SurfacePointArray queries = gbuffer_.queries();
    if (view_ == FieldView::features) {
      device_field_.inspect(queries, n, {features_.data(), capacity_}, nullptr);
      owners_.resize(n);
      stream_.download(owners_.data(), gbuffer_.query_owners(), n * sizeof(std::uint32_t));
      plane_.resize(n);
      for (std::size_t f = 0; f < width_; ++f) {
        const std::size_t row = static_cast<std::size_t>(level_ - 1) * width_ + f;
        stream_.download(plane_.data(), features_.data() + row * capacity_, n * sizeof(float));
        for (std::size_t q = 0; q < n; ++q) {
          const CameraJob::Place place = host_job_.place(owners_[q]);
          if (float* pixel = picture_.pixel(place.x, place.y)) pixel[f] = plane_[q];
        }
      }
      return;
    }
    if (view_ == FieldView::occupancy) {
      positions_.resize(3 * n);
      for (std::size_t a = 0; a < 3; ++a)
        stream_.download(&positions_[a * n], queries.data + a * queries.stride, n * sizeof(float));
      for (std::size_t q = 0; q < n; ++q) {
        colors_[q] = cell_color(field_.normalized({positions_[q], positions_[n + q], positions_[2 * n + q]}), level_);
      }
      return;
    }
    plane_.resize(n);
    if (view_ == FieldView::disparity) {
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
  const FieldView view_;
  const int level_;
  const std::size_t width_;  // features of a level
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

std::unique_ptr<DeviceIntegrator> make_device_view_integrator(const IntegratorInput& input, Stream& stream,
                                                              const DeviceWorld& world, DeviceField* field,
                                                              std::size_t capacity, FieldView view) {
  return std::make_unique<ViewIntegrator>(input, stream, world, *field, capacity, view);
}

std::size_t device_view_integrator_bytes(const IntegratorInput& input, std::size_t capacity, FieldView view) {
  std::size_t floats = 0;
  if (view == FieldView::features) floats = static_cast<std::size_t>(input.field->feature_count());
  if (view == FieldView::disparity) floats = 1;
  return DeviceGBuffer::bytes(capacity, false, view_rays(input.config, view)) +
         capacity * (sizeof(Vec3f) + floats * sizeof(float));
}

}  // namespace octrad
