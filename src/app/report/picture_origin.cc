#include "app/report/picture_origin.h"

#include <fmt/format.h>
#include "app/report/vector_json.h"

#include "octrad/base/json_file.h"
#include "octrad/base/version.h"
#include "octrad/scene/fingerprint.h"

namespace octrad::report {

nlohmann::json camera_json(const Camera& c) {
  const Vec3f target = c.origin + c.forward;
  nlohmann::json json = {{"origin", vector_json(c.origin)}, {"target", vector_json(target)}, {"up", vector_json(c.up)}};
  if (c.mirrored()) json["mirrored"] = true;
  if (c.kind == CameraKind::orthographic) {
    json["type"] = "orthographic";
    json["view_width"] = 2.0f * c.half_size.x;
    if (c.half_size.y != c.half_size.x) json["view_height"] = 2.0f * c.half_size.y;
  } else {
    json["fov"] = c.fov_degrees;
    json["fov_axis"] = fov_axis_name(c.fov_axis);
  }
  if (c.kind == CameraKind::thinlens) {
    json["type"] = "thinlens";
    json["aperture_radius"] = c.aperture_radius;
    json["focus_distance"] = c.focus_distance;
  }
  if (c.crop_size.x != 1.0f || c.crop_size.y != 1.0f)
    json["window"] = {c.crop_offset.x, c.crop_offset.y, c.crop_size.x, c.crop_size.y};
  return json;
}

std::string whole_camera(const Camera& camera) {
  nlohmann::json json = camera_json(camera);
  json["near_clip"] = camera.near_clip;
  json["far_clip"] = camera.far_clip;
  json["principal_point_offset"] = {camera.principal_point_offset.x, camera.principal_point_offset.y};
  return json.dump();
}

std::string filter_text(const Film& film) {
  const FilterShape shape = ReconstructionFilter(film).shape();
  std::string filter = fmt::format("{} {} {}", static_cast<int>(shape.type), shape.radius, shape.exponent);
  if (shape.type == FilterShape::Type::cubic) filter += fmt::format(" {} {}", shape.b, shape.c);
  return filter;
}

std::string view_hash(const View& view, const Film& film) {
  const std::string text = whole_camera(view.camera) + filter_text(film);
  return fmt::format("{:016x}", hash_bytes(text.data(), text.size(), 0));
}

std::string mask_hash(const View& view) {
  if (!view.mask) return "";
  return fmt::format("{:016x}",
                     hash_bytes(view.mask->data(), view.mask->size(), static_cast<std::uint64_t>(view.width)));
}

void add_origin(Image& image, const PictureOrigin& origin) {
  std::map<std::string, std::string>& metadata = image.metadata;
  const View& view = origin.view;
  metadata["octrad.version"] = kVersion;
  metadata["octrad.scene"] =
      json_text({{"file", origin.scene.file}, {"fingerprint", picture_fingerprint(origin.scene)}});
  metadata["octrad.camera"] = camera_json(view.camera).dump();
  nlohmann::json render = {{"integrator", origin.integrator},
                           {"spp", origin.spp},
                           {"max_depth", origin.max_depth},
                           {"seed", origin.seed},
                           {"seconds", origin.seconds}};
  if (origin.rr_depth >= 0) render["rr_depth"] = origin.rr_depth;
  if (view.mask) render["mask"] = mask_hash(view);
  render["view"] = view_hash(view, origin.film);
  metadata["octrad.render"] = render.dump();
  if (origin.config != nullptr) {
    metadata["octrad.config"] = json_text(to_json(*origin.config));
    metadata["octrad.model"] = json_text({{"file", origin.model_file}, {"step", origin.model_step}});
  }
  if (view.crop.width > 0) {
    metadata["dataWindow.min"] = fmt::format("{} {}", view.crop.x, view.crop.y);
    metadata["displayWindow"] = fmt::format("{} {}", view.width, view.height);
  }
}

}  // namespace octrad::report
