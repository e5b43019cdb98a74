// Integrators that ask a radiance field (method section 8): `lhs`, `rhs`, `deferred`, and views of what a field holds.
#pragma once

#include <string>
#include <vector>

#include "octrad/model/config.h"
#include "octrad/model/radiance_field.h"
#include "octrad/render/render_loop.h"
#include "octrad/transport/context.h"

namespace octrad {

enum class CacheMode {
  lhs,       // one query at the first hit
  rhs,       // one bounce from the first hit, the field queried where it ends
  deferred,  // rhs where the roughness is below lookup.rough_threshold, lhs elsewhere
};

// The sample function of `render()`. `directions`: bounces a sample for rhs (each camera sample has its own first hit).
// `config` is the model's: target.emission, lookup.offset, render.delta. All arguments must outlive the function.
SampleFunction cache_integrator(const TransportContext& context, const RadianceField& field, const Config& config,
                                CacheMode mode, int directions, unsigned long long seed);

// Views: "disparity" (predicted), "traced" (1 / distance along the mirror direction), "features1" ... "featuresK"
// (first three principal components of a level's features over the picture), "occupancy1" ... "occupancyK" (cells of a
// level that hold surfaces, coloured by a hash of their index).
std::vector<std::string> view_names(const RadianceField& field);
// Throws UsageError for a view that the field does not have.
RenderResult render_view(const RenderOptions& options, const TransportContext& context, const RadianceField& field,
                         const Config& config, const std::string& view);

}  // namespace octrad
