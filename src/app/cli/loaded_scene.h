// A scene with what is needed to trace light in it.
#pragma once

#include <map>
#include <memory>
#include <string>

#include "octrad/geometry/tracer.h"
#include "octrad/scene/scene.h"
#include "octrad/shading/bsdf.h"
#include "octrad/shading/lights.h"

namespace octrad::cli {

struct LoadedScene {
  std::unique_ptr<Scene> scene;  // behind a pointer: the others refer to it
  std::unique_ptr<Tracer> tracer;
  std::unique_ptr<Materials> materials;
  std::unique_ptr<Lights> lights;
};

// Parses the file (logging its warnings). Without `tracing` only the scene is filled in.
LoadedScene open_scene(const std::string& file, const std::map<std::string, std::string>& definitions,
                       bool tracing = true);

}  // namespace octrad::cli
