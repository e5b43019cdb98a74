#include <algorithm>
#include <cmath>

#include "octrad/base/join.h"
#include "octrad/scene/builder.h"
#include "octrad/scene/limits.h"
#include "octrad/scene/plugins.h"

namespace octrad {
namespace {

const std::vector<std::string> kEmitters = {"point", "spot", "directional", "projector", "envmap", "constant"};

}  // namespace

std::vector<std::string> emitter_types() {
  std::vector<std::string> types = kEmitters;
  types.push_back("area");
  return types;
}

void SceneBuilder::add_emitter(const Element& element) {
  Params params(description_, element, scene_.warnings);
  const std::string& type = params.type();
  if (type == "envmap" || type == "constant") return add_environment(params);
  if (type == "area") fail(element.location, "an area emitter must stand inside a shape");
  if (type == "sky" || type == "sun" || type == "sunsky" || type == "timed_sunsky" || type == "avg_sunsky") {
    fail(element.location, "emitter \"" + type +
                               "\" is not supported: bake it to a picture with Mitsuba (render it with a sensor that "
                               "sees all directions, or evaluate the emitter along them), and load that as an envmap");
  }
  if (type == "directionalarea")
    fail(element.location,
         "emitter \"directionalarea\" is not supported; take \"directional\" for light from far away");
  if (std::find(kEmitters.begin(), kEmitters.end(), type) == kEmitters.end())
    params.fail_type(kEmitters, "",
                     std::string(", and area inside a shape") +
                         (type == "collimated" ? "; use spot with a small cutoff_angle, or directional" : ""));
  add_delta_light(params);
}

void SceneBuilder::add_delta_light(Params& params) {
  using Kind = DeltaLight::Kind;
  DeltaLight light;
  light.kind = static_cast<Kind>(std::find(kEmitters.begin(), kEmitters.end(), params.type()) - kEmitters.begin());
  const bool projector = light.kind == Kind::projector, directional = light.kind == Kind::directional,
             point = light.kind == Kind::point;
  const std::string other = point ? "position" : directional ? "direction" : "";
  if (!other.empty() && params.given(other) && params.given("to_world"))
    fail(params.where(other), "give either " + other + " or to_world");
  Transform to_world = params.get_transform("to_world");
  if (point) to_world = Transform::translate(params.get_point("position", Vec3d(to_world.column(3))));
  if (to_world.is_singular(1e-9)) fail(params.where("to_world"), "to_world of " + params.what() + " is singular");
  if (!within(to_world.column(3), kLargestCoordinate))
    fail(params.where("to_world"), params.what() + " is too far away: coordinates may be up to 1e9");
  light.position = Vec3f(to_world.column(3));
  light.axis = Vec3f(to_world.column(2));
  const Transform to_local = to_world.inverse();
  for (std::size_t i = 0; i < 12; ++i) light.to_local[i] = static_cast<float>(to_local.m[i]);
  if (directional) {
    const Vec3d direction = params.get_point("direction", to_world.column(2));
    if (!(length(direction) > 0.0)) fail(params.where("direction"), "the direction of a light must not be zero");
    light.axis = Vec3f(normalize(direction));
  }

  const std::string strength = projector || directional ? "irradiance" : "intensity";
  const int texture = texture_or(params, strength, TextureRole::radiance, 1.0f);
  const bool varies = scene_.textures[static_cast<std::size_t>(texture)].kind != Texture::Kind::constant;
  if (!projector && varies)
    fail(params.where(strength), "the " + strength + " of " + params.what() + " must be a constant");
  if (!varies) light.intensity = scene_.textures[static_cast<std::size_t>(texture)].color0;
  if (projector) {
    const float factor = params.get_float("scale", 1.0f);
    if (!(factor >= 0.0f)) fail(params.where("scale"), "the scale of a projector must not be negative");
    light.intensity *= kPi * factor;
    if (varies) light.texture = texture;
    Camera::FovAxis axis = Camera::FovAxis::x;
    float degrees = 0.0f;
    field_of_view(params, degrees, axis);
    projectors_.push_back({scene_.delta_lights.size(), degrees, axis});
  } else if (light.kind == Kind::spot) {
    const float cutoff = params.float_in("cutoff_angle", 20.0f, 1e-3f, 180.0f);
    // A beam as wide as the cutoff, or wider, has a sharp edge there.
    const float beam = std::min(params.float_in("beam_width", cutoff * 0.75f, 0.0f, 180.0f), cutoff);
    const float radians = kPi / 180.0f;
    light.cutoff = cutoff * radians;
    light.cos_cutoff = std::cos(light.cutoff);
    light.cos_beam = std::cos(beam * radians);
    light.inverse_transition = beam < cutoff ? 1.0f / (light.cutoff - beam * radians) : 0.0f;
    light.tan_x = light.tan_y = std::tan(light.cutoff);
    const int factor = this->texture(params, "texture", TextureRole::radiance);
    if (factor >= 0) {
      const Texture& t = scene_.textures[static_cast<std::size_t>(factor)];
      if (t.kind == Texture::Kind::constant) light.intensity *= t.color0;
      else light.texture = factor;
    }
  }
  light.sampling_weight = sampling_weight(params);
  light.through_masks = params.get_bool("through_masks", false);
  params.finish();
  scene_.delta_lights.push_back(light);
}

// The picture's size is known once it is loaded.
void SceneBuilder::aim_projectors() {
  for (const Projector& p : projectors_) {
    DeltaLight& light = scene_.delta_lights[p.light];
    Camera camera;
    camera.fov_degrees = p.fov_degrees;
    camera.fov_axis = p.fov_axis;
    int width = 1, height = 1;
    if (light.texture >= 0) {
      const Texture& t = scene_.textures[static_cast<std::size_t>(light.texture)];
      if (t.kind == Texture::Kind::bitmap) width = t.width, height = t.height;
    }
    const CameraView view = camera.view(width, height);
    light.tan_x = view.tan_x;
    light.tan_y = view.tan_y;
  }
}

float SceneBuilder::sampling_weight(Params& params) {
  constexpr float kLargest = 1e6f;
  const bool given = params.given("sampling_weight");
  const float weight = params.float_in("sampling_weight", 1.0f, 0.0f, kLargest);  // messages name what was asked for
  return given ? weight : kNoSamplingWeight;
}

void SceneBuilder::add_environment(Params& params) {
  if (!scene_.environments.empty()) fail(params.location(), "the scene has a second environment emitter");
  scene_.environments.emplace_back();
  Environment& environment = scene_.environments.back();
  if (params.type() == "constant") {
    environment.width = environment.height = 1;
    const int radiance = texture_or(params, "radiance", TextureRole::radiance, 1.0f);
    const Texture& t = scene_.textures[static_cast<std::size_t>(radiance)];
    if (t.kind != Texture::Kind::constant)
      fail(params.where("radiance"), "the radiance of a constant emitter must be a constant");
    environment.pixels = {t.color0};
    params.ignore({"to_world"});
  } else {
    BitmapJob job;
    const std::string file = params.required_string("filename");
    job.where = params.where("filename");
    job.built = description_.built_picture(file);
    job.path = job.built ? file : description_.resolve(file, job.where);
    job.scale = params.get_float("scale", 1.0f);
    job.roles = {TextureRole::radiance};
    if (!(job.scale >= 0.0f)) fail(params.where("scale"), "the scale of an envmap must not be negative");
    bitmaps_.push_back(job);
    const Transform to_world = params.get_transform("to_world");
    // Scales that are the same along all axes change no direction.
    const double l = length(to_world.column(0));
    bool alike = l > 0.0;
    for (int i = 0; i < 3; ++i) {
      const Vec3d a = to_world.column(i), b = to_world.column((i + 1) % 3);
      alike = alike && std::fabs(dot(a, b)) < 1e-3 * length(a) * length(b) &&
              std::fabs(length(a) - length(b)) < 1e-3 * length(a);
    }
    const double scale = std::max({l, length(to_world.column(1)), length(to_world.column(2))});
    if (!alike && to_world.is_singular(1e-6))
      fail(params.where("to_world"), "to_world of an envmap is singular: it flattens the sky");
    for (int i = 0; i < 3; ++i) {
      const Vec3d a = to_world.column(i) / (alike ? length(to_world.column(i)) : scale);
      for (int row = 0; row < 3; ++row) environment.to_world[row * 3 + i] = static_cast<float>(a[row]);
    }
  }
  environment.sampling_weight = sampling_weight(params);
  if (params.type() == "envmap") params.ignore({"mis_compensation"});  // of how directions are drawn
  params.finish();
}

}  // namespace octrad
