// Makers of the integrators, for the list in integrators.cc. Each is in the file that its comment names.
#pragma once

#include "octrad/base/query_rays.h"
#include "octrad/render/integrator.h"
#include "octrad/transport/first_hit_math.h"
#include "octrad/transport/trace_counts.h"

namespace octrad {

// A camera sample's radiance with the attributes of its first hit.
inline PixelSample pixel_sample(Vec3f radiance, const FirstHit& first) {
  return {radiance, first.albedo, first.normal, first.depth, first.roughness};
}

inline SampleCounts sample_counts(const TraceCounts& counts) {
  return {static_cast<long long>(counts.rays), static_cast<long long>(counts.queries),
          static_cast<long long>(counts.non_finite)};
}

// path_integrator.cc, path_integrator_device.cc: path tracing without a model.
std::unique_ptr<Integrator> make_path_integrator(const IntegratorInput& input);
std::unique_ptr<DeviceIntegrator> make_device_path_integrator(const IntegratorInput& input, Stream& stream,
                                                              const DeviceWorld& world, DeviceField*,
                                                              std::size_t capacity);
std::size_t device_path_integrator_bytes(const IntegratorInput& input, std::size_t capacity);

// cache_integrators.cc, cache_integrators_device.cc: a field is queried at the first hit, or where one bounce from it
// ends.
std::unique_ptr<Integrator> make_cache_integrator(const IntegratorInput& input, FirstHitOptions::Bounce bounce);
std::unique_ptr<DeviceIntegrator> make_device_cache_integrator(const IntegratorInput& input, Stream& stream,
                                                               const DeviceWorld& world, DeviceField* field,
                                                               std::size_t capacity, FirstHitOptions::Bounce bounce);
std::size_t device_cache_integrator_bytes(const IntegratorInput& input, std::size_t capacity,
                                          FirstHitOptions::Bounce bounce);
// What they share: the options of their first hits.
FirstHitOptions first_hit_options(const IntegratorInput& input, FirstHitOptions::Bounce bounce);

// views.cc, views_device.cc: what a field holds at the first hit.
enum class FieldView {
  disparity,  // of look-ups: predicted or traced
  traced,     // 1 / distance along the look-up direction
  features,   // of a level: the first three principal components over the picture
  occupancy,  // of a level: cells that hold surfaces, coloured by a hash of their index
};
// What is traced from the points that a view shows: nothing from the BSDF, which radiance alone hangs on; for `traced`
// from rough points too, whatever lookup.rough_offset is.
QueryRays view_rays(const Config& config, FieldView view);
std::unique_ptr<Integrator> make_view_integrator(const IntegratorInput& input, FieldView view);
std::unique_ptr<DeviceIntegrator> make_device_view_integrator(const IntegratorInput& input, Stream& stream,
                                                              const DeviceWorld& world, DeviceField* field,
                                                              std::size_t capacity, FieldView view);
std::size_t device_view_integrator_bytes(const IntegratorInput& input, std::size_t capacity, FieldView view);

}  // namespace octrad
