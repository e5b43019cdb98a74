// Ambient occlusion of a camera sample, for host and device: whether a direction drawn over its first hit is free.
// Template of docs/extending.md.
#pragma once

#include "octrad/base/frame.h"
#include "octrad/shading/square_maps.h"
#include "octrad/transport/first_hit_math.h"

namespace octrad {

// `first`: attributes of the first hit. `reach`: how far an occluder counts. `World`: TransportContext or DeviceWorld.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline Vec3f occlusion(const World& world, CameraSample sample, float reach, FirstHit& first) {
  RayEnd end;
  trace_first_hit(world, FirstHitOptions{}, sample, end, first);
  if (!end.surface) return Vec3f(first.valid ? 0.0f : 1.0f);
  const Frame frame = make_frame(viewed_normal(end.point));
  const Vec3f direction = frame.to_world(square_to_cosine_hemisphere(sample.rng.uniform2()));
  const SurfaceInteraction& surface = end.point.surface;
  const Vec3f origin = offset_origin(surface.position, surface.geometric_normal, direction);
  return Vec3f(world.occluded(origin, direction, 0.0f, reach) ? 0.0f : 1.0f);
}

}  // namespace octrad
