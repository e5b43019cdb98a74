// A shaded hit. Plain data, for host and device.
#pragma once

#include "octrad/geometry/surface_interaction.h"
#include "octrad/shading/bsdf_types.h"

namespace octrad {

// Geometry, frame flipped to the side of wo on two-sided surfaces, bump applied, textures evaluated.
struct ShadingPoint {
  SurfaceInteraction surface;
  Vec3f ns, s, t;  // shading frame in world space (left-handed where a two-sided surface was flipped)
  Vec3f wo;        // world
  Bsdf bsdf;
  bool front = true;   // seen from the side of the geometric normal
  bool black = false;  // back side of a one-sided surface: scatters nothing, but for what its opacity lets through
  OCTRAD_HD Vec3f to_local(Vec3f v) const { return {dot(v, s), dot(v, t), dot(v, ns)}; }
  OCTRAD_HD Vec3f to_world(Vec3f v) const { return s * v.x + t * v.y + ns * v.z; }
};

}  // namespace octrad
