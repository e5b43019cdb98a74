// The box that a field covers, chosen by what is reached and seen: one large ground plane must not make the cells of a
// room as large as a table.
#pragma once

#include <string>
#include <vector>

#include "octrad/geometry/voxelize.h"
#include "octrad/model/config.h"
#include "octrad/model/radiance_field.h"
#include "octrad/scene/camera.h"
#include "octrad/transport/prepared_scene.h"

namespace octrad {

// The box of a scene with `bounds` and how it fits.
struct DomainFit {
  Domain box;
  double whole = 0.0;     // largest side of the scene's own box
  double outside = 0.0;   // share of the points seen that lie outside the box
  double cell = 0.0;      // largest side of the field's finest cells; 0: not known
  double distance = 0.0;  // of the first surfaces from their sensors: median, world units; 0: no sensor sees any
  double pixel = 0.0;     // side of what a pixel of the sensor covers there: median, world units
};

// The box that octree.bounds asks for. `auto`: of boxes that leave out 0 to 10 % of the points seen on each of their
// sides, the one with the smallest mean of log2(e + d), where e is a cell (1/256 of the largest side, whatever the
// field) and d is how far outside a point lies: answers there are as coarse as that. But the scene's own box unless
// cells become half as large at least, so that rooms keep it. Throws InputError where the scene has no shape.
DomainFit fit_domain(const PreparedScene& scene, const Config& config, const std::vector<Camera>& cameras = {});

// One line for a log, and what to say where cells are far larger than what is seen (empty otherwise).
std::string domain_text(const DomainFit& fit);
std::string domain_warning(const DomainFit& fit);

// What a field over this box gets.
FieldDomain field_domain(const Scene& scene, const Config& config, const Domain& box);

}  // namespace octrad
