// Curves with a radius, as Mitsuba's shapes linearcurve and bsplinecurve have them, made into tubes of triangles.
#pragma once

#include <string>
#include <vector>

#include "octrad/scene/mesh.h"

namespace octrad {

struct CurvePoint {
  Vec3d position;
  double radius = 0.0;
};

enum class CurveKind { linear, bspline };
using Curves = std::vector<std::vector<CurvePoint>>;

// Text with one control point a line, x y z radius, and empty lines between curves of at least 2 (linear) or 4 points.
// More numbers in a line are skipped. Throws InputError with file:line:column, IoError.
Curves read_curves(const std::string& file, CurveKind kind);
Curves parse_curves(const std::string& name, const std::string& text, CurveKind kind);

// The text that reads as these curves.
std::string curves_text(const Curves& curves);

// The surface in world space, facing outwards, with normals and Mitsuba's texture coordinates; radii do not follow
// `to_world`, as in Mitsuba. Linear curves are cones between spheres about their points; cubic B-splines are open at
// their ends. Tubes have 48 sides, down to 6 where there would be more than about four million triangles. Texture
// coordinates beyond the seam go on over 1. Throws InputError without a place, MemoryError.
RawMesh make_curves(const Curves& curves, CurveKind kind, const Transform& to_world);

}  // namespace octrad
