// Points as they are given to a radiance field on the CPU, with what the field wants traced from them.
#pragma once

#include "octrad/transport/context.h"

namespace octrad {

// Casts rays.count(alpha) rays (fewer where delta lobes draw the same one again). The lobe's directions are stratified
// samples of the BSDF from `rng`; a sample that carries no light counts as a ray that met nothing.
SurfacePoint field_query_point(const TransportContext& context, const ShadingPoint& shading, const QueryRays& rays,
                               Rng& rng);

}  // namespace octrad
