// DeviceWorld's functions inside kernels against the classes of the CPU, ray by ray: the same bits on the host stream,
// and within rounding (shares of numbers, as kinks and near ties may fall to the other side) on a CUDA device.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "octrad/base/rng.h"
#include "octrad/device/launch.h"
#include "octrad/device/stream_test_helper.h"
#include "octrad/scene/files_test_helper.h"
#include "octrad/scene/load.h"
#include "octrad/shading/device_scene.h"
#include "octrad/shading/test_fixtures.h"

namespace octrad {
namespace {

static_assert(std::is_trivially_copyable_v<DeviceWorld> && std::is_trivially_copyable_v<ShadingPoint>);

// A ray, and random numbers for everything that is drawn where it ends.
struct Probe {
  Vec3f origin, direction;
  float t_max;
  float u[8];
};

// The World of the CPU's classes, and of the tree walked here.
struct CpuWorld {
  const Scene& scene;
  const Materials& materials;
  const Lights& lights;
  const SurfaceSampler& surfaces;

  SurfaceInteraction interact(const Hit& hit, Vec3f o, Vec3f d) const { return octrad::interact(scene, hit, o, d); }
  ShadingPoint shade(const SurfaceInteraction& surface, Vec3f wo) const {
    return octrad::shade(materials, surface, wo);
  }
  LightSample sample_light(Vec3f x, float u_pick, Vec2f u) const { return lights.sample(x, u_pick, u); }
  Vec3f emitted(const SurfaceInteraction& surface, Vec3f wo) const { return lights.emitted(surface, wo); }
  float light_pdf(Vec3f x, const SurfaceInteraction& surface) const { return lights.pdf(x, surface); }
  Vec3f environment(Vec3f d) const { return lights.environment(d); }
  float environment_pdf(Vec3f d) const { return lights.environment_pdf(d); }
  Vec3f environment(Vec3f d, float& pdf) const { return lights.environment(d, pdf); }
  bool has_environment() const { return lights.has_environment(); }
  bool has_lights() const { return !lights.empty(); }
  SurfaceInteraction sample_surface(float u_pick, Vec2f u) const { return surfaces.sample(u_pick, u); }
};

struct Writer {
  float* out;
  OCTRAD_HD void add(float x) { *out++ = x; }
  OCTRAD_HD void add(bool x) { *out++ = x ? 1.0f : 0.0f; }
  OCTRAD_HD void add(int x) { *out++ = static_cast<float>(x); }
  OCTRAD_HD void add(Vec2f v) {
    add(v.x);
    add(v.y);
  }
  OCTRAD_HD void add(Vec3f v) {
    add(v.x);
    add(v.y);
    add(v.z);
  }
  OCTRAD_HD void add(const SurfaceInteraction& s) {
    add(s.position);
    add(s.geometric_normal);
    add(s.shading_normal);
    add(s.uv);
    add(s.dp_du);
    add(s.dp_dv);
    add(s.shape);
    add(s.material);
    add(s.emitter);
    add(s.t);
  }
};

constexpr int kNumbers = 160;

// Everything that a World says about a probe that ended at `hit`.
#if defined(__CUDACC__)
#pragma nv_exec_check_disable
#endif
template <typename World>
OCTRAD_HD int describe(const World& world, const Probe& p, const Hit& hit, float* numbers) {
  Writer w{numbers};
  w.add(world.has_environment());
  w.add(world.has_lights());
  w.add(world.environment(p.direction));
  w.add(world.environment_pdf(p.direction));
  float pdf = -1.0f;
  w.add(world.environment(p.direction, pdf));
  w.add(pdf);
  w.add(world.sample_surface(p.u[0], {p.u[1], p.u[2]}));
  if (!hit.valid()) return static_cast<int>(w.out - numbers);
  const SurfaceInteraction surface = world.interact(hit, p.origin, p.direction);
  w.add(surface);
  w.add(world.emitted(surface, -p.direction));
  w.add(world.light_pdf(p.origin, surface));
  const ShadingPoint point = world.shade(surface, -p.direction);
  const Bsdf& b = point.bsdf;
  w.add(point.ns);
  w.add(point.s);
  w.add(point.t);
  w.add(point.front);
  w.add(point.black);
  w.add(static_cast<int>(b.type));
  w.add(static_cast<int>(b.distribution));
  w.add(b.two_sided);
  w.add(b.bumped);
  w.add(b.reflectance);
  w.add(b.specular_reflectance);
  w.add(b.specular_transmittance);
  w.add(b.alpha_u);
  w.add(b.alpha_v);
  w.add(b.opacity);
  w.add(b.eta);
  w.add(b.base_normal);
  w.add(b.internal_reflectance);
  w.add(albedo_bsdf(b));
  w.add(roughness_bsdf(b));
  const LightSample light = world.sample_light(surface.position, p.u[3], {p.u[4], p.u[5]});
  w.add(light.valid);
  w.add(light.direction);
  w.add(light.distance);
  w.add(light.radiance);
  w.add(light.pdf);
  if (light.valid) {
    const RayQuery shadow = shadow_ray(surface.position, surface.geometric_normal, light);
    w.add(shadow.origin);
    w.add(shadow.direction);
    w.add(shadow.t_max);
    const BsdfValue f = evaluate_bsdf(b, point.to_local(point.wo), point.to_local(light.direction));
    w.add(f.value);
    w.add(f.pdf);
  }
  const BsdfSample s = sample_bsdf(b, point.to_local(point.wo), p.u[6], {p.u[7], p.u[0]});
  w.add(s.valid);
  w.add(s.wi);
  w.add(s.weight);
  w.add(s.pdf);
  w.add(s.delta);
  w.add(s.transmission);
  return static_cast<int>(w.out - numbers);
}

struct Cast : Kernel {
  DeviceWorld world;
  const Probe* probes;
  Hit* hits;
  unsigned char* blocked;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    const Probe p = probes[i];
    hits[i] = world.intersect(p.origin, p.direction, 0.0f, p.t_max);
    blocked[i] = world.occluded(p.origin, p.direction, 0.0f, p.t_max) ? 1 : 0;
  }
};

struct Describe : Kernel {
  DeviceWorld world;
  const Probe* probes;
  const Hit* hits;
  float* numbers;  // [i][kNumbers]
  int* counts;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    counts[i] = describe(world, probes[i], hits[i], numbers + std::size_t{i} * kNumbers);
  }
};

// The chain of a primary ray, as a G-buffer takes it.
struct CastAndShade : Kernel {
  static constexpr unsigned kMinBlocks = 4;
  DeviceWorld world;
  const Probe* probes;
  float* numbers;  // [7][stride]
  std::size_t stride;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    const Vec3f o = probes[i].origin, d = probes[i].direction;
    const Hit hit = world.intersect(o, d, 0.0f, probes[i].t_max);
    Vec3f albedo(0.0f), normal(0.0f);
    float roughness = 1.0f;
    if (hit.valid()) {
      const ShadingPoint point = world.shade(world.interact(hit, o, d), -d);
      albedo = albedo_bsdf(point.bsdf);
      normal = point.ns;
      roughness = roughness_bsdf(point.bsdf);
    }
    const float values[7] = {albedo.x, albedo.y, albedo.z, normal.x, normal.y, normal.z, roughness};
    for (int k = 0; k < 7; ++k) numbers[static_cast<std::size_t>(k) * stride + i] = values[k];
  }
};

bool same_bits(float a, float b) { return std::memcmp(&a, &b, sizeof a) == 0; }
bool close(float a, float b) {
  return same_bits(a, b) || std::fabs(a - b) <= 1e-4f * (1.0f + std::fabs(b)) || (std::isnan(a) && std::isnan(b));
}

std::vector<Probe> make_probes(const Scene& scene, const SurfaceSampler& surfaces, int count) {
  std::vector<Probe> probes;
  for (int i = 0; i < count; ++i) {
    Rng rng(61, RngPurpose::test, static_cast<std::uint64_t>(i));
    Probe p;
    const Vec2f u = rng.uniform2();
    const float z = 1.0f - 2.0f * u.x, r = std::sqrt(std::fmax(0.0f, 1.0f - z * z));
    p.direction = normalize(Vec3f(r * std::cos(2.0f * kPi * u.y), r * std::sin(2.0f * kPi * u.y), z));
    if (i % 2 == 0) {
      const SurfaceInteraction s = surfaces.sample(rng.uniform(), rng.uniform2());
      p.origin = offset_origin(s.position, s.geometric_normal, p.direction);
    } else {
      const Vec3f e = scene.bounds.extent();
      p.origin = scene.bounds.lower + Vec3f(rng.uniform() * e.x, rng.uniform() * e.y, rng.uniform() * e.z);
    }
    p.t_max = i % 7 == 0 ? 0.3f * length(scene.bounds.extent()) : 1e30f;
    for (float& number : p.u) number = rng.uniform();
    probes.push_back(p);
  }
  return probes;
}

struct Seen {
  int hits = 0, textured = 0, bumped = 0, masked = 0, lit = 0, environment = 0, coats = 0;
};

void expect_equal_worlds(Stream& stream, const Scene& scene, int count, Seen* seen = nullptr) {
  const Materials materials(scene);
  const Lights lights(scene);
  const Bvh8 bvh = build_bvh8(scene);
  const SurfaceSampler surfaces(scene);
  const CpuWorld cpu{scene, materials, lights, surfaces};
  const SceneTables tables{scene, materials, lights, bvh, &surfaces};
  const std::size_t before = stream.allocated_bytes();
  const DeviceScene device(stream, tables);
  EXPECT_EQ(stream.allocated_bytes() - before, DeviceScene::bytes(tables));
  EXPECT_EQ(device.bytes(), DeviceScene::bytes(tables));
  EXPECT_GE(device.bytes(), bvh.bytes());

  const std::vector<Probe> probes = make_probes(scene, surfaces, count);
  const std::size_t n = probes.size();
  const DeviceArray<Probe> in(stream, std::span<const Probe>(probes), "probes");
  DeviceArray<Hit> hits(stream, n, "hits");
  DeviceArray<unsigned char> blocked(stream, n, "blocked");
  launch(stream, n, Cast{{}, device.world(), in.data(), hits.data(), blocked.data()});
  const std::vector<Hit> found = hits.download();
  const std::vector<unsigned char> found_blocked = blocked.download();
  std::vector<Hit> expected_hits(n);
  std::size_t different = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const Probe& p = probes[i];
    expected_hits[i] = bvh8_intersect(bvh.view(), p.origin, p.direction, 0.0f, p.t_max);
    const Hit &a = found[i], &b = expected_hits[i];
    const bool same = a.shape == b.shape && a.primitive == b.primitive && close(a.t, b.t) && close(a.u, b.u) &&
                      close(a.v, b.v) &&
                      (found_blocked[i] != 0) == bvh8_occluded(bvh.view(), p.origin, p.direction, 0.0f, p.t_max);
    if (!same) ++different;
    if (!stream.on_device()) {
      ASSERT_TRUE(same && same_bits(a.t, b.t) && same_bits(a.u, b.u) && same_bits(a.v, b.v)) << "ray " << i;
    }
  }
  EXPECT_LE(different, n / 100) << "rays that met something else";

  // The rest starts from the same hits.
  hits.upload(expected_hits);
  DeviceArray<float> numbers(stream, n * kNumbers, "numbers");
  DeviceArray<int> counts(stream, n, "counts");
  launch(stream, n, Describe{{}, device.world(), in.data(), hits.data(), numbers.data(), counts.data()});
  const std::vector<float> all = numbers.download();
  const std::vector<int> said = counts.download();
  std::size_t compared = 0, wrong = 0, wrong_counts = 0;
  for (std::size_t i = 0; i < n; ++i) {
    float expected[kNumbers];
    const int length = describe(cpu, probes[i], expected_hits[i], expected);
    ASSERT_LE(length, kNumbers);
    if (said[i] != length) {
      ++wrong_counts;
      continue;
    }
    for (int k = 0; k < length; ++k) {
      const float a = all[i * kNumbers + static_cast<std::size_t>(k)], b = expected[k];
      ++compared;
      if (!close(a, b)) ++wrong;
      if (!stream.on_device()) {
        ASSERT_TRUE(same_bits(a, b)) << "ray " << i << ", number " << k << ": " << a << " for " << b;
      }
    }
    if (seen == nullptr || !expected_hits[i].valid()) continue;
    const ShadingPoint point =
        cpu.shade(cpu.interact(expected_hits[i], probes[i].origin, probes[i].direction), -probes[i].direction);
    const LightSample light =
        cpu.sample_light(point.surface.position, probes[i].u[3], {probes[i].u[4], probes[i].u[5]});
    ++seen->hits;
    if (materials.view().records[point.surface.material].textured != 0) ++seen->textured;
    if (point.bsdf.bumped) ++seen->bumped;
    if (point.bsdf.opacity < 1.0f) ++seen->masked;
    if (point.bsdf.external_transmittance != nullptr) ++seen->coats;
    if (light.valid) ++(light.distance == kEnvironmentDistance ? seen->environment : seen->lit);
  }
  if (!stream.on_device()) {
    EXPECT_EQ(wrong_counts, 0u);
  }
  EXPECT_LE(wrong_counts, n / 100);
  EXPECT_LE(wrong, compared / 100) << "of " << compared;

  DeviceArray<float> shaded(stream, n * 7, "shaded");
  launch(stream, n, CastAndShade{{}, device.world(), in.data(), shaded.data(), n});
  const std::vector<float> result = shaded.download();
  std::size_t off = 0;
  for (std::size_t i = 0; i < n; ++i) {
    float expected[7] = {0, 0, 0, 0, 0, 0, 1};
    if (expected_hits[i].valid()) {
      const ShadingPoint point =
          cpu.shade(cpu.interact(expected_hits[i], probes[i].origin, probes[i].direction), -probes[i].direction);
      const Vec3f albedo = albedo_bsdf(point.bsdf);
      for (int k = 0; k < 3; ++k) {
        expected[k] = albedo[k];
        expected[3 + k] = point.ns[k];
      }
      expected[6] = roughness_bsdf(point.bsdf);
    }
    for (std::size_t k = 0; k < 7; ++k) {
      if (!close(result[k * n + i], expected[k])) ++off;
      if (!stream.on_device()) {
        ASSERT_TRUE(same_bits(result[k * n + i], expected[k])) << i << " " << k;
      }
    }
  }
  EXPECT_LE(off, 7 * n / 100);
}

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

int add(Scene& scene, const Texture& t) {
  scene.textures.push_back(t);
  return static_cast<int>(scene.textures.size()) - 1;
}

// Every kind of texture, wrapper and light, and every model of the list.
Scene everything() {
  testing::SceneMaker maker;
  Scene& scene = maker.scene;
  const int tiled = add(scene, bitmap(80, 70, 200, Texture::Wrap::repeat, Texture::Filter::bilinear));
  const int tiled_nearest = add(scene, bitmap(81, 66, 200, Texture::Wrap::clamp, Texture::Filter::nearest));
  const int fine = add(scene, bitmap(79, 64, 100000, Texture::Wrap::repeat, Texture::Filter::bilinear));
  const int mirrored = add(scene, bitmap(9, 7, 50, Texture::Wrap::mirror, Texture::Filter::bilinear));
  Texture checker;
  checker.kind = Texture::Kind::checkerboard;
  checker.to_uv[0] = checker.to_uv[4] = 5.0f;
  const int checks = add(scene, checker);

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
  const int bent = maker.quad({1.2f, 0, -1.5f}, {0, 0, 2.5f}, {0, 2, 0}, metal_index);
  TriangleMesh& mesh = scene.meshes[static_cast<std::size_t>(scene.shapes[static_cast<std::size_t>(bent)].geometry)];
  mesh.normals = {
      normalize(Vec3f(-1, 0.1f, 0.2f)), normalize(Vec3f(-1, 0.3f, 0)), normalize(Vec3f(-1, 0, -0.3f)), {-1, 0, 0}};
  mesh.uvs.clear();
  maker.sphere({0.3f, 0.5f, -0.6f}, 0.5f, glass_index);
  maker.sphere({-1.0f, 0.4f, -1.0f}, 0.4f, coat_index);
  float x = -1.4f;
  const auto small = [&](BsdfType type) {
    Material m;
    m.type = type;
    m.reflectance = tiled;
    m.specular_reflectance = m.specular_transmittance = mirrored;
    maker.sphere({x, 0.2f, 1.0f}, 0.2f, maker.material(m));
    x += 0.45f;
  };
#define OCTRAD_SMALL(name, Model, transmits) small(BsdfType::name);
  OCTRAD_BSDF_LIST(OCTRAD_SMALL)
#undef OCTRAD_SMALL
  // Lights: a quad, a quad with a texture and tilted normals, a sphere with a texture, one that shines inwards, a map.
  maker.quad({-0.5f, 2.9f, -0.5f}, {1, 0, 0}, {0, 0, 1}, plain, {5, 4, 3});
  const int banner = maker.quad({-1.9f, 1, -1}, {0, 0, 1}, {0, 1, 0}, plain, {2, 2, 2});
  TriangleMesh& cloth = scene.meshes[static_cast<std::size_t>(scene.shapes[static_cast<std::size_t>(banner)].geometry)];
  cloth.normals = {
      normalize(Vec3f(-1, 0.2f, 0)), normalize(Vec3f(-1, 0, 0.4f)), normalize(Vec3f(-1, -0.2f, 0)), {-1, 0, 0}};
  cloth.flip_normals = true;
  scene.area_lights[static_cast<std::size_t>(scene.shapes[static_cast<std::size_t>(banner)].emitter)].radiance = tiled;
  const int globe = maker.sphere({1.2f, 2.2f, 0.8f}, 0.25f, plain, {4, 4, 4});
  scene.area_lights[static_cast<std::size_t>(scene.shapes[static_cast<std::size_t>(globe)].emitter)].radiance = checks;
  maker.sphere({-1.2f, 2.3f, 1.0f}, 0.5f, plain, {0.3f, 0.3f, 0.5f}, true);
  Environment sky;
  sky.width = 16;
  sky.height = 9;
  Rng rng(63, RngPurpose::test, 0);
  for (int i = 0; i < sky.width * sky.height; ++i)
    sky.pixels.push_back({rng.uniform(), rng.uniform() * rng.uniform(), 2.0f * rng.uniform()});
  const float turned[9] = {0.6f, 0, 0.8f, 0, 1, 0, -0.8f, 0, 0.6f};
  std::copy(turned, turned + 9, sky.to_world);
  scene.environments.push_back(sky);
  return scene;
}

class DeviceScenes : public ::testing::TestWithParam<bool> {};

TEST_P(DeviceScenes, SayWhatTheCpuSays) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  Seen seen;
  expect_equal_worlds(*stream, everything(), 6000, &seen);
  // The scene does what it is for.
  EXPECT_GT(seen.hits, 2000);
  EXPECT_GT(seen.textured, 1000);
  EXPECT_GT(seen.bumped, 300);
  EXPECT_GT(seen.masked, 100);
  EXPECT_GT(seen.coats, 300);
  EXPECT_GT(seen.lit, 500);
  EXPECT_GT(seen.environment, 500);
}

TEST_P(DeviceScenes, WithoutLightsAndWithFlatEnvironments) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  testing::SceneMaker maker;
  maker.quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, maker.diffuse(Vec3f(0.5f)));
  expect_equal_worlds(*stream, maker.scene, 500);
  Environment sky;
  sky.width = sky.height = 1;
  sky.pixels = {{1, 2, 3}};
  maker.scene.environments = {sky};
  expect_equal_worlds(*stream, maker.scene, 500);
  sky.width = 3;
  sky.pixels = {{1, 2, 3}, {0, 1, 0}, {5, 4, 3}};
  maker.scene.environments = {sky};
  expect_equal_worlds(*stream, maker.scene, 500);
}

TEST_P(DeviceScenes, OfTheRepository) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  for (const char* name : {"cornell-box", "furnace", "glossy-room"}) {
    SCOPED_TRACE(name);
    expect_equal_worlds(*stream, load_scene(std::string("scenes/") + name + "/scene.xml"), 3000);
  }
}

TEST_P(DeviceScenes, Shared) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  int found = 0;
  for (const char* name : {"cbox-mitsuba", "bathroom", "kitchen", "living-room", "veach-ajar"}) {
    const std::filesystem::path file = shared_folder() / "scenes" / name / "scene.xml";
    if (!std::filesystem::exists(file)) continue;
    SCOPED_TRACE(name);
    ++found;
    expect_equal_worlds(*stream, load_scene(file.string()), 3000);
  }
  if (found == 0) GTEST_SKIP() << "no shared scenes in " << shared_folder();
}

INSTANTIATE_TEST_SUITE_P(All, DeviceScenes, ::testing::Values(false, true), testing::stream_name);

}  // namespace
}  // namespace octrad
