#include "octrad/device/array.h"
#include "octrad/model/device_field.h"
#include "octrad/render/integrators.h"
#include "octrad/shading/device_world.h"
#include "octrad/transport/gbuffer_device.h"
#include "octrad/transport/rhs_device.h"

namespace octrad {
namespace {

class CacheIntegrator : public DeviceIntegrator {
 public:
  CacheIntegrator(const IntegratorInput& input, Stream& stream, const DeviceWorld& world, DeviceField& field,
                  std::size_t capacity, FirstHitOptions::Bounce bounce)
      : field_(field),
        options_(first_hit_options(input, bounce)),
        gbuffer_(stream, world, capacity, options_.bounce != FirstHitOptions::Bounce::none, picture_rays(input.config),
                 options_.split_coats),
        responses_(stream, gbuffer_.queries_of(capacity), "answers of the cache"),
        rhs_options_(rhs_rules(input.config)) {
    if (options_.bounce == FirstHitOptions::Bounce::none) return;
    rhs_options_.directions = 1;
    rhs_options_.seed = input.seed;
    rhs_ = std::make_unique<DeviceRhs>(stream, world, capacity, query_rays(input.config));
    rhs_responses_ = DeviceArray<Vec3f>(stream, capacity, "answers of the cache");
    targets_ = DeviceArray<Vec3f>(stream, capacity, "right-hand sides");
  }

  void set(const CameraJob& job) override { gbuffer_.set(job); }
  void run(std::size_t samples) override {
    gbuffer_.run(options_, samples);
    field_.radiance(gbuffer_.queries(), gbuffer_.query_count(), gbuffer_.queries_of(samples), responses_.data());
    if (rhs_) {
      const DeviceRhsPoints points{gbuffer_.bounce_points(), gbuffer_.bounce_count(), samples, nullptr,
                                   gbuffer_.bounce_keys()};
      rhs_->trace(points, rhs_options_);
      field_.radiance(rhs_->queries(), rhs_->query_count(), samples, rhs_responses_.data());
      rhs_->reduce(points, rhs_options_, rhs_responses_.data(), targets_.data());
    }
    gbuffer_.add(responses_.data(), rhs_ ? targets_.data() : nullptr, samples);
  }
  const CameraJob* job() const override { return gbuffer_.job(); }
  SamplePlanes samples() const override { return gbuffer_.samples(); }
  SampleCounts take_counts() override {
    TraceCounts sum = gbuffer_.take_counts();
    if (rhs_) sum += rhs_->take_counts();
    return sample_counts(sum);
  }

 private:
  DeviceField& field_;
  const FirstHitOptions options_;
  DeviceGBuffer gbuffer_;
  DeviceArray<Vec3f> responses_, rhs_responses_, targets_;
  std::unique_ptr<DeviceRhs> rhs_;
  DeviceRhsOptions rhs_options_;
};

}  // namespace

std::unique_ptr<DeviceIntegrator> make_device_cache_integrator(const IntegratorInput& input, Stream& stream,
                                                               const DeviceWorld& world, DeviceField* field,
                                                               std::size_t capacity, FirstHitOptions::Bounce bounce) {
  return std::make_unique<CacheIntegrator>(input, stream, world, *field, capacity, bounce);
}

std::size_t device_cache_integrator_bytes(const IntegratorInput& input, std::size_t capacity,
                                          FirstHitOptions::Bounce bounce) {
  const bool bounces = first_hit_options(input, bounce).bounce != FirstHitOptions::Bounce::none;
  const bool split = split_coats(input.config);
  return DeviceGBuffer::bytes(capacity, bounces, picture_rays(input.config), split) +
         (split ? 2 * capacity : capacity) * sizeof(Vec3f) +
         (bounces ? DeviceRhs::bytes(capacity, query_rays(input.config)) + 2 * capacity * sizeof(Vec3f) : 0);
}

}  // namespace octrad
