// Scenes made in memory, for tests, benchmarks and checks of devices.
#pragma once

#include <cstdint>

#include "octrad/scene/scene.h"

namespace octrad::testing {

// Adds to `scene`, and returns the index of what it added.
struct SceneMaker {
  Scene scene;

  int texture(Vec3f color);
  int texture(float value) { return texture(Vec3f(value)); }
  int texture(const Texture& t);
  int material(const Material& m);
  int diffuse(Vec3f reflectance, bool two_sided = false);
  // Sets the extra parameters of a principled model to `value`, its index to 1.5.
  void principled(Material& m, int value);
  // Sets the parameters of hair, both roughnesses to `roughness`.
  void hair(Material& m, float roughness);
  // Makes it a measured material, of measured_sample_file(part).
  void measured(Material& m, int part = 0);
  int rough_metal(float alpha);
  int shape(Shape::Kind kind, std::size_t geometry, int material_index, Vec3f emission);
  // Parallelogram p0, p0 + a, p0 + a + b, p0 + b; normal along a x b.
  int quad(Vec3f p0, Vec3f a, Vec3f b, int material_index, Vec3f emission = Vec3f(0.0f));
  int sphere(Vec3f center, float radius, int material_index, Vec3f emission = Vec3f(0.0f), bool flip = false);
  // Horizontal field of view in degrees.
  void camera(Vec3f origin, Vec3f target, float field_of_view, int width, int height);
};

struct OpenRoom {
  bool environment = true;
  bool lamps = true;
  bool shapes = true;  // false: the sky and the camera alone
};

// Open to a sky of several colours, with a glossy floor, a one-sided wall, glass, a mirror, rough metal, two lamps and
// a curtain that lets half of the light pass. The camera stands before it; its pictures are 24 x 18.
Scene open_room(const OpenRoom& options = {});
// The closed box [-1, 1]^3 with a lamp, coloured walls and two balls of rough metal, the camera inside it.
Scene closed_room();
// Textures, wrappers, scattering models and lights of every kind.
Scene every_material();
// A closed room full of small triangles and spheres, without materials and lights.
Scene triangle_soup(std::uint64_t seed);

}  // namespace octrad::testing
