#include "app/report/picture_origin.h"

#include <fmt/format.h>
#include <algorithm>

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

PictureOrigin::PictureOrigin(const Scene& of_scene, const View& of_view, const RenderSettings& settings,
                             const IntegratorInfo& info, const std::string& name)
    : scene(of_scene),
      view(of_view),
      film(settings.film),
      integrator(name),
      seed(settings.seed) {
  if (!info.uses_depth) return;
  max_depth = settings.max_depth;
  rr_depth = settings.rr_depth;
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

std::vector<long long> picture_seeds(const Image& image) {
  using List = std::vector<nlohmann::json>;
  std::vector<long long> seeds;
  for (const nlohmann::json& seed : metadata_value<List>(image, "octrad.render", "seeds", {})) {
    if (seed.is_number_integer()) seeds.push_back(seed.get<long long>());
  }
  const auto one = metadata_value<long long>(image, "octrad.render", "seed", -1);
  if (one >= 0) seeds.push_back(one);
  return seeds;
}

bool share_a_seed(const std::vector<long long>& a, const std::vector<long long>& b) {
  return std::find_first_of(a.begin(), a.end(), b.begin(), b.end()) != a.end();
}

std::string view_difference(const Image& a, const Image& b) {
  const std::string unknown;
  const auto told = [](const std::string& x, const std::string& y) { return !x.empty() && !y.empty() && x != y; };
  const auto text = [&](const Image& image, const char* key) {
    const auto found = image.metadata.find(key);
    return found == image.metadata.end() ? unknown : found->second;
  };
  const auto value = [&](const Image& image, const char* name, const char* key) {
    return metadata_value(image, name, key, unknown);
  };
  if (told(value(a, "octrad.scene", "fingerprint"), value(b, "octrad.scene", "fingerprint"))) return "their scene";
  const std::string camera = text(a, "octrad.camera"), other_camera = text(b, "octrad.camera");
  if (told(camera, other_camera)) return "their camera";
  for (const char* key : {"displayWindow", "dataWindow.min"}) {
    const std::string x = text(a, key), y = text(b, key);
    if (told(x, y) || (x != y && !camera.empty() && !other_camera.empty())) return "their crop";
  }
  if (told(value(a, "octrad.render", "view"), value(b, "octrad.render", "view")))
    return "their filter, clipping planes or principal point";
  return unknown;
}

}  // namespace octrad::report
