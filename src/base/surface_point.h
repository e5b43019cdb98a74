// What a radiance field is asked about (method section 1): one point of a surface seen from one direction.
#pragma once

#include "base/vec.h"

namespace octrad {

struct SurfacePoint {
  Vec3f x;                 // world position
  Vec3f n;                 // unit shading normal, on the side of wo
  Vec3f wo;                // unit direction towards the viewer
  Vec3f albedo;            // linear RGB, independent of wo
  float alpha = 1.0f;      // roughness: 1 diffuse, 0 perfectly smooth
  float disparity = 0.0f;  // 1 / distance along the mirror direction, only where `lookup.offset = traced` asks for it
};

}  // namespace octrad
