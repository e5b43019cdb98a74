#include <algorithm>
#include <cmath>

#include "octrad/base/join.h"
#include "octrad/base/threads.h"
#include "octrad/scene/builder.h"
#include "octrad/scene/limits.h"
#include "octrad/scene/plugins.h"

namespace octrad {
namespace {

// What a small shape takes here and in the ray tracer, about: measured with a million cubes.
constexpr std::uint64_t kShapeBytes = 2500;
constexpr std::uint64_t kTriangleBytes = 200;  // and there, of the round shapes

const std::vector<std::string> kShapes = {"obj",        "ply",      "serialized", "rectangle",   "cube",
                                          "disk",       "sphere",   "cylinder",   "linearcurve", "bsplinecurve",
                                          "shapegroup", "instance", "merge"};

// Of Mitsuba's derivatives: pictures do not depend on it.
const std::string kSilhouette = "silhouette_sampling_weight";

constexpr double kLeastVolume = 1e-18;  // of Transform::is_singular()

Placement make_placement(const Transform& t) {
  Placement p;
  for (int i = 0; i < 12; ++i) p.to_world[i] = static_cast<float>(t.m[static_cast<std::size_t>(i)]);
  const std::array<double, 9> normals = t.normal_matrix();
  double largest = 0.0;
  for (const double n : normals) largest = std::max(largest, std::fabs(n));
  for (std::size_t i = 0; i < 9; ++i) p.normals[i] = static_cast<float>(normals[i] / largest);
  p.mirrors = t.determinant() < 0.0;
  return p;
}

bool is_curve(const std::string& type) { return type == "linearcurve" || type == "bsplinecurve"; }

// What can be written instead of shapes that there are not.
std::string shape_advice(const std::string& type) {
  if (type == "sdfgrid") return "; turn its surface into triangles and load them as ply";
  if (type == "hair") return "; write it as linearcurve: x y z radius a line, an empty line between fibres";
  if (type == "heightfield" || type == "deformable") return "; turn it into triangles and load them as ply";
  if (type == "ellipsoids" || type == "ellipsoidsmesh") return "; use instances of a mesh";
  return "";
}

}  // namespace

std::vector<std::string> shape_types() { return kShapes; }

void SceneBuilder::add_shape(const Element& element) {
  Params params(description_, element, scene_.warnings);
  if (params.type() == "shapegroup") {
    group(element);
    return;
  }
  if (params.type() == "instance") return add_instance(params);
  if (params.type() == "merge") {  // a remedy for many small shapes in Mitsuba: it changes nothing
    for (const Element* child : params.nested("shape")) add(*child, [&] { add_shape(*child); });
    return params.finish();
  }
  SphereJob sphere;
  Shape shape = read_shape(params, sphere, false);
  if (shape.emitter >= 0)
    scene_.area_lights[static_cast<std::size_t>(shape.emitter)].shape = static_cast<int>(scene_.shapes.size());
  if (shape.kind == Shape::Kind::sphere) add_sphere(std::move(shape), sphere, Transform(), false);
  else scene_.shapes.push_back(std::move(shape));
}

Shape SceneBuilder::read_shape(Params& params, SphereJob& sphere, bool in_group) {
  const std::string& type = params.type();
  if (std::find(kShapes.begin(), kShapes.end(), type) == kShapes.end()) {
    if (report().collects()) {  // what is wrong inside is listed too
      for (const Element* bsdf : params.nested("bsdf")) report().attempt(bsdf->location, [&] { add_object(*bsdf); });
    }
    params.fail_type(kShapes, shape_advice(type));
  }
  if (type == "shapegroup" || type == "instance" || type == "merge")
    fail(params.location(), "a shapegroup cannot hold another one, an instance or a merge");
  shape_meter_.add(kShapeBytes);
  attribute_uses_.clear();
  in_shape_ = true;
  Shape shape;
  shape.id = params.element().get("id");
  const std::vector<const Element*> emitters = params.nested("emitter");
  if (emitters.size() > 1) fail(emitters[1]->location, "a shape holds at most one emitter");
  if (in_group && !emitters.empty())
    fail(emitters[0]->location, "an emitter cannot stand in a shapegroup (nor can it in Mitsuba)");
  shape.material = shape_material(params, !emitters.empty());
  if (!emitters.empty()) {
    add(*emitters[0], [&] {
      Params emitter(description_, *emitters[0], scene_.warnings);
      if (emitter.type() != "area")
        fail(emitters[0]->location, "emitter \"" + emitter.type() + "\" cannot stand inside a shape; supported: area" +
                                        (emitter.type() == "directionalarea"
                                             ? ", which shines into all directions, and directional outside of shapes"
                                             : ""));
      AreaLight light;
      light.radiance = texture_or(emitter, "radiance", TextureRole::radiance, 1.0f);
      light.sampling_weight = sampling_weight(emitter);
      emitter.finish();
      shape.emitter = static_cast<int>(scene_.area_lights.size());
      scene_.area_lights.push_back(light);
    });
  }

  const Transform to_world = params.get_transform("to_world");
  if (to_world.is_singular(kLeastVolume))
    fail(params.where("to_world"), "to_world of " + params.what() + " is singular: it flattens the shape");
  const bool flip_normals = !is_curve(type) && params.get_bool("flip_normals", false);  // curves have no other side
  params.ignore({kSilhouette});
  in_shape_ = false;
  check_attribute_use(params.element(), type != "sphere");
  if (type == "sphere") {
    shape.kind = Shape::Kind::sphere;
    sphere.to_world = to_world;
    sphere.center = params.get_point("center", Vec3d(0.0));
    sphere.radius = params.get_float("radius", 1.0f);
    if (!(sphere.radius > 0.0f)) fail(params.where("radius"), "the radius of a sphere must be above 0");
    // A mirrored sphere is turned inside out (Mitsuba).
    sphere.flip_normals = flip_normals != (to_world.determinant() < 0.0);
    sphere.where = params.where("to_world");
  } else {
    MeshJob job;
    job.mesh = static_cast<int>(scene_.meshes.size());
    job.element = &params.element();
    job.to_world = to_world;
    job.options.flip_normals = flip_normals;
    job.where = params.location();
    read_mesh_source(params, job);
    job.attributes = attribute_uses_;
    shape.geometry = job.mesh;
    scene_.meshes.emplace_back();
    mesh_jobs_.push_back(std::move(job));
  }
  params.finish();
  return shape;
}

void SceneBuilder::read_mesh_source(Params& params, MeshJob& job) {
  using Format = MeshJob::Format;
  const std::string& type = params.type();
  if (type == "obj" || type == "ply" || type == "serialized") {
    job.format = type == "obj" ? Format::obj : type == "ply" ? Format::ply : Format::serialized;
    const std::string file = params.required_string("filename");
    job.where = params.where("filename");
    if (const RawMesh* built = description_.built_mesh(file)) {
      ask_memory(built->bytes(), job.where.text() + ": a mesh of the scene");
      job.raw = *built;
    } else {
      job.path = description_.resolve(file, job.where);
    }
    job.options.face_normals = params.get_bool("face_normals", false);
    if (job.format == Format::serialized) job.index = params.int_in("shape_index", 0, 0, 1 << 30);
    else job.options.flip_v = params.get_bool("flip_tex_coords", job.format == Format::obj);
  } else if (is_curve(type)) {
    job.curve = type == "linearcurve" ? CurveKind::linear : CurveKind::bspline;
    job.options.one_sided = true;
    const std::string file = params.required_string("filename");
    job.where = params.where("filename");
    job.built_curves = description_.built_curves(file);
    if (!job.built_curves) job.path = description_.resolve(file, job.where);
  } else if (type == "cylinder") {
    const Vec3d p0 = params.get_point("p0", Vec3d(0.0)), p1 = params.get_point("p1", Vec3d(0, 0, 1));
    const float radius = params.get_float("radius", 1.0f);
    if (!(radius > 0.0f)) fail(params.where("radius"), "the radius of a cylinder must be above 0");
    if (!(length(p1 - p0) > 0.0)) fail(params.where("p1"), "the ends p0 and p1 of a cylinder must differ");
    job.raw = make_cylinder(p0, p1, static_cast<double>(radius));
  } else {
    // Mitsuba's rectangle and disk are no meshes.
    if (type == "cube") job.options.face_normals = params.get_bool("face_normals", false);
    if (type == "rectangle") params.get_bool("face_normals", false);
    job.raw = type == "cube" ? make_cube() : type == "disk" ? make_disk() : make_rectangle();
  }
  if (!job.raw.triangles.empty()) shape_meter_.add(job.raw.triangles.size() * kTriangleBytes);
}

const SceneBuilder::Group& SceneBuilder::group(const Element& element) {
  const auto [at, inserted] = groups_.try_emplace(&element);
  Group& group = at->second;
  if (!inserted) return group;
  group_order_.push_back(&element);
  Params params(description_, element, scene_.warnings);
  for (const Element* child : params.nested("shape")) {
    add(*child, [&] {
      Params inner(description_, *child, scene_.warnings);
      SphereJob sphere;
      Shape shape = read_shape(inner, sphere, true);
      if (shape.kind == Shape::Kind::sphere) group.spheres.emplace_back(std::move(shape), sphere);
      else group.meshes.push_back(std::move(shape));
    });
  }
  params.ignore({kSilhouette, "to_world"});  // of the group: Mitsuba does not apply it either
  params.finish();
  return group;
}

void SceneBuilder::add_instance(Params& params) {
  const std::vector<const Element*> groups = params.nested("shape");
  if (groups.size() != 1 || groups[0]->get("type") != "shapegroup")
    fail(params.location(), "an instance holds one <ref> to a shapegroup");
  const Group& members = group(*groups[0]);
  const Transform to_world = params.get_transform("to_world");
  const Location where = params.where("to_world");
  if (to_world.is_singular(kLeastVolume)) fail(where, "to_world of an instance is singular: it flattens the shapes");
  params.ignore({kSilhouette});
  params.finish();
  shape_meter_.add((members.meshes.size() + members.spheres.size()) * kShapeBytes);
  const int placement = static_cast<int>(scene_.placements.size());
  for (Shape shape : members.meshes) {
    shape.placement = placement;
    scene_.shapes.push_back(std::move(shape));
  }
  if (!members.meshes.empty()) {
    scene_.placements.push_back(make_placement(to_world));
    placed_at_.push_back(where);
  }
  for (const auto& [shape, sphere] : members.spheres) {
    SphereJob placed = sphere;
    placed.where = where;
    add_sphere(shape, placed, to_world, true);
  }
}

// Of an instance the box around its mesh's box.
void SceneBuilder::find_bounds() {
  std::vector<Bounds3f> boxes(scene_.meshes.size());
  parallel_for(boxes.size(), [&](std::size_t i) {
    const TriangleMesh& mesh = scene_.meshes[i];
    for (const Vec3i& triangle : mesh.triangles) {
      for (int k = 0; k < 3; ++k) boxes[i].extend(mesh.positions[static_cast<std::size_t>(triangle[k])]);
    }
  });
  for (const Shape& shape : scene_.shapes) {
    const auto geometry = static_cast<std::size_t>(shape.geometry);
    if (shape.kind == Shape::Kind::sphere) {
      const Sphere& s = scene_.spheres[geometry];
      scene_.bounds.extend(s.center - Vec3f(s.radius));
      scene_.bounds.extend(s.center + Vec3f(s.radius));
      continue;
    }
    const Bounds3f& box = boxes[geometry];
    if (!(box.lower.x <= box.upper.x)) continue;
    for (int corner = 0; corner < 8; ++corner) {
      Vec3f p{(corner & 1 ? box.upper : box.lower).x, (corner & 2 ? box.upper : box.lower).y,
              (corner & 4 ? box.upper : box.lower).z};
      if (shape.placement >= 0) {
        const auto placement = static_cast<std::size_t>(shape.placement);
        p = scene_.placements[placement].point(p);
        if (!within(p, kLargestCoordinate))
          fail(placed_at_[placement], "the instance is too large or too far away: coordinates may be up to 1e9");
      }
      scene_.bounds.extend(p);
    }
  }
  // Rays are carried into instances, where their coordinates must stay in what the ray tracer takes.
  double reach = 0.0;
  const auto extend = [&](Vec3f p) {
    for (int c = 0; c < 3; ++c) reach = std::max(reach, std::fabs(static_cast<double>(p[c])));
  };
  if (!scene_.shapes.empty()) extend(scene_.bounds.lower), extend(scene_.bounds.upper);
  for (const Camera& camera : scene_.cameras) extend(camera.origin);
  for (std::size_t i = 0; i < scene_.placements.size(); ++i) {
    Transform t;
    for (std::size_t k = 0; k < 12; ++k) t.m[k] = static_cast<double>(scene_.placements[i].to_world[k]);
    double largest = 0.0, steepest = 0.0;
    const Transform inverse = t.inverse();
    for (int row = 0; row < 3; ++row) {
      double sum = std::fabs(inverse(row, 3));
      for (int column = 0; column < 3; ++column) steepest = std::max(steepest, std::fabs(inverse(row, column)));
      for (int column = 0; column < 3; ++column) sum += std::fabs(inverse(row, column)) * reach;
      largest = std::max(largest, sum);
    }
    if (!(largest <= kLargestRayOrigin && steepest >= kLeastRayDirection && steepest <= 1.0 / kLeastRayDirection))
      fail(placed_at_[i], "to_world of the instance scales by too much or too little for the ray tracer");
  }
}

int SceneBuilder::shape_material(Params& params, bool emits) {
  const std::vector<const Element*> bsdfs = params.nested("bsdf");
  if (bsdfs.size() > 1)
    fail(bsdfs[1]->location, std::string("a shape holds at most one bsdf") +
                                 (params.element().old && params.type() == "obj"
                                      ? "; Mitsuba 0.6 gave them to the usemtl groups of the file: split it"
                                      : ""));
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

void SceneBuilder::add_sphere(Shape shape, const SphereJob& job, const Transform& placement, bool shape_in_group) {
  Sphere sphere;
  const Transform to_world = placement * job.to_world;
  const Vec3d axes[3] = {to_world.column(0), to_world.column(1), to_world.column(2)};
  const double scale = length(axes[0]);
  bool alike = true, orthogonal = true;
  for (int i = 0; i < 3; ++i) {
    const Vec3d next = axes[(i + 1) % 3];
    alike = alike && std::fabs(length(axes[i]) - scale) <= 1e-3 * scale;
    orthogonal = orthogonal && std::fabs(dot(axes[i], next)) <= 1e-3 * length(axes[i]) * length(next);
  }
  // Mitsuba's sphere takes the first axis's scale for all; an instance of one becomes an ellipsoid there.
  if (!orthogonal || (!alike && shape_in_group))
    fail(job.where, "to_world of a sphere must rotate, move and scale all axes alike; use a mesh for an ellipsoid");
  if (!alike)
    report().assume(job.where,
                    "a sphere whose to_world scales its axes differently has the first one's scale, as in Mitsuba");
  sphere.center = Vec3f(to_world.point(job.center));
  sphere.radius = static_cast<float>(scale * static_cast<double>(job.radius));
  if (!within(sphere.center - Vec3f(sphere.radius), kLargestCoordinate) ||
      !within(sphere.center + Vec3f(sphere.radius), kLargestCoordinate))
    fail(job.where, "the sphere is too large or too far away: coordinates may be up to 1e9");
  sphere.flip_normals = job.flip_normals;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      sphere.to_local[row * 3 + column] = static_cast<float>(axes[row][column] / (alike ? scale : length(axes[row])));
  }
  shape.geometry = static_cast<int>(scene_.spheres.size());
  scene_.spheres.push_back(sphere);
  scene_.shapes.push_back(std::move(shape));
}

}  // namespace octrad
