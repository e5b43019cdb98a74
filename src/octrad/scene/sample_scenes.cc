#include "octrad/scene/sample_scenes.h"

#include <algorithm>
#include <cmath>

#include "octrad/base/rng.h"
#include "octrad/scene/fingerprint.h"
#include "octrad/scene/sample_measured.h"

namespace octrad::testing {
namespace {

int last(std::size_t size) { return static_cast<int>(size) - 1; }

}  // namespace

int SceneMaker::texture(const Texture& t) {
  scene.textures.push_back(t);
  return last(scene.textures.size());
}

int SceneMaker::texture(Vec3f color) {
  Texture t;
  t.color0 = color;
  return texture(t);
}

int SceneMaker::material(const Material& m) {
  scene.materials.push_back(m);
  return last(scene.materials.size());
}

int SceneMaker::diffuse(Vec3f reflectance, bool two_sided) {
  Material m;
  m.reflectance = texture(reflectance);
  m.two_sided = two_sided;
  return material(m);
}

void SceneMaker::hair(Material& m, float roughness) {
  m.specular_transmittance = texture(Vec3f(0.6f, 0.4f, 0.2f));
  m.extra[ExtraParameter::roughness] = m.extra[ExtraParameter::azimuthal_roughness] = texture(roughness);
  m.extra[ExtraParameter::scale_tilt] = texture(2.0f);
  m.int_ior = 1.55f;
  m.ext_ior = 1.0f;
}

void SceneMaker::principled(Material& m, int value) {
  using P = ExtraParameter;
  for (const int parameter : {P::roughness, P::metallic, P::anisotropic, P::spec_trans, P::spec_tint, P::sheen,
                              P::sheen_tint, P::flatness, P::clearcoat, P::clearcoat_gloss, P::diff_trans}) {
    m.extra[parameter] = value;
  }
  m.extra[P::eta] = texture(1.5f);
  for (int rate = P::main_specular_sampling_rate; rate <= P::diffuse_transmittance_sampling_rate; ++rate)
    m.extra[rate] = texture(1.0f);
  m.int_ior = 1.5f;
  m.ext_ior = 1.0f;
}

void SceneMaker::measured(Material& m, int part) {
  m.type = BsdfType::measured;
  m.specular_reflectance = -1;
  m.measured = last(scene.measured.size() + 1);
  scene.measured.push_back(parse_measured("sample", measured_sample_file(part)));
}

int SceneMaker::rough_metal(float alpha) {
  Material m;
  m.type = BsdfType::roughconductor;
  m.alpha_u = m.alpha_v = texture(alpha);
  return material(m);
}

int SceneMaker::shape(Shape::Kind kind, std::size_t geometry, int material_index, Vec3f emission) {
  Shape s;
  s.kind = kind;
  s.geometry = static_cast<int>(geometry);
  s.material = material_index;
  if (max_component(emission) > 0.0f) {
    AreaLight light;
    light.shape = static_cast<int>(scene.shapes.size());
    light.radiance = texture(emission);
    scene.area_lights.push_back(light);
    s.emitter = last(scene.area_lights.size());
  }
  scene.shapes.push_back(s);
  return last(scene.shapes.size());
}

int SceneMaker::quad(Vec3f p0, Vec3f a, Vec3f b, int material_index, Vec3f emission) {
  TriangleMesh m;
  m.positions = {p0, p0 + a, p0 + a + b, p0 + b};
  m.uvs = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  m.triangles = {{0, 1, 2}, {0, 2, 3}};
  for (const Vec3f p : m.positions) scene.bounds.extend(p);
  scene.meshes.push_back(m);
  return shape(Shape::Kind::mesh, scene.meshes.size() - 1, material_index, emission);
}

int SceneMaker::sphere(Vec3f center, float radius, int material_index, Vec3f emission, bool flip) {
  Sphere s;
  s.center = center;
  s.radius = radius;
  s.flip_normals = flip;
  scene.bounds.extend(center - Vec3f(radius));
  scene.bounds.extend(center + Vec3f(radius));
  scene.spheres.push_back(s);
  return shape(Shape::Kind::sphere, scene.spheres.size() - 1, material_index, emission);
}

void SceneMaker::camera(Vec3f origin, Vec3f target, float field_of_view, int width, int height) {
  Camera camera = look_at(origin, target, {0, 1, 0}, field_of_view, Camera::FovAxis::x);
  camera.film_width = scene.film.width = width;
  camera.film_height = scene.film.height = height;
  scene.cameras.push_back(camera);
}

Scene open_room(const OpenRoom& options) {
  SceneMaker maker;
  maker.scene.file = "(open room)";
  Material glass, mirror, curtain, glossy;
  glass.type = BsdfType::dielectric;
  mirror.type = BsdfType::conductor;
  curtain.reflectance = maker.texture(0.3f);
  curtain.opacity = maker.texture(0.5f);
  curtain.two_sided = true;
  glossy.type = BsdfType::roughplastic;
  glossy.reflectance = maker.texture({0.5f, 0.2f, 0.1f});
  glossy.alpha_u = glossy.alpha_v = maker.texture(0.1f);
  glossy.two_sided = true;
  const int white = maker.diffuse(Vec3f(0.7f), true);
  if (options.shapes) {
    maker.quad({-2, 0, 2}, {4, 0, 0}, {0, 0, -4}, maker.material(glossy));
    maker.quad({-2, 0, -2}, {4, 0, 0}, {0, 3, 0}, white);
    maker.quad({-2, 0, 2}, {0, 0, -4}, {0, 3, 0}, white);
    maker.quad({2, 0, -2}, {0, 0, 4}, {0, 3, 0}, maker.diffuse({0.2f, 0.6f, 0.3f}));  // one-sided, faces the room
    maker.sphere({-0.7f, 0.6f, -0.5f}, 0.6f, maker.material(glass));
    maker.sphere({0.8f, 0.6f, -0.8f}, 0.6f, maker.material(mirror));
    maker.sphere({1.2f, 0.3f, 0.5f}, 0.3f, maker.rough_metal(0.2f));
    maker.quad({-1, 0.2f, 1}, {2, 0, 0}, {0, 1.5f, 0}, maker.material(curtain));
  }
  if (options.shapes && options.lamps) {
    maker.quad({-0.5f, 2.9f, -0.5f}, {1, 0, 0}, {0, 0, 1}, white, {8.0f, 7.0f, 5.0f});
    maker.sphere({0.1f, 0.3f, 0.6f}, 0.2f, white, Vec3f(2.0f));
  }
  if (options.environment) {
    Environment sky;
    sky.width = 4;
    sky.height = 3;
    for (int i = 0; i < 12; ++i) sky.pixels.push_back({0.1f + 0.05f * static_cast<float>(i % 5), 0.2f, 0.3f});
    maker.scene.environments.push_back(sky);
  }
  maker.camera({0.1f, 1.3f, 5.0f}, {0, 1, 0}, 50.0f, 24, 18);
  return std::move(maker.scene);
}

Scene closed_room() {
  SceneMaker maker;
  maker.scene.file = "(built-in room)";
  const int white = maker.diffuse(Vec3f(0.7f), true);
  maker.quad({-1, -1, -1}, {0, 0, 2}, {2, 0, 0}, white);  // floor
  maker.quad({-1, 1, -1}, {2, 0, 0}, {0, 0, 2}, white);   // ceiling
  maker.quad({-1, -1, -1}, {2, 0, 0}, {0, 2, 0}, white);  // back
  maker.quad({-1, -1, 1}, {0, 2, 0}, {2, 0, 0}, white);   // front, behind the camera
  maker.quad({-1, -1, -1}, {0, 2, 0}, {0, 0, 2}, maker.diffuse({0.6f, 0.1f, 0.1f}, true));
  maker.quad({1, -1, -1}, {0, 0, 2}, {0, 2, 0}, maker.diffuse({0.1f, 0.5f, 0.1f}, true));
  maker.quad({-0.3f, 0.98f, -0.3f}, {0.6f, 0, 0}, {0, 0, 0.6f}, white, Vec3f(10.0f));
  maker.sphere({-0.45f, -0.6f, -0.3f}, 0.4f, maker.rough_metal(0.1f));
  maker.sphere({0.45f, -0.65f, 0.1f}, 0.35f, maker.rough_metal(0.3f));
  maker.camera({0, 0, 0.95f}, {0, -0.1f, 0}, 70.0f, 1024, 1024);
  maker.scene.fingerprint = scene_fingerprint(maker.scene);
  return std::move(maker.scene);
}

namespace {

Texture bitmap(int width, int height, std::uint32_t levels, Texture::Wrap wrap, Texture::Filter filter) {
  Texture t;
  t.kind = Texture::Kind::bitmap;
  t.width = width;
  t.height = height;
  t.wrap = wrap;
  t.filter = filter;
  const float to_uv[6] = {2.0f, 0.3f, 0.1f, -0.2f, 1.5f, -0.4f};
  std::copy(to_uv, to_uv + 6, t.to_uv);
  Rng rng(62, RngPurpose::test, static_cast<std::uint64_t>(width));
  for (int i = 0; i < width * height; ++i) {
    Vec3f v;
    for (int c = 0; c < 3; ++c) v[c] = static_cast<float>(rng.below(levels) + 1u) / static_cast<float>(levels);
    t.pixels.push_back(v);
  }
  return t;
}

}  // namespace

Scene every_material() {
  SceneMaker maker;
  Scene& scene = maker.scene;
  const int tiled = maker.texture(bitmap(80, 70, 200, Texture::Wrap::repeat, Texture::Filter::bilinear));
  const int tiled_nearest = maker.texture(bitmap(81, 66, 200, Texture::Wrap::clamp, Texture::Filter::nearest));
  const int fine = maker.texture(bitmap(79, 64, 100000, Texture::Wrap::repeat, Texture::Filter::bilinear));
  const int mirrored = maker.texture(bitmap(9, 7, 50, Texture::Wrap::mirror, Texture::Filter::bilinear));
  Texture checker;
  checker.kind = Texture::Kind::checkerboard;
  checker.to_uv[0] = checker.to_uv[4] = 5.0f;
  const int checks = maker.texture(checker);

  Material coat;
  coat.type = BsdfType::roughplastic;
  coat.reflectance = tiled;
  coat.alpha_u = maker.texture(0.2f);
  coat.bump = fine;
  coat.bump_scale = 0.1f;
  coat.two_sided = true;
  Material mask;
  mask.reflectance = mirrored;
  mask.opacity = tiled_nearest;
  Material metal;
  metal.type = BsdfType::roughconductor;
  metal.alpha_u = fine;
  metal.alpha_v = mirrored;
  metal.eta = {0.2f, 0.9f, 1.1f};
  metal.k = {3.9f, 2.4f, 2.1f};
  metal.distribution = MicrofacetDistribution::ggx;
  metal.specular_reflectance = checks;
  Material glass;
  glass.type = BsdfType::dielectric;
  Material plastic;
  plastic.type = BsdfType::plastic;
  plastic.reflectance = checks;
  plastic.nonlinear = true;
  const int coat_index = maker.material(coat), mask_index = maker.material(mask), metal_index = maker.material(metal);
  const int glass_index = maker.material(glass), plastic_index = maker.material(plastic);
  Material sides;
  sides.reflectance = fine;
  sides.two_sided = true;
  sides.back = plastic_index;
  const int sides_index = maker.material(sides);
  const int plain = maker.diffuse({0.5f, 0.4f, 0.3f});

  maker.quad({-2, 0, -2}, {0, 0, 4}, {4, 0, 0}, coat_index);
  maker.quad({-2, 0, -2}, {4, 0, 0}, {0, 3, 0}, sides_index);
  maker.quad({-1.5f, 0.2f, 0.5f}, {2, 0, 0.4f}, {0, 1.5f, 0}, mask_index);
  maker.quad({1.2f, 0, -1.5f}, {0, 0, 2.5f}, {0, 2, 0}, metal_index);
  TriangleMesh& bent = scene.meshes.back();
  bent.normals = {
      normalize(Vec3f(-1, 0.1f, 0.2f)), normalize(Vec3f(-1, 0.3f, 0)), normalize(Vec3f(-1, 0, -0.3f)), {-1, 0, 0}};
  bent.uvs.clear();
  maker.sphere({0.3f, 0.5f, -0.6f}, 0.5f, glass_index);
  maker.sphere({-1.0f, 0.4f, -1.0f}, 0.4f, coat_index);
  float x = -1.4f, z = 1.0f;
  const auto small = [&](BsdfType type) {
    Material m;
    m.type = type;
    m.reflectance = tiled;
    m.specular_reflectance = m.specular_transmittance = mirrored;
    if (type == BsdfType::principled || type == BsdfType::principledthin) maker.principled(m, fine);
    if (type == BsdfType::hair) maker.hair(m, 0.4f);
    if (type == BsdfType::measured) maker.measured(m);
    if (type == BsdfType::blendbsdf) {
      m.blended[0] = sides_index;
      m.blended[1] = glass_index;
      m.extra[ExtraParameter::weight] = checks;
    } else if (transmits(type)) {
      m.bump = tiled;
      m.normal_map = true;
    }
    maker.sphere({x, 0.2f, z}, 0.2f, maker.material(m));
    x += 0.45f;
    if (x > 1.7f) {
      x = -1.4f;
      z += 0.45f;
    }
  };
#define OCTRAD_SMALL(name, Model, transmits) small(BsdfType::name);
  OCTRAD_BSDF_LIST(OCTRAD_SMALL)
#undef OCTRAD_SMALL
  // Lights: a quad, a quad with a texture and tilted normals, a sphere with a texture, one that shines inwards, a map.
  maker.quad({-0.5f, 2.9f, -0.5f}, {1, 0, 0}, {0, 0, 1}, plain, {5, 4, 3});
  maker.quad({-1.9f, 1, -1}, {0, 0, 1}, {0, 1, 0}, plain, {2, 2, 2});
  scene.area_lights.back().radiance = tiled;
  TriangleMesh& cloth = scene.meshes.back();
  cloth.normals = {
      normalize(Vec3f(-1, 0.2f, 0)), normalize(Vec3f(-1, 0, 0.4f)), normalize(Vec3f(-1, -0.2f, 0)), {-1, 0, 0}};
  cloth.flip_normals = true;
  maker.sphere({1.2f, 2.2f, 0.8f}, 0.25f, plain, {4, 4, 4});
  scene.area_lights.back().radiance = checks;
  maker.sphere({-1.2f, 2.3f, 1.0f}, 0.5f, plain, {0.3f, 0.3f, 0.5f}, true);
  // Lights without extent, of each kind.
  DeltaLight bulb;
  bulb.position = {0.5f, 1.8f, 1.2f};
  bulb.intensity = {2, 3, 2};
  DeltaLight cone = bulb;
  cone.kind = DeltaLight::Kind::spot;
  cone.position = {-0.5f, 2.0f, 0.3f};
  cone.texture = checks;
  const float down[12] = {1, 0, 0, 0.5f, 0, 0, 1, -0.3f, 0, -1, 0, 2.0f};  // its +z is the world's -y
  std::copy(down, down + 12, cone.to_local);
  cone.cutoff = 0.8f;
  cone.cos_cutoff = std::cos(0.8f);
  cone.cos_beam = std::cos(0.5f);
  cone.inverse_transition = 1.0f / 0.3f;
  cone.tan_x = cone.tan_y = std::tan(0.8f);
  DeltaLight slides = cone;
  slides.kind = DeltaLight::Kind::projector;
  slides.texture = tiled;
  slides.axis = {0, -1, 0};
  DeltaLight sun = bulb;
  sun.kind = DeltaLight::Kind::directional;
  sun.axis = normalize(Vec3f(0.2f, -1, -0.3f));
  scene.delta_lights = {bulb, cone, slides, sun};
  // A mesh in two places, one of them mirrored.
  TriangleMesh shared;
  shared.positions = {{0, 0, 0}, {0.5f, 0, 0}, {0.5f, 0.4f, 0.1f}, {0, 0.4f, 0}};
  shared.normals.assign(4, normalize(Vec3f(0.1f, 0.0f, 1)));
  shared.uvs = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  shared.triangles = {{0, 1, 2}, {0, 2, 3}};
  scene.meshes.push_back(shared);
  for (const float side : {-1.0f, 1.0f}) {
    Placement p;
    const float place[12] = {1.4f, 0, 0.3f, 0.6f * side, 0, 1.1f, 0, 0.3f, -0.3f, 0, 0.7f * side, 1.1f};
    const float normals[9] = {0.7f * side, 0, 0.3f, 0, 1, 0, -0.3f, 0, 1.4f};
    std::copy(place, place + 12, p.to_world);
    std::copy(normals, normals + 9, p.normals);
    p.mirrors = side < 0.0f;
    scene.placements.push_back(p);
    maker.shape(Shape::Kind::mesh, scene.meshes.size() - 1, sides_index, Vec3f(0.0f));
    scene.shapes.back().placement = static_cast<int>(scene.placements.size()) - 1;
  }
  Environment sky;
  sky.width = 16;
  sky.height = 9;
  Rng rng(63, RngPurpose::test, 0);
  for (int i = 0; i < sky.width * sky.height; ++i)
    sky.pixels.push_back({rng.uniform(), rng.uniform() * rng.uniform(), 2.0f * rng.uniform()});
  const float turned[9] = {0.6f, 0, 0.8f, 0, 1, 0, -0.8f, 0, 0.6f};
  std::copy(turned, turned + 9, sky.to_world);
  scene.environments.push_back(sky);
  return std::move(maker.scene);
}

Scene triangle_soup(std::uint64_t seed) {
  constexpr int kTriangles = 20'000, kSpheres = 50;
  SceneMaker maker;
  maker.scene.file = "(built in)";
  Rng rng(seed, RngPurpose::test, 0);
  const auto point = [&](float size) {
    return Vec3f(rng.uniform() - 0.5f, rng.uniform() - 0.5f, rng.uniform() - 0.5f) * size;
  };
  const int grey = maker.diffuse(Vec3f(0.5f), true);
  for (int axis = 0; axis < 3; ++axis) {
    Vec3f a(0.0f), b(0.0f);
    a[(axis + 1) % 3] = b[(axis + 2) % 3] = 2.0f;
    Vec3f corner(-1.0f);
    maker.quad(corner, a, b, grey);
    corner[axis] = 1.0f;
    maker.quad(corner, a, b, grey);
  }
  TriangleMesh soup;
  for (int i = 0; i < kTriangles; ++i) {
    const Vec3f p = point(1.8f);
    const float size = 0.2f * rng.uniform() * rng.uniform();
    soup.positions.insert(soup.positions.end(), {p, p + point(size), p + point(size)});
    soup.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  maker.scene.meshes.push_back(std::move(soup));
  maker.shape(Shape::Kind::mesh, maker.scene.meshes.size() - 1, grey, Vec3f(0.0f));
  for (int i = 0; i < kSpheres; ++i) {
    const Vec3f center = point(1.6f);
    maker.sphere(center, 0.01f + 0.1f * rng.uniform(), grey);
  }
  return std::move(maker.scene);
}

}  // namespace octrad::testing
