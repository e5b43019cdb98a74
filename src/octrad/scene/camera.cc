#include "octrad/scene/camera.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <tuple>

#include "octrad/base/error.h"
#include "octrad/base/join.h"
#include "octrad/base/json_file.h"
#include "octrad/base/number_text.h"
#include "octrad/scene/camera_json.h"
#include "octrad/scene/limits.h"
#include "octrad/scene/transform.h"

namespace octrad {

const std::vector<std::string>& camera_kind_names() {
  static const std::vector<std::string> names = {"perspective", "thinlens", "orthographic"};
  return names;
}

void set_frame(Camera& camera, const Transform& to_world) {
  if (!within(to_world.column(3), kLargestCameraCoordinate))
    throw InputError("the camera is too far away: its coordinates may be up to 1e12");
  camera.origin = Vec3f(to_world.column(3));
  camera.right = Vec3f(-normalize(to_world.column(0)));
  camera.up = Vec3f(normalize(to_world.column(1)));
  camera.forward = Vec3f(normalize(to_world.column(2)));
}

std::vector<double> read_array(const nlohmann::json& object, const std::string& key, std::size_t count,
                               const std::string& where) {
  const nlohmann::json value = object.value(key, nlohmann::json());
  std::vector<double> numbers;
  if (value.is_array() && value.size() == count) {
    for (const nlohmann::json& item : value) {
      if (item.is_number() && std::isfinite(item.get<double>())) numbers.push_back(item.get<double>());
    }
  }
  if (numbers.size() != count)
    throw InputError(where + "\"" + key + "\" must be a list of " + std::to_string(count) + " finite numbers");
  return numbers;
}

double read_number(const nlohmann::json& object, const std::string& key, double fallback, double lower, double upper,
                   const std::string& where) {
  if (!object.contains(key)) return fallback;
  const nlohmann::json& value = object.at(key);
  if (!value.is_number() || !(value.get<double>() >= lower && value.get<double>() <= upper)) {
    throw InputError(where + "\"" + key + "\" must be a number between " + number_text(lower) + " and " +
                     number_text(upper));
  }
  return value.get<double>();
}

int read_integer(const nlohmann::json& object, const std::string& key, int fallback, int lower, int upper,
                 const std::string& where) {
  if (!object.contains(key)) return fallback;
  return static_cast<int>(whole_number(object.at(key), lower, upper, where + "\"" + key + "\""));
}

Camera read_camera(const nlohmann::json& object, const std::string& where) {
  if (!object.is_object())
    throw InputError(where + "must be an object such as {\"origin\": [0,1,4], \"target\": [0,1,0], \"fov\": 40}");
  const std::vector<std::string> keys = {
      "origin",         "target",     "up",       "to_world", "fov",  "fov_axis",
      "near_clip",      "far_clip",   "width",    "height",   "type", "aperture_radius",
      "focus_distance", "view_width", "mirrored", "name"};
  for (const auto& [key, value] : object.items()) {
    if (std::find(keys.begin(), keys.end(), key) == keys.end()) {
      throw InputError(where + "unknown key \"" + key + "\"" + did_you_mean(key, keys) + "; supported: " + join(keys));
    }
  }
  Camera camera;
  const auto place = [&](const Transform& t) {
    try {
      set_frame(camera, t);
    } catch (const InputError& error) {
      throw InputError(where + error.what());
    }
  };
  if (object.contains("to_world")) {
    if (object.contains("origin") || object.contains("target") || object.contains("up"))
      throw InputError(where + "give either \"to_world\" or \"origin\" and \"target\"");
    if (object.contains("mirrored")) throw InputError(where + "\"to_world\" says by itself whether it mirrors");
    const std::vector<double> numbers = read_array(object, "to_world", 16, where);
    Transform t;
    std::copy(numbers.begin(), numbers.end(), t.m.begin());
    bool rigid = t.is_affine();
    for (int i = 0; i < 3; ++i) {
      rigid = rigid && std::fabs(length(t.column(i)) - 1.0) < 1e-3 &&
              std::fabs(dot(t.column(i), t.column((i + 1) % 3))) < 1e-3;
    }
    if (!rigid) throw InputError(where + "\"to_world\" must not scale or shear, and its last row must be 0 0 0 1");
    place(t);
  } else {
    if (!object.contains("origin") || !object.contains("target"))
      throw InputError(where + "needs \"origin\" and \"target\", or \"to_world\"");
    const std::vector<double> o = read_array(object, "origin", 3, where), at = read_array(object, "target", 3, where);
    const std::vector<double> up =
        object.contains("up") ? read_array(object, "up", 3, where) : std::vector<double>{0, 1, 0};
    const auto t = Transform::look_at({o[0], o[1], o[2]}, {at[0], at[1], at[2]}, {up[0], up[1], up[2]});
    if (!t)
      throw InputError(where + "origin, target and up define no view (equal points, or up along the view direction)");
    place(*t);
    if (object.contains("mirrored")) {
      const nlohmann::json& mirrored = object.at("mirrored");
      if (!mirrored.is_boolean()) throw InputError(where + "\"mirrored\" must be true or false");
      camera.set_mirrored(mirrored.get<bool>());
    }
  }
  if (object.contains("type")) {
    const nlohmann::json& type = object.at("type");
    const std::vector<std::string>& kinds = camera_kind_names();
    const auto found = std::find(kinds.begin(), kinds.end(), type.is_string() ? type.get<std::string>() : "");
    if (found == kinds.end()) throw InputError(where + "\"type\" must be a string: " + join(kinds));
    camera.kind = static_cast<CameraKind>(found - kinds.begin());
  }
  const bool orthographic = camera.kind == CameraKind::orthographic, lens = camera.kind == CameraKind::thinlens;
  for (const auto& [key, belongs, owner] : {std::tuple{"fov", !orthographic, "perspective and thinlens"},
                                            {"fov_axis", !orthographic, "perspective and thinlens"},
                                            {"aperture_radius", lens, "thinlens"},
                                            {"focus_distance", lens, "thinlens"},
                                            {"view_width", orthographic, "orthographic"}}) {
    if (!belongs && object.contains(key))
      throw InputError(where + "\"" + key + "\" belongs to cameras of type " + owner);
  }
  if (lens) {
    for (const char* key : {"aperture_radius", "focus_distance"}) {
      if (!object.contains(key)) throw InputError(where + "a thinlens camera needs \"" + key + "\"");
    }
    camera.aperture_radius = static_cast<float>(read_number(object, "aperture_radius", 0.0, 1e-9, 1e9, where));
    camera.focus_distance = static_cast<float>(read_number(object, "focus_distance", 0.0, 1e-9, 1e12, where));
  }
  if (orthographic) {
    if (!object.contains("view_width")) throw InputError(where + "an orthographic camera needs \"view_width\"");
    const double view_width = read_number(object, "view_width", 0.0, 1e-9, 1e9, where);
    camera.half_size.x = camera.half_size.y = static_cast<float>(0.5 * view_width);
  }
  camera.fov_degrees = static_cast<float>(read_number(object, "fov", camera.fov_degrees, 1e-3, 179.999, where));
  if (object.contains("fov_axis")) {
    if (!object.at("fov_axis").is_string())
      throw InputError(where + "\"fov_axis\" must be a string: " + join(fov_axis_names()));
    try {
      camera.fov_axis = parse_fov_axis(object.at("fov_axis").get<std::string>());
    } catch (const InputError& error) {
      throw InputError(where + error.what());
    }
  }
  camera.near_clip = static_cast<float>(read_number(object, "near_clip", camera.near_clip, 1e-12, 1e12, where));
  camera.far_clip = static_cast<float>(read_number(object, "far_clip", camera.far_clip, 1e-12, 1e30, where));
  if (!(camera.far_clip > camera.near_clip))
    throw InputError(where + "\"far_clip\" must be greater than \"near_clip\"");
  camera.film_width = read_integer(object, "width", 0, 1, kMostFilmPixels, where);
  camera.film_height = read_integer(object, "height", 0, 1, kMostFilmPixels, where);
  return camera;
}

CameraView Camera::own_view() const { return view(std::max(1, film_width), std::max(1, film_height)); }

CameraView Camera::view(int width, int height) const {
  // Of the whole film.
  const float aspect = static_cast<float>(width) / crop_size.x / (static_cast<float>(height) / crop_size.y);
  float tan_x = std::tan(fov_degrees * (0.5f * kPi / 180.0f));
  bool along_y = fov_axis == FovAxis::y;
  if (fov_axis == FovAxis::smaller) along_y = aspect > 1.0f;
  if (fov_axis == FovAxis::larger) along_y = aspect < 1.0f;
  if (along_y) tan_x *= aspect;
  if (fov_axis == FovAxis::diagonal) tan_x /= std::sqrt(1.0f + 1.0f / (aspect * aspect));
  CameraView view;
  view.kind = kind;
  view.origin = origin;
  view.right = right;
  view.up = up;
  view.forward = forward;
  view.window_offset = crop_offset + principal_point_offset;
  view.window_scale = crop_size;
  view.tan_x = tan_x;
  view.tan_y = tan_x / aspect;
  view.near_clip = near_clip;
  view.depth = far_clip - near_clip;
  view.aperture_radius = aperture_radius;
  view.focus_distance = focus_distance;
  view.width = width;
  view.height = height;
  if (kind == CameraKind::orthographic) {
    view.tan_x = half_size.x;
    view.tan_y = half_size.y / aspect;
  }
  for (const float x : {0.0f, 1.0f}) {
    for (const float y : {0.0f, 1.0f}) {
      const Vec2f corner{x * static_cast<float>(width), y * static_cast<float>(height)};
      if (!within(camera_ray(view, corner).origin, kLargestCameraCoordinate))
        throw InputError("the camera's near clipping plane is too far away: rays must begin within 1e12 of the origin");
    }
  }
  return view;
}

Camera look_at(Vec3f origin, Vec3f target, Vec3f up, float fov_degrees, Camera::FovAxis axis) {
  if (!is_finite(origin) || !is_finite(target))
    throw InputError("the camera, or what it looks at, is too far away: its coordinates may be up to 1e12");
  const auto t = Transform::look_at(Vec3d(origin), Vec3d(target), Vec3d(up));
  if (!t)
    throw InputError(
        "the camera's origin, target and up define no view (equal points, or up along the view direction)");
  if (!(fov_degrees > 0.0f && fov_degrees < 180.0f))
    throw InputError("the camera's field of view must be above 0 and below 180 degrees");
  Camera camera;
  set_frame(camera, *t);
  camera.fov_degrees = fov_degrees;
  camera.fov_axis = axis;
  return camera;
}

const std::vector<std::string>& fov_axis_names() {
  static const std::vector<std::string> names = {"x", "y", "diagonal", "smaller", "larger"};
  return names;
}

Camera::FovAxis parse_fov_axis(const std::string& name) {
  const std::vector<std::string>& names = fov_axis_names();
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end())
    throw InputError("unknown fov axis \"" + name + "\"" + did_you_mean(name, names) + "; supported: " + join(names));
  return static_cast<Camera::FovAxis>(found - names.begin());
}

std::vector<Camera> read_cameras(const std::string& json_file) {
  nlohmann::json document = read_json_file(json_file);
  if (document.is_object()) document = nlohmann::json::array({document});
  if (!document.is_array() || document.empty())
    throw InputError(json_file + ": expected a camera or a list of cameras");
  std::vector<Camera> cameras;
  for (std::size_t i = 0; i < document.size(); ++i) {
    cameras.push_back(read_camera(document[i], json_file + ": camera " + std::to_string(i + 1) + ": "));
  }
  return cameras;
}

Vec2i picture_size(int film_width, int film_height, int width, int height) {
  const auto scaled = [](int length, int from, int to) {
    return static_cast<int>(
        std::max(1.0, std::round(static_cast<double>(length) * static_cast<double>(to) / static_cast<double>(from))));
  };
  if (width > 0 && height > 0) return {width, height};
  if (width > 0) return {width, scaled(width, film_width, film_height)};
  if (height > 0) return {scaled(height, film_height, film_width), height};
  return {film_width, film_height};
}

}  // namespace octrad
