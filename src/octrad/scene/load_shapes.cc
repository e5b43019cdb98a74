#include <algorithm>
#include <cmath>

#include "octrad/base/error.h"
#include "octrad/base/join.h"
#include "octrad/scene/builder.h"
#include "octrad/scene/limits.h"
#include "octrad/scene/plugins.h"

namespace octrad {
namespace {

// What a small shape takes here and in the ray tracer, about: measured with a million cubes.
constexpr std::uint64_t kShapeBytes = 2500;

const std::vector<std::string> kShapes = {"obj", "ply", "rectangle", "cube", "sphere"};

}  // namespace

std::vector<std::string> shape_types() { return kShapes; }

void SceneBuilder::add_shape(const Element& element) {
  Params params(description_, element, scene_.warnings);
  const std::string& type = params.type();
  if (std::find(kShapes.begin(), kShapes.end(), type) == kShapes.end()) {
    fail(element.location,
         "shape \"" + type + "\" is not supported" + did_you_mean(type, kShapes) + "; supported: " + join(kShapes));
  }
  shape_meter_.add(kShapeBytes);
  attribute_uses_.clear();
  in_shape_ = true;
  Shape shape;
  shape.id = element.get("id");
  const std::vector<const Element*> emitters = params.nested("emitter");
  if (emitters.size() > 1) fail(emitters[1]->location, "a shape holds at most one emitter");
  shape.material = shape_material(params, !emitters.empty());
  const int shape_index = static_cast<int>(scene_.shapes.size());
  if (!emitters.empty()) {
    add(*emitters[0], [&] {
      Params emitter(description_, *emitters[0], scene_.warnings);
      if (emitter.type() != "area")
        fail(emitters[0]->location, "emitter \"" + emitter.type() + "\" cannot stand inside a shape; supported: area");
      AreaLight light;
      light.shape = shape_index;
      light.radiance = texture_or(emitter, "radiance", TextureRole::radiance, 1.0f);
      emitter.ignore({"sampling_weight"});
      emitter.finish();
      shape.emitter = static_cast<int>(scene_.area_lights.size());
      scene_.area_lights.push_back(light);
    });
  }

  const Transform to_world = params.get_transform("to_world");
  const double scale = std::max({length(to_world.column(0)), length(to_world.column(1)), length(to_world.column(2))});
  if (!to_world.is_affine() || !(std::fabs(to_world.determinant()) > 1e-18 * scale * scale * scale)) {
    fail(params.where("to_world"), "to_world of " + params.what() + " is singular: it flattens the shape");
  }
  const bool flip_normals = params.get_bool("flip_normals", false);
  in_shape_ = false;
  check_attribute_use(element, type != "sphere");
  if (type == "sphere") {
    add_sphere(params, shape, to_world, flip_normals);
  } else {
    MeshJob job;
    job.mesh = static_cast<int>(scene_.meshes.size());
    job.to_world = to_world;
    job.options.flip_normals = flip_normals;
    job.where = element.location;
    if (type == "obj" || type == "ply") {
      const std::string file = params.required_string("filename");
      job.where = params.where("filename");
      job.path = description_.resolve(file, job.where);
      job.ply = type == "ply";
      job.options.face_normals = params.get_bool("face_normals", false);
      job.options.flip_v = params.get_bool("flip_tex_coords", type == "obj");
    } else {
      job.raw = type == "cube" ? make_cube() : make_rectangle();
    }
    job.attributes = attribute_uses_;
    shape.geometry = job.mesh;
    scene_.meshes.emplace_back();
    mesh_jobs_.push_back(std::move(job));
  }
  params.finish();
  scene_.shapes.push_back(std::move(shape));
}

int SceneBuilder::shape_material(Params& params, bool emits) {
  const std::vector<const Element*> bsdfs = params.nested("bsdf");
  if (bsdfs.size() > 1) fail(bsdfs[1]->location, "a shape holds at most one bsdf");
  if (!bsdfs.empty()) return material(*bsdfs[0]);
  if (!emits) return 0;
  // As in Mitsuba 3: a light without a bsdf reflects nothing.
  if (black_material_ < 0) {
    Material black;
    black.id = "(light)";
    black.reflectance = constant_texture(Vec3f(0.0f));
    black_material_ = static_cast<int>(scene_.materials.size());
    scene_.materials.push_back(black);
  }
  return black_material_;
}

void SceneBuilder::add_sphere(Params& params, Shape& shape, const Transform& to_world, bool flip_normals) {
  Sphere sphere;
  const Vec3d center = params.get_point("center", Vec3d(0.0));
  const float radius = params.get_float("radius", 1.0f);
  if (!(radius > 0.0f)) fail(params.where("radius"), "the radius of a sphere must be above 0");
  const Vec3d axes[3] = {to_world.column(0), to_world.column(1), to_world.column(2)};
  const double scale = length(axes[0]);
  for (int i = 0; i < 3; ++i) {
    if (std::fabs(length(axes[i]) - scale) > 1e-3 * scale ||
        std::fabs(dot(axes[i], axes[(i + 1) % 3])) > 1e-3 * scale * scale) {
      fail(params.where("to_world"),
           "to_world of a sphere must rotate, move and scale all axes alike; use a mesh for an ellipsoid");
    }
  }
  sphere.center = Vec3f(to_world.point(center));
  sphere.radius = static_cast<float>(scale * static_cast<double>(radius));
  if (!within(sphere.center - Vec3f(sphere.radius), kLargestCoordinate) ||
      !within(sphere.center + Vec3f(sphere.radius), kLargestCoordinate))
    fail(params.location(), "the sphere is too large or too far away: coordinates may be up to 1e9");
  sphere.flip_normals =
      flip_normals != (to_world.determinant() < 0.0);  // a mirrored sphere is turned inside out (Mitsuba)
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      sphere.to_local[row * 3 + column] = static_cast<float>(axes[row][column] / scale);
  }
  shape.kind = Shape::Kind::sphere;
  shape.geometry = static_cast<int>(scene_.spheres.size());
  scene_.spheres.push_back(sphere);
}

}  // namespace octrad
