#include "octrad/scene/load.h"

#include <algorithm>
#include <cmath>
#include <exception>

#include "octrad/base/error.h"
#include "octrad/base/join.h"
#include "octrad/base/memory_limit.h"
#include "octrad/base/threads.h"
#include "octrad/scene/builder.h"
#include "octrad/scene/fingerprint.h"

namespace octrad {
namespace {

const std::vector<std::string> kSceneTags = {"integrator", "sensor", "bsdf", "texture", "shape", "emitter"};
constexpr int kMaxFilmSide = 131072;

}  // namespace

Scene SceneBuilder::build() {
  Material standard;
  standard.id = "(default)";
  standard.reflectance = constant_texture(Vec3f(0.5f));
  scene_.materials.push_back(standard);
  const Element& root = *description_.root;
  for (const auto& child : root.children) {
    const Element& element = follow_reference(description_, *child);
    if (element.tag == "shape") {
      add_shape(element);
    } else if (element.tag == "bsdf") {
      material(element);  // also when nothing uses it: mistakes are found now, not when it is first used
    } else if (element.tag == "sensor") {
      add_sensor(element);
    } else if (element.tag == "integrator") {
      add_integrator(element);
    } else if (element.tag == "emitter") {
      add_environment(element);
    } else if (element.tag == "texture") {
      if (element.find("id") == nullptr)
        fail(element.location, "a <texture> at the top level needs an id, to be referred to");
    } else {
      std::vector<std::string> known = kSceneTags;
      known.insert(known.end(), {"default", "include", "alias", "path", "ref"});
      fail(element.location, "unknown element <" + element.tag + "> at the top level" +
                                 did_you_mean(element.tag, known) + "; supported: " + join(known));
    }
  }
  if (scene_.cameras.empty()) fail(root.location, "the scene has no sensor; add <sensor type=\"perspective\">");
  if (scene_.shapes.empty()) fail(root.location, "the scene has no shape");
  load_files();
  for (const Shape& shape : scene_.shapes) {
    if (shape.kind == Shape::Kind::sphere) {
      const Sphere& s = scene_.spheres[static_cast<std::size_t>(shape.geometry)];
      scene_.bounds.extend(s.center - Vec3f(s.radius));
      scene_.bounds.extend(s.center + Vec3f(s.radius));
    } else {
      const TriangleMesh& mesh = scene_.meshes[static_cast<std::size_t>(shape.geometry)];
      for (const Vec3i& triangle : mesh.triangles) {
        for (int i = 0; i < 3; ++i) scene_.bounds.extend(mesh.positions[static_cast<std::size_t>(triangle[i])]);
      }
    }
  }
  scene_.fingerprint = scene_fingerprint(scene_);
  return std::move(scene_);
}

void SceneBuilder::add_integrator(const Element& element) {
  Params params(description_, element, scene_.warnings);
  if (has_integrator_) fail(element.location, "the scene has a second integrator");
  has_integrator_ = true;
  scene_.max_depth = params.int_in("max_depth", -1, -1, 1 << 30);
  if (scene_.max_depth == 0) scene_.warnings.push_back(element.location.text() + ": max_depth 0 shows nothing");
  if (params.get_bool("hide_emitters", false)) {
    scene_.warnings.push_back(element.location.text() + ": hide_emitters is not supported; emitters are shown");
  }
  params.ignore_rest();  // the integrator is chosen on the command line
}

void SceneBuilder::add_sensor(const Element& element) {
  Params params(description_, element, scene_.warnings);
  if (params.type() != "perspective") {
    fail(element.location, "sensor \"" + params.type() + "\" is not supported" +
                               did_you_mean(params.type(), {"perspective"}) + "; supported: perspective");
  }
  const bool first = scene_.cameras.empty();
  Camera camera;
  const std::vector<const Element*> films = params.nested("film");
  if (films.size() > 1) fail(films[1]->location, "a sensor holds at most one film");
  if (films.empty()) {
    camera.film_width = scene_.film.width;
    camera.film_height = scene_.film.height;
    if (first) scene_.film.filter_radius = 4.0f * scene_.film.filter_stddev;
  } else {
    add_film(*films[0], camera, first);
  }
  for (const Element* sampler : params.nested("sampler")) Params(description_, *sampler, scene_.warnings).ignore_rest();

  const bool has_fov =
      element.children.end() != std::find_if(element.children.begin(), element.children.end(),
                                             [](const auto& child) { return child->get("name") == "fov"; });
  const std::string focal_length = params.get_string("focal_length", "");
  if (has_fov) {
    if (!focal_length.empty()) fail(params.where("focal_length"), "give either fov or focal_length");
    camera.fov_degrees = params.get_float("fov", 0.0f);
    if (!(camera.fov_degrees > 0.0f && camera.fov_degrees < 180.0f))
      fail(params.where("fov"), "fov must be above 0 and below 180 degrees");
    const std::vector<std::string> names = {"x", "y", "diagonal", "smaller", "larger"};
    const std::string axis = params.choice("fov_axis", "x", names);
    camera.fov_axis = static_cast<Camera::FovAxis>(std::find(names.begin(), names.end(), axis) - names.begin());
  } else {
    // Millimetres on 35 mm film (36 x 24), whose diagonal sees the field of view.
    std::string text = focal_length.empty() ? "50mm" : focal_length;
    if (text.size() > 2 && text.substr(text.size() - 2) == "mm") text.resize(text.size() - 2);
    const auto f = parse_numbers(text);
    if (!f || f->size() != 1 || !((*f)[0] > 0.0))
      fail(params.where("focal_length"), "focal_length \"" + focal_length + "\" is not a length such as 50mm");
    camera.fov_degrees = static_cast<float>(2.0 * std::atan(std::sqrt(36.0 * 36.0 + 24.0 * 24.0) / (2.0 * (*f)[0])) *
                                            180.0 / 3.14159265358979323846);
    camera.fov_axis = Camera::FovAxis::diagonal;
    params.ignore({"fov_axis"});
  }
  camera.near_clip = params.get_float("near_clip", 0.01f);
  camera.far_clip = params.get_float("far_clip", 10000.0f);
  if (!(camera.near_clip > 0.0f)) fail(params.where("near_clip"), "near_clip must be above 0");
  if (!(camera.far_clip > camera.near_clip)) fail(params.where("far_clip"), "far_clip must be greater than near_clip");
  camera.principal_point_offset = {params.float_in("principal_point_offset_x", 0.0f, -100.0f, 100.0f),
                                   params.float_in("principal_point_offset_y", 0.0f, -100.0f, 100.0f)};
  params.ignore({"focus_distance", "shutter_open", "shutter_close"});  // no motion, no lens: they change nothing

  const Transform to_world = params.get_transform("to_world");
  for (int i = 0; i < 3; ++i) {
    if (!(std::fabs(length(to_world.column(i)) - 1.0) < 1e-3) ||
        !(std::fabs(dot(to_world.column(i), to_world.column((i + 1) % 3))) < 1e-3)) {
      fail(params.where("to_world"), "to_world of a sensor must not scale or shear (it may mirror)");
    }
  }
  try {
    set_frame(camera, to_world);
    camera.view(1, 1);
  } catch (const InputError& error) {
    fail(params.where("to_world"), error.what());
  }
  params.finish();
  scene_.cameras.push_back(camera);
}

void SceneBuilder::add_film(const Element& element, Camera& camera, bool first) {
  Params params(description_, element, scene_.warnings);
  if (params.type() != "hdrfilm")
    fail(element.location, "film \"" + params.type() + "\" is not supported" +
                               did_you_mean(params.type(), {"hdrfilm"}) + "; supported: hdrfilm");
  Film film;
  film.width = params.int_in("width", film.width, 1, kMaxFilmSide);
  film.height = params.int_in("height", film.height, 1, kMaxFilmSide);
  if (params.int_in("crop_offset_x", 0, 0, kMaxFilmSide) != 0 ||
      params.int_in("crop_offset_y", 0, 0, kMaxFilmSide) != 0 ||
      params.int_in("crop_width", film.width, 1, kMaxFilmSide) != film.width ||
      params.int_in("crop_height", film.height, 1, kMaxFilmSide) != film.height) {
    fail(element.location, "a crop window in the scene file is not supported; crop when rendering (--crop)");
  }
  params.ignore({"file_format", "pixel_format", "component_format", "banner", "compensate", "sample_border",
                 "high_quality_edges"});
  const std::vector<const Element*> filters = params.nested("rfilter");
  if (filters.size() > 1) fail(filters[1]->location, "a film holds at most one rfilter");
  film.filter_radius = 4.0f * film.filter_stddev;
  if (!filters.empty()) {
    Params filter(description_, *filters[0], scene_.warnings);
    if (filter.type() == "box") {
      film.filter = Film::Filter::box;
      film.filter_radius = 0.5f;
    } else if (filter.type() == "tent") {
      film.filter = Film::Filter::tent;
      film.filter_radius = filter.float_in("radius", 1.0f, 1e-3f, 8.0f);
    } else if (filter.type() == "gaussian") {
      film.filter_stddev = filter.float_in("stddev", 0.5f, 1e-3f, 2.0f);
      film.filter_radius = 4.0f * film.filter_stddev;
    } else {
      const std::vector<std::string> known = {"box", "tent", "gaussian"};
      fail(filters[0]->location, "rfilter \"" + filter.type() + "\" is not supported" +
                                     did_you_mean(filter.type(), known) + "; supported: " + join(known));
    }
    filter.finish();
  }
  params.finish();
  camera.film_width = film.width;
  camera.film_height = film.height;
  if (first) scene_.film = film;
}

void SceneBuilder::add_environment(const Element& element) {
  Params params(description_, element, scene_.warnings);
  const std::string& type = params.type();
  if (type != "envmap" && type != "constant") {
    if (type == "area") fail(element.location, "an area emitter must stand inside a shape");
    fail(element.location, "emitter \"" + type + "\" is not supported" + did_you_mean(type, {"envmap", "constant"}) +
                               "; supported: envmap, constant, and area inside a shape");
  }
  if (!scene_.environments.empty()) fail(element.location, "the scene has a second environment emitter");
  scene_.environments.emplace_back();
  Environment& environment = scene_.environments.back();
  if (type == "constant") {
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
    job.path = description_.resolve(file, job.where);
    job.scale = params.get_float("scale", 1.0f);
    job.roles = {TextureRole::radiance};
    if (!(job.scale >= 0.0f)) fail(params.where("scale"), "the scale of an envmap must not be negative");
    bitmaps_.push_back(job);
    const Transform to_world = params.get_transform("to_world");
    for (int i = 0; i < 3; ++i) {
      const Vec3d a = to_world.column(i), b = to_world.column((i + 1) % 3);
      if (!(length(a) > 0.0) || !(std::fabs(dot(a, b)) < 1e-3 * length(a) * length(b)) ||
          !(std::fabs(length(a) - length(b)) < 1e-3 * length(a))) {
        fail(params.where("to_world"), "to_world of an envmap must be a rotation");
      }
      for (int row = 0; row < 3; ++row) environment.to_world[row * 3 + i] = static_cast<float>(a[row] / length(a));
    }
  }
  params.ignore({"sampling_weight"});
  params.finish();
}

void SceneBuilder::load_files() {
  // Large files first would balance better, but the order decides which of several errors is reported: keep it.
  const std::size_t jobs = bitmaps_.size() + mesh_jobs_.size();
  std::vector<std::exception_ptr> errors(jobs);
  parallel_for(jobs, [&](std::size_t i) {
    try {
      const MemoryScope scope;
      if (i < bitmaps_.size()) {
        load_bitmap(i);
        return;
      }
      MeshJob& job = mesh_jobs_[i - bitmaps_.size()];
      if (!job.path.empty()) job.raw = job.ply ? read_ply(job.path) : read_obj(job.path);
      // Normals as doubles, then as floats.
      if (!job.path.empty()) ask_memory(job.raw.positions.size() * (sizeof(Vec3d) + sizeof(Vec3f)), job.path);
      scene_.meshes[static_cast<std::size_t>(job.mesh)] = place_mesh(std::move(job.raw), job.to_world, job.options);
    } catch (...) {
      errors[i] = std::current_exception();
    }
  });
  for (std::size_t i = 0; i < jobs; ++i) {
    if (!errors[i]) continue;
    // Name also the object that refers to the file.
    const Location& where = i < bitmaps_.size() ? bitmaps_[i].where : mesh_jobs_[i - bitmaps_.size()].where;
    try {
      std::rethrow_exception(errors[i]);
    } catch (const Error& error) {
      const std::string message = error.what();
      const std::string prefix = where.text();
      if (message.rfind(prefix, 0) == 0) throw;
      if (error.code() == ExitCode::io) throw IoError(prefix + ": " + message);
      if (error.code() == ExitCode::out_of_memory) throw MemoryError(prefix + ": " + message);
      throw InputError(prefix + ": " + message);
    }
  }
}

Scene load_scene(const std::string& file, const LoadOptions& options) {
  const Description description = read_description(file, options.definitions);
  Scene scene = SceneBuilder(description).build();
  scene.file = file;
  scene.other_files = description.files;
  scene.warnings.insert(scene.warnings.begin(), description.warnings.begin(), description.warnings.end());
  return scene;
}

}  // namespace octrad
