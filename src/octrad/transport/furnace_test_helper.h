// For tests of transport: closed boxes whose light is known.
#pragma once

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <utility>

#include "octrad/scene/load.h"
#include "octrad/transport/prepared_scene.h"

namespace octrad::testing {

// A closed cube of side 2 seen from inside; `material` and `emitter` are XML inside the shape.
inline Scene furnace(const std::string& material, const std::string& emitter, const std::string& more = "") {
  const auto file = std::filesystem::temp_directory_path() / ("octrad_furnace_" + std::to_string(::getpid()) + ".xml");
  std::ofstream(file)
      << R"(<scene version="3.0.0"><sensor type="perspective"><film type="hdrfilm"><integer name="width" value="16"/>
    <integer name="height" value="16"/></film></sensor><shape type="cube"><boolean name="flip_normals" value="true"/>)"
      << material << emitter << "</shape>" << more << "</scene>";
  Scene scene = load_scene(file.string());
  std::filesystem::remove(file);
  return scene;
}

struct FurnaceScene {
  PreparedScene prepared;
  const Scene& scene = prepared.scene();
  TransportContext context = prepared.context();
  explicit FurnaceScene(Scene s) : prepared(std::move(s)) {}
};

inline const std::string kGrey = R"(<bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf>)";
inline const std::string kGlow = R"(<emitter type="area"><rgb name="radiance" value="1"/></emitter>)";

}  // namespace octrad::testing
