// The types of objects that scene files may name, as the readers know them.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace octrad {

std::vector<std::string> shape_types();     // load_shapes.cc
std::vector<std::string> bsdf_types();      // load_materials.cc
std::vector<std::string> texture_types();   // load_textures.cc
std::vector<std::string> spectrum_types();  // spectrum.cc
std::vector<std::string> emitter_types();   // load_emitters.cc
std::vector<std::string> sensor_types();    // load_sensors.cc, as the rest
std::vector<std::string> film_types();
std::vector<std::string> rfilter_types();

// All of them: tag and types. What each may hold is in plugin_help.h.
std::vector<std::pair<std::string, std::vector<std::string>>> plugin_types();

}  // namespace octrad
