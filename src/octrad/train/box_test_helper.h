// For tests of training: a scene small enough to take steps in milliseconds.
#pragma once

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "octrad/scene/load.h"
#include "octrad/transport/prepared_scene.h"

namespace octrad::testing {

// A lit box with a glossy wall, small enough to train a few steps in milliseconds.
struct Box {
  explicit Box(double radiance = 8.0) : scene(load(radiance)) {}
  PreparedScene scene;

  static Scene load(double radiance) {
    const auto file = std::filesystem::temp_directory_path() / ("octrad_box_" + std::to_string(::getpid()) + ".xml");
    std::ofstream(file)
        << R"(<scene version="3.0.0"><sensor type="perspective"><transform name="to_world"><lookat origin="0,0,-0.9" target="0,0,1" up="0,1,0"/>
      </transform><film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="16"/></film></sensor>
      <shape type="cube"><boolean name="flip_normals" value="true"/><bsdf type="diffuse"><rgb name="reflectance" value="0.6, 0.5, 0.4"/></bsdf></shape>
      <shape type="rectangle"><transform name="to_world"><scale value="0.3"/><rotate x="1" angle="90"/><translate y="0.99"/></transform>
      <emitter type="area"><rgb name="radiance" value=")"
        << radiance << R"("/></emitter></shape>
      <shape type="sphere"><float name="radius" value="0.4"/><bsdf type="roughconductor"><float name="alpha" value="0.1"/></bsdf></shape></scene>)";
    Scene scene = load_scene(file.string());
    std::filesystem::remove(file);
    return scene;
  }
};

}  // namespace octrad::testing
