// Sensors and lights of pbrt as elements. Internal to pbrt*.cc.
#pragma once

#include <numbers>
#include <string>

#include "octrad/scene/pbrt/material.h"
#include "octrad/scene/transform.h"

namespace octrad {

constexpr double kPbrtDegrees = 180.0 / std::numbers::pi;  // a radian

// <tag name= value=> at the end of `parent`.
inline void add_pbrt_value(Element& parent, const Location& where, const char* tag, const char* name,
                           const std::string& value) {
  add_element(parent, where, tag, {{"name", name}, {"value", value}});
}

// At the end of `root`; without a film or a filter pbrt's own; `old`: of pbrt-v3.
void add_pbrt_sensor(const PbrtObject& camera, const Transform& camera_to_world, const PbrtObject* film,
                     const PbrtObject* filter, bool old, Element& root, SceneReport& report);

// `to_world`: the transform at the light; `old`: of pbrt-v3.
void add_pbrt_light(const PbrtObject& light, const Transform& to_world, bool old, PbrtMaterials& materials,
                    Description& description, SceneReport& report);

}  // namespace octrad
