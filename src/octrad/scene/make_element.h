// Elements that no XML file has: of a glTF or pbrt file, or added where something is missing. Internal to the module.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "octrad/base/vec.h"
#include "octrad/scene/description.h"
#include "octrad/scene/transform.h"

namespace octrad {

using Attributes = std::vector<std::pair<std::string, std::string>>;

// A new element at the end of `parent`.
Element& add_element(Element& parent, const Location& where, const std::string& tag, Attributes attributes);
// A property such as <float name="alpha" value="0.1"/>, at the place of `near`; no name where that is empty.
std::unique_ptr<Element> make_property(const std::string& tag, const std::string& name, const std::string& value,
                                       const Element& near);
void add_matrix(Element& parent, const Location& where, const std::string& name, const Transform& t);
std::string three_numbers(Vec3d v);

// How a sensor that is made sees. Its film has 720 rows.
struct MadeSensor {
  std::string type = "perspective";  // or "orthographic", whose half sizes are the scale of its transform
  double fov_degrees = 40.0;         // of the height; perspective
  double aspect = 4.0 / 3.0;         // width by height
  double near_clip = 0.01, far_clip = 10000.0;
};
Element& make_sensor(Element& root, const Location& where, const Transform& to_world, const MadeSensor& sensor);

// A sensor that has all of `bounds` in its picture, with y up: from the front, which glTF has at +z, a little from
// above and the side.
Element& make_overview_sensor(Element& root, const Location& where, const Bounds3f& bounds);

}  // namespace octrad
