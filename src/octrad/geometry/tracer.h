// Ray casting against a Scene: closest hit and occlusion. Only embree_tracer.cc uses Embree. Rays that leave a surface
// start at offset_origin (geometry/offset_math.h).
#pragma once

#include <memory>
#include <span>
#include <string>

#include "octrad/geometry/hit.h"
#include "octrad/geometry/offset_math.h"
#include "octrad/geometry/surface_interaction.h"
#include "octrad/scene/scene.h"

namespace octrad {

class Tracer {
 public:
  virtual ~Tracer() = default;
  virtual Hit intersect(Vec3f origin, Vec3f direction, float t_min, float t_max) const = 0;
  virtual bool occluded(Vec3f origin, Vec3f direction, float t_min, float t_max) const = 0;
  // Many rays at once, each from 0 to its t_max: hits[i] or blocked[i] (0 or 1) for rays[i]. The same results up to
  // rounding.
  virtual void intersect(std::span<const RayQuery> rays, Hit* hits) const;
  virtual void occluded(std::span<const RayQuery> rays, unsigned char* blocked) const;
};

// The scene must outlive the tracer. `device_config`: Embree's own settings, such as "isa=avx2" (for tests).
std::unique_ptr<Tracer> make_embree_tracer(const Scene& scene, const std::string& device_config = "");

// Geometry of a hit point.
SurfaceInteraction interact(const Scene& scene, const Hit& hit, Vec3f origin, Vec3f direction);

}  // namespace octrad
