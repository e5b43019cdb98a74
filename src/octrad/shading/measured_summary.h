// What caches are told of a measured material.
#pragma once

#include "octrad/base/vec.h"
#include "octrad/scene/measured.h"

namespace octrad {

struct MeasuredSummary {
  Vec3f albedo{0, 0, 0};   // reflectance under even light
  float roughness = 1.0f;  // alpha of a GGX distribution whose normals have the same median slope
};

MeasuredSummary summarize(const MeasuredMaterial& material);

}  // namespace octrad
