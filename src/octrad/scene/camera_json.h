// Cameras and numbers of JSON objects, for the files that hold cameras. Every function throws InputError with a text
// that starts with `where`.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "octrad/scene/camera.h"

namespace octrad {

// An array of exactly `count` finite numbers.
std::vector<double> read_array(const nlohmann::json& object, const std::string& key, std::size_t count,
                               const std::string& where);
// A number in [lower, upper]; `fallback` where there is no such key.
double read_number(const nlohmann::json& object, const std::string& key, double fallback, double lower, double upper,
                   const std::string& where);
// The same for whole numbers.
int read_integer(const nlohmann::json& object, const std::string& key, int fallback, int lower, int upper,
                 const std::string& where);
// A camera as read_cameras() describes it.
Camera read_camera(const nlohmann::json& object, const std::string& where);

}  // namespace octrad
