#include <algorithm>
#include <cmath>
#include <numbers>

#include "octrad/base/error.h"
#include "octrad/base/join.h"
#include "octrad/scene/builder.h"
#include "octrad/scene/limits.h"
#include "octrad/scene/plugins.h"

namespace octrad {
namespace {

constexpr float kMaxFilterRadius = 8.0f;
const std::vector<std::string> kFilters = {"box", "tent", "gaussian", "mitchell", "catmullrom", "lanczos"};

// What can be written instead of sensors that there are not.
std::string sensor_advice(const std::string& type) {
  if (type == "batch") return "; give its sensors one by one at the top level";
  if (type == "distant" || type == "telecentric") return "; use orthographic";
  if (type == "perspective_rdist") return "; use perspective, which does not distort";
  if (type == "irradiancemeter" || type == "radiancemeter" || type == "mradiancemeter" || type == "fluencemeter")
    return "; octrad query gives values at points";
  return "";
}

// Whether the linear part only rotates and mirrors, and with `scaled` also scales its axes, each by its own factor.
bool keeps_angles(const Transform& t, bool scaled) {
  for (int i = 0; i < 3; ++i) {
    const Vec3d a = t.column(i), b = t.column((i + 1) % 3);
    const double l = length(a);
    if (!(l > 0.0) || (!scaled && !(std::fabs(l - 1.0) < 1e-3))) return false;
    if (!(std::fabs(dot(a, b)) < 1e-3 * l * length(b))) return false;
  }
  return t.is_affine();
}

}  // namespace

std::vector<std::string> sensor_types() { return camera_kind_names(); }
std::vector<std::string> film_types() { return {"hdrfilm"}; }
std::vector<std::string> rfilter_types() { return kFilters; }

void SceneBuilder::field_of_view(Params& params, float& degrees, Camera::FovAxis& fov_axis) {
  const std::string focal_length = params.get_string("focal_length", "");
  degrees = params.get_float("fov", 0.0f);
  if (params.given("fov")) {
    if (!focal_length.empty()) fail(params.where("focal_length"), "give either fov or focal_length");
    if (!(degrees > 0.0f && degrees < 180.0f)) fail(params.where("fov"), "fov must be above 0 and below 180 degrees");
    fov_axis = parse_fov_axis(params.choice("fov_axis", "x", fov_axis_names()));
    return;
  }
  // Millimetres on 35 mm film (36 x 24), whose diagonal sees the field of view.
  std::string text = focal_length.empty() ? "50mm" : focal_length;
  if (text.size() > 2 && text.substr(text.size() - 2) == "mm") text.resize(text.size() - 2);
  const auto f = parse_numbers(text);
  if (!f || f->size() != 1 || !((*f)[0] > 0.0))
    fail(params.where("focal_length"), "focal_length \"" + focal_length + "\" is not a length such as 50mm");
  degrees = static_cast<float>(2.0 * std::atan(std::sqrt(36.0 * 36.0 + 24.0 * 24.0) / (2.0 * (*f)[0])) * 180.0 /
                               std::numbers::pi);
  fov_axis = Camera::FovAxis::diagonal;
  params.ignore({"fov_axis"});
}

void SceneBuilder::add_sensor(const Element& element) {
  Params params(description_, element, scene_.warnings);
  const std::vector<std::string>& kinds = camera_kind_names();
  const auto kind = std::find(kinds.begin(), kinds.end(), params.type());
  if (kind == kinds.end()) {
    const std::string advice = sensor_advice(params.type());
    const auto& all = description_.root->children;
    const bool others = std::any_of(all.begin(), all.end(), [&](const auto& e) {
      return e->tag == "sensor" && std::find(kinds.begin(), kinds.end(), e->get("type")) != kinds.end();
    });
    if (advice.empty() || !others) params.fail_type(kinds, "", advice);
    report().assume(element.location, params.what() + " is left out beside the others" + advice);
    if (description_.understood) description_.understood->left_out.insert(&element);
    return;
  }
  Camera camera;
  camera.kind = static_cast<CameraKind>(kind - kinds.begin());
  const bool lens = camera.kind == CameraKind::thinlens, orthographic = camera.kind == CameraKind::orthographic;
  const std::vector<const Element*> films = params.nested("film");
  if (films.size() > 1) fail(films[1]->location, "a sensor holds at most one film");
  Film film;
  film.filter_radius = 4.0f * film.filter_stddev;
  if (!films.empty()) film = read_film(*films[0], camera);
  for (const Element* sampler : params.nested("sampler")) Params(description_, *sampler, scene_.warnings).ignore_rest();

  if (!orthographic) field_of_view(params, camera.fov_degrees, camera.fov_axis);
  camera.near_clip = params.get_float("near_clip", 0.01f);
  camera.far_clip = params.get_float("far_clip", 10000.0f);
  if (!(camera.near_clip > 0.0f)) fail(params.where("near_clip"), "near_clip must be above 0");
  if (!(camera.far_clip > camera.near_clip)) fail(params.where("far_clip"), "far_clip must be greater than near_clip");
  if (lens) {
    camera.aperture_radius = params.get_float("aperture_radius", 0.0f);
    if (!params.given("aperture_radius") || !(camera.aperture_radius >= 0.0f))
      fail(params.where("aperture_radius"), "a thinlens sensor needs an aperture_radius, not below 0");
    if (camera.aperture_radius > kLargestCoordinate)
      fail(params.where("aperture_radius"), "aperture_radius may be up to 1e9");
    camera.aperture_radius = std::max(camera.aperture_radius, 1e-7f);  // 0 is a pinhole, as in Mitsuba
    camera.focus_distance = params.get_float("focus_distance", camera.far_clip);
    if (!(camera.focus_distance > 0.0f)) fail(params.where("focus_distance"), "focus_distance must be above 0");
  } else if (!orthographic) {
    camera.principal_point_offset = {params.float_in("principal_point_offset_x", 0.0f, -100.0f, 100.0f),
                                     params.float_in("principal_point_offset_y", 0.0f, -100.0f, 100.0f)};
  }
  params.ignore({"focus_distance", "shutter_open", "shutter_close"});  // no motion, no lens: they change nothing

  const Transform to_world = params.get_transform("to_world");
  if (!keeps_angles(to_world, orthographic)) {
    fail(params.where("to_world"), orthographic ? "to_world of an orthographic sensor must not shear (it may scale)"
                                                : "to_world of a sensor must not scale or shear (it may mirror)");
  }
  if (orthographic) {
    camera.half_size = {static_cast<float>(length(to_world.column(0))), static_cast<float>(length(to_world.column(1)))};
    // As Mitsuba: the near plane is scaled, the distance between the planes is not.
    const float depth = camera.far_clip - camera.near_clip;
    camera.near_clip *= static_cast<float>(length(to_world.column(2)));
    camera.far_clip = camera.near_clip + depth;
  }
  try {
    set_frame(camera, to_world);
    camera.view(1, 1);
  } catch (const InputError& error) {
    fail(params.where("to_world"), error.what());
  }
  params.finish();
  if (films.empty()) {
    camera.film_width = film.width;
    camera.film_height = film.height;
  }
  if (scene_.cameras.empty()) scene_.film = film;
  scene_.films.push_back(film);
  scene_.cameras.push_back(camera);
}

Film SceneBuilder::read_film(const Element& element, Camera& camera) {
  Params params(description_, element, scene_.warnings);
  const bool known = params.type() == "hdrfilm";
  if (!known) report().assume(element.location, "film \"" + params.type() + "\" read as hdrfilm");
  Film film;
  const int width = params.int_in("width", film.width, 1, kMostFilmPixels),
            height = params.int_in("height", film.height, 1, kMostFilmPixels);
  const int x = params.int_in("crop_offset_x", 0, 0, kMostFilmPixels),
            y = params.int_in("crop_offset_y", 0, 0, kMostFilmPixels);
  film.width = params.int_in("crop_width", width, 1, kMostFilmPixels);
  film.height = params.int_in("crop_height", height, 1, kMostFilmPixels);
  if (x + film.width > width || y + film.height > height) {
    fail(element.location, "the crop window reaches beyond the film of " + std::to_string(width) + " x " +
                               std::to_string(height) + " pixels");
  }
  const Vec2f size{static_cast<float>(width), static_cast<float>(height)};
  camera.crop_offset = {static_cast<float>(x) / size.x, static_cast<float>(y) / size.y};
  camera.crop_size = {static_cast<float>(film.width) / size.x, static_cast<float>(film.height) / size.y};
  camera.film_width = film.width;
  camera.film_height = film.height;
  params.ignore({"file_format", "pixel_format", "component_format", "banner", "compensate", "sample_border",
                 "high_quality_edges"});
  const std::vector<const Element*> filters = params.nested("rfilter");
  if (filters.size() > 1 && known) fail(filters[1]->location, "a film holds at most one rfilter");
  film.filter_radius = 4.0f * film.filter_stddev;
  if (!filters.empty()) read_filter(*filters[0], film);
  if (!known) params.ignore_rest();
  params.finish();
  return film;
}

void SceneBuilder::read_filter(const Element& element, Film& film) {
  Params params(description_, element, scene_.warnings);
  const auto type = std::find(kFilters.begin(), kFilters.end(), params.type());
  if (type == kFilters.end()) params.fail_type(kFilters);
  film.filter = static_cast<Film::Filter>(type - kFilters.begin());
  switch (film.filter) {
    case Film::Filter::box: film.filter_radius = 0.5f; break;
    case Film::Filter::tent: film.filter_radius = params.float_in("radius", 1.0f, 1e-3f, kMaxFilterRadius); break;
    case Film::Filter::gaussian:
      film.filter_stddev = params.float_in("stddev", 0.5f, 1e-3f, 2.0f);
      film.filter_radius = 4.0f * film.filter_stddev;
      break;
    case Film::Filter::mitchell:
      film.filter_b = params.float_in("B", film.filter_b, 0.0f, 1.0f);
      film.filter_c = params.float_in("C", film.filter_c, 0.0f, 1.0f);
      film.filter_radius = 2.0f;
      break;
    case Film::Filter::catmullrom: film.filter_radius = 2.0f; break;
    case Film::Filter::lanczos:
      film.filter_radius = static_cast<float>(params.int_in("lobes", 3, 1, static_cast<int>(kMaxFilterRadius)));
      break;
  }
  params.finish();
}

}  // namespace octrad
