#include "app/cli/render_view.h"

#include <fmt/format.h>

#include <climits>
#include <cmath>

#include "octrad/base/error.h"
#include "octrad/image/io.h"
#include "octrad/image/metrics.h"
#include "octrad/render/renderer.h"
#include "octrad/scene/camera.h"

namespace octrad::cli {

Camera choose_camera(const Scene& scene, const ViewOptions& o) {
  const bool look = !o.origin.empty() || !o.target.empty();
  if (look + !o.camera_file.empty() + !o.path_file.empty() + o.sensor_given > 1)
    throw UsageError("--sensor, --camera, --path and --origin/--target exclude each other");
  for (const std::string& file : {o.camera_file, o.path_file}) {
    if (!file.empty() && o.fov > 0.0) throw UsageError(fmt::format("--fov: {} says the field of view", file));
  }
  const auto from_options = [](const auto& make) {  // what is wrong there is the command line
    try {
      return make();
    } catch (const InputError& error) {
      throw UsageError(error.what());
    }
  };
  Camera camera;
  if (!o.camera_file.empty()) {
    const std::vector<Camera> cameras = read_cameras(o.camera_file);
    if (cameras.size() != 1)
      throw InputError(fmt::format("{}: holds {} cameras where one is needed", o.camera_file, cameras.size()));
    camera = cameras.front();
  } else if (look) {
    if (o.origin.empty() || o.target.empty()) throw UsageError("--origin and --target belong together");
    const Camera& first = scene.cameras.front();
    const bool own_fov = o.fov > 0.0;
    camera = from_options([&] {
      return look_at(parse_vector(o.origin, "--origin"), parse_vector(o.target, "--target"),
                     o.up.empty() ? Vec3f{0, 1, 0} : parse_vector(o.up, "--up"),
                     own_fov ? static_cast<float>(o.fov) : first.fov_degrees,
                     own_fov ? parse_fov_axis(o.fov_axis) : first.fov_axis);
    });
    camera.set_mirrored(first.mirrored());
    camera.near_clip = first.near_clip;
    camera.far_clip = first.far_clip;
  } else {
    if (o.sensor >= static_cast<int>(scene.cameras.size())) {
      throw UsageError(fmt::format("--sensor {}: the scene has {} (numbered from 0)", o.sensor, scene.cameras.size()));
    }
    camera = scene.cameras[static_cast<std::size_t>(o.sensor)];
    if (o.fov > 0.0) {
      if (camera.kind == CameraKind::orthographic) throw UsageError("--fov: the sensor is orthographic");
      camera.fov_degrees = static_cast<float>(o.fov);
      camera.fov_axis = from_options([&] { return parse_fov_axis(o.fov_axis); });
    }
  }
  if (!look && !o.up.empty()) throw UsageError("--up belongs to --origin and --target");
  return camera;
}

View choose_view(const Scene& scene, const ViewOptions& o, Camera camera) {
  View view;
  if (camera.film_width <= 0 || camera.film_height <= 0) {
    camera.film_width = scene.film.width;
    camera.film_height = scene.film.height;
  }
  view.camera = camera;
  const Vec2i size = picture_size(view.camera.film_width, view.camera.film_height, o.width, o.height);
  view.width = size.x;
  view.height = size.y;
  if (!o.crop.empty()) {
    const std::vector<double> crop = parse_numbers(o.crop, 4, "--crop");
    for (const double v : crop) {
      if (!(std::fabs(v) <= INT_MAX) || v != std::floor(v))
        throw UsageError(fmt::format("--crop \"{}\": expected whole numbers x,y,width,height", o.crop));
    }
    view.crop = {static_cast<int>(crop[0]), static_cast<int>(crop[1]), static_cast<int>(crop[2]),
                 static_cast<int>(crop[3])};
    if (view.crop.width <= 0 || view.crop.height <= 0) throw UsageError("--crop: width and height must be above 0");
    require_crop_inside(view);
  }
  if (!o.mask.empty()) {
    const Image mask = read_image(o.mask);
    if (mask.width != view.width || mask.height != view.height)
      throw InputError(fmt::format("{}: a mask of {} x {} pixels for a picture of {} x {}", o.mask, mask.width,
                                   mask.height, view.width, view.height));
    view.mask = std::make_shared<const std::vector<std::uint8_t>>(picture_mask(mask));
  }
  return view;
}

}  // namespace octrad::cli
