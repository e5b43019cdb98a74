#include <memory>

#include "app/selftest/entries.h"
#include "scene/fingerprint.h"

namespace octrad::selftest {
namespace {

int add_texture(Scene& scene, Vec3f color) {
  Texture texture;
  texture.color0 = color;
  scene.textures.push_back(texture);
  return static_cast<int>(scene.textures.size()) - 1;
}

int add_diffuse(Scene& scene, Vec3f reflectance) {
  Material material;
  material.two_sided = true;
  material.reflectance = add_texture(scene, reflectance);
  scene.materials.push_back(material);
  return static_cast<int>(scene.materials.size()) - 1;
}

int add_metal(Scene& scene, float alpha) {
  Material material;
  material.type = BsdfType::roughconductor;
  material.alpha_u = material.alpha_v = add_texture(scene, Vec3f(alpha));
  scene.materials.push_back(material);
  return static_cast<int>(scene.materials.size()) - 1;
}

int add_shape(Scene& scene, Shape::Kind kind, std::size_t geometry, int material) {
  Shape shape;
  shape.kind = kind;
  shape.geometry = static_cast<int>(geometry);
  shape.material = material;
  scene.shapes.push_back(shape);
  return static_cast<int>(scene.shapes.size()) - 1;
}

// Parallelogram with the normal along a x b.
int add_wall(Scene& scene, Vec3f corner, Vec3f a, Vec3f b, int material) {
  TriangleMesh mesh;
  mesh.positions = {corner, corner + a, corner + a + b, corner + b};
  mesh.uvs = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  for (const Vec3f p : mesh.positions) scene.bounds.extend(p);
  scene.meshes.push_back(mesh);
  return add_shape(scene, Shape::Kind::mesh, scene.meshes.size() - 1, material);
}

void add_ball(Scene& scene, Vec3f center, float radius, int material) {
  Sphere sphere;
  sphere.center = center;
  sphere.radius = radius;
  scene.spheres.push_back(sphere);
  add_shape(scene, Shape::Kind::sphere, scene.spheres.size() - 1, material);
}

}  // namespace

cli::LoadedScene built_in_room() {
  cli::LoadedScene room;
  room.scene = std::make_unique<Scene>();
  Scene& scene = *room.scene;
  scene.file = "(built-in room)";
  const int white = add_diffuse(scene, {0.7f, 0.7f, 0.7f}), red = add_diffuse(scene, {0.6f, 0.1f, 0.1f}), green = add_diffuse(scene, {0.1f, 0.5f, 0.1f});
  add_wall(scene, {-1, -1, -1}, {0, 0, 2}, {2, 0, 0}, white);     // floor
  add_wall(scene, {-1, 1, -1}, {2, 0, 0}, {0, 0, 2}, white);      // ceiling
  add_wall(scene, {-1, -1, -1}, {2, 0, 0}, {0, 2, 0}, white);     // back
  add_wall(scene, {-1, -1, 1}, {0, 2, 0}, {2, 0, 0}, white);      // front, behind the camera
  add_wall(scene, {-1, -1, -1}, {0, 2, 0}, {0, 0, 2}, red);
  add_wall(scene, {1, -1, -1}, {0, 0, 2}, {0, 2, 0}, green);
  const int lamp = add_wall(scene, {-0.3f, 0.98f, -0.3f}, {0.6f, 0, 0}, {0, 0, 0.6f}, white);
  AreaLight light;
  light.shape = lamp;
  light.radiance = add_texture(scene, Vec3f(10.0f));
  scene.area_lights.push_back(light);
  scene.shapes[static_cast<std::size_t>(lamp)].emitter = 0;
  add_ball(scene, {-0.45f, -0.6f, -0.3f}, 0.4f, add_metal(scene, 0.1f));
  add_ball(scene, {0.45f, -0.65f, 0.1f}, 0.35f, add_metal(scene, 0.3f));

  Camera camera = look_at({0, 0, 0.95f}, {0, -0.1f, 0}, {0, 1, 0}, 70.0f, Camera::FovAxis::x);
  camera.film_width = scene.film.width = 1024;
  camera.film_height = scene.film.height = 1024;
  scene.cameras.push_back(camera);
  scene.fingerprint = scene_fingerprint(scene);
  room.tracer = make_embree_tracer(scene);
  room.materials = std::make_unique<Materials>(scene);
  room.lights = std::make_unique<Lights>(scene);
  return room;
}

}  // namespace octrad::selftest
