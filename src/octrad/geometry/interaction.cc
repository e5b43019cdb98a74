#include "octrad/geometry/shape_view.h"
#include "octrad/geometry/tracer.h"

namespace octrad {

SurfaceInteraction interact(const Scene& scene, const Hit& hit, Vec3f origin, Vec3f direction) {
  return interact(shape_view(scene, static_cast<std::size_t>(hit.shape)), hit, origin, direction);
}

}  // namespace octrad
