// Points as they are given to a radiance field on the CPU, with what the field wants traced from them.
#pragma once

#include "octrad/base/query_rays.h"
#include "octrad/transport/context.h"

namespace octrad {

// Casts rays.count(alpha) rays (fewer where delta lobes draw the same one again). From `rng` come the direction of the
// offset's ray, where that has a spread, and then those of the lobe, stratified samples of the BSDF; a sample that
// carries no light counts as a ray that met nothing.
SurfacePoint field_query_point(const TransportContext& context, const ShadingPoint& shading, const QueryRays& rays,
                               Rng& rng);

}  // namespace octrad
