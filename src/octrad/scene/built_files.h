// Meshes, pictures and curves that a scene file holds inside, or that are made of those it refers to, under the names
// by which the elements of its description refer to them. Internal to the module.
#pragma once

#include <functional>
#include <map>
#include <string>

#include "octrad/image/image.h"
#include "octrad/scene/curves.h"
#include "octrad/scene/mesh.h"

namespace octrad {

struct BuiltPicture {
  std::function<Image()> read;           // throws as read_image() does
  std::function<std::string()> encoded;  // of a picture that is used as its file has it: the content of that; or empty
};

struct BuiltFiles {
  std::map<std::string, RawMesh> meshes;
  std::map<std::string, BuiltPicture> pictures;
  std::map<std::string, Curves> curves;
};

}  // namespace octrad
