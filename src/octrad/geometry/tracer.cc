#include "octrad/geometry/tracer.h"

namespace octrad {

void Tracer::intersect(std::span<const RayQuery> rays, Hit* hits) const {
  for (std::size_t i = 0; i < rays.size(); ++i)
    hits[i] = intersect(rays[i].origin, rays[i].direction, 0.0f, rays[i].t_max);
}

void Tracer::occluded(std::span<const RayQuery> rays, unsigned char* blocked) const {
  for (std::size_t i = 0; i < rays.size(); ++i)
    blocked[i] = occluded(rays[i].origin, rays[i].direction, 0.0f, rays[i].t_max) ? 1 : 0;
}

}  // namespace octrad
