// What octrad render shows: its options of the camera and the size.
#pragma once

#include <string>

#include "app/cli/common.h"
#include "octrad/render/view.h"
#include "octrad/scene/scene.h"

namespace octrad::cli {

struct ViewOptions {
  int width = 0, height = 0;
  std::string crop, mask;
  int sensor = 0;
  bool sensor_given = false;
  std::string origin, target, up;
  double fov = 0.0;
  std::string fov_axis = "x";
  std::string camera_file, path_file;
};

// --camera, --origin ..., or a sensor of the scene. Throws UsageError for options that contradict each other.
Camera choose_camera(const Scene& scene, const ViewOptions& o);
// The camera with the size of the picture: asked for, the camera's own, or the film's of the scene. Reads --mask;
// throws InputError for a mask of another size.
View choose_view(const Scene& scene, const ViewOptions& o, Camera camera);
inline double pixels_of(const View& view) { return static_cast<double>(view.part().width()) * view.part().height(); }

}  // namespace octrad::cli
