#include <memory>

#include "app/selftest/entries.h"
#include "octrad/scene/fingerprint.h"

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

// A shape that shines.
void add_light(Scene& scene, int shape, Vec3f radiance) {
  AreaLight light;
  light.shape = shape;
  light.radiance = add_texture(scene, radiance);
  scene.shapes[static_cast<std::size_t>(shape)].emitter = static_cast<int>(scene.area_lights.size());
  scene.area_lights.push_back(light);
}

int add_material(Scene& scene, const Material& material) {
  scene.materials.push_back(material);
  return static_cast<int>(scene.materials.size()) - 1;
}

int add_ball(Scene& scene, Vec3f center, float radius, int material) {
  Sphere sphere;
  sphere.center = center;
  sphere.radius = radius;
  scene.spheres.push_back(sphere);
  for (const float side : {-radius, radius}) scene.bounds.extend(center + Vec3f(side));
  return add_shape(scene, Shape::Kind::sphere, scene.spheres.size() - 1, material);
}

// With a camera. The CPU traverses the tree that devices traverse.
PreparedScene complete(Scene scene) {
  Camera camera = look_at({0, 0, 0.95f}, {0, -0.1f, 0}, {0, 1, 0}, 70.0f, Camera::FovAxis::x);
  camera.film_width = scene.film.width = 1024;
  camera.film_height = scene.film.height = 1024;
  scene.cameras.push_back(camera);
  scene.fingerprint = scene_fingerprint(scene);
  return PreparedScene(std::move(scene), PreparedScene::CpuTree::bvh8);
}

}  // namespace

PreparedScene built_in_room() {
  Scene scene;
  scene.file = "(built-in room)";
  const int white = add_diffuse(scene, {0.7f, 0.7f, 0.7f}), red = add_diffuse(scene, {0.6f, 0.1f, 0.1f}),
            green = add_diffuse(scene, {0.1f, 0.5f, 0.1f});
  add_wall(scene, {-1, -1, -1}, {0, 0, 2}, {2, 0, 0}, white);  // floor
  add_wall(scene, {-1, 1, -1}, {2, 0, 0}, {0, 0, 2}, white);   // ceiling
  add_wall(scene, {-1, -1, -1}, {2, 0, 0}, {0, 2, 0}, white);  // back
  add_wall(scene, {-1, -1, 1}, {0, 2, 0}, {2, 0, 0}, white);   // front, behind the camera
  add_wall(scene, {-1, -1, -1}, {0, 2, 0}, {0, 0, 2}, red);
  add_wall(scene, {1, -1, -1}, {0, 0, 2}, {0, 2, 0}, green);
  add_light(scene, add_wall(scene, {-0.3f, 0.98f, -0.3f}, {0.6f, 0, 0}, {0, 0, 0.6f}, white), Vec3f(10.0f));
  add_ball(scene, {-0.45f, -0.6f, -0.3f}, 0.4f, add_metal(scene, 0.1f));
  add_ball(scene, {0.45f, -0.65f, 0.1f}, 0.35f, add_metal(scene, 0.3f));
  return complete(std::move(scene));
}

PreparedScene varied_room() {
  Scene scene;
  scene.file = "(built-in varied room)";
  Material glossy, glass, mirror, curtain, one_sided;
  glossy.type = BsdfType::roughplastic;
  glossy.two_sided = true;
  glossy.reflectance = add_texture(scene, {0.5f, 0.2f, 0.1f});
  glossy.alpha_u = glossy.alpha_v = add_texture(scene, Vec3f(0.1f));
  glass.type = BsdfType::dielectric;
  mirror.type = BsdfType::conductor;
  curtain.two_sided = true;
  curtain.reflectance = add_texture(scene, Vec3f(0.3f));
  curtain.opacity = add_texture(scene, Vec3f(0.5f));
  one_sided.reflectance = add_texture(scene, {0.1f, 0.5f, 0.1f});
  const int white = add_diffuse(scene, Vec3f(0.7f));
  add_wall(scene, {-1, -1, -1}, {0, 0, 2}, {2, 0, 0}, add_material(scene, glossy));  // floor
  add_wall(scene, {-1, 1, -1}, {2, 0, 0}, {0, 0, 2}, white);                         // ceiling
  add_wall(scene, {-1, -1, -1}, {2, 0, 0}, {0, 2, 0}, white);                        // back; the front is open
  add_wall(scene, {-1, -1, -1}, {0, 2, 0}, {0, 0, 2}, add_diffuse(scene, {0.6f, 0.1f, 0.1f}));
  add_wall(scene, {1, -1, -1}, {0, 0, 2}, {0, 2, 0}, add_material(scene, one_sided));
  add_wall(scene, {-0.7f, -0.9f, 0.45f}, {0.9f, 0, 0}, {0, 0.9f, 0}, add_material(scene, curtain));
  add_light(scene, add_wall(scene, {-0.3f, 0.98f, -0.3f}, {0.6f, 0, 0}, {0, 0, 0.6f}, white), {10.0f, 9.0f, 7.0f});
  add_light(scene, add_ball(scene, {0.7f, -0.85f, 0.4f}, 0.1f, white), Vec3f(2.0f));
  add_ball(scene, {-0.5f, -0.6f, -0.1f}, 0.35f, add_material(scene, glass));
  add_ball(scene, {0.45f, -0.65f, -0.3f}, 0.35f, add_material(scene, mirror));
  add_ball(scene, {0.1f, -0.8f, 0.2f}, 0.2f, add_metal(scene, 0.2f));
  Environment sky;
  sky.width = 4;
  sky.height = 3;
  for (int i = 0; i < sky.width * sky.height; ++i)
    sky.pixels.push_back({0.1f + 0.05f * static_cast<float>(i % 5), 0.2f, 0.3f});
  scene.environments.push_back(sky);
  return complete(std::move(scene));
}

}  // namespace octrad::selftest
