// What every estimator needs to trace light: the scene, something that casts rays, its materials and lights.
#pragma once

#include <optional>

#include "base/rng.h"
#include "base/surface_point.h"
#include "geometry/tracer.h"
#include "scene/scene.h"
#include "shading/bsdf.h"
#include "shading/lights.h"

namespace octrad {

struct TransportContext {
  const Scene& scene;
  const Tracer& tracer;
  const Materials& materials;
  const Lights& lights;
};

inline constexpr float kRayInfinity = 1e30f;

// The point as a radiance field sees it: normal on the side of the viewer (method section 1).
SurfacePoint surface_point(const ShadingPoint& shading);

// Where a ray ends after masks have been passed through by chance (their opacity) and, if asked for, after mirrors and
// glass have been followed.
struct RayEnd {
  bool surface = false;            // ended on a surface that scatters; otherwise it escaped or was absorbed
  bool escaped = false;            // left the scene
  ShadingPoint point;              // the surface, opacity already decided
  Vec3f throughput{1, 1, 1};       // of the delta surfaces on the way
  Vec3f emitted{0, 0, 0};          // emission met after the first segment, times throughput
  Vec3f first_emitted{0, 0, 0};    // emission met at the end of the first segment (surface or environment)
  Vec3f passed_emitted{0, 0, 0};   // the part of both that was met before `point`, times throughput
  Vec3f own_emitted{0, 0, 0};      // radiance that `point` itself emits along the ray; throughput times this is the other part
  float first_light_pdf = 0.0f;    // density with which light sampling from `position` finds it
  int rays = 0;
};

// Follows a ray that leaves `position`: a surface with `geometric_normal`, or free space where that is null. `first`, if given,
// becomes the first surface that no mask let the ray pass, also where the ray goes on (a mirror) or is absorbed.
RayEnd follow_ray(const TransportContext& context, Vec3f position, const Vec3f* geometric_normal, Vec3f direction, Rng& rng,
                  bool follow_delta, int max_chain, float t_max = kRayInfinity,
                  std::optional<ShadingPoint>* first = nullptr);

}  // namespace octrad
