#include "shading/lights.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/frame.h"
#include "shading/environment_map.h"
#include "shading/warp.h"

namespace octrad {
namespace {

struct Triangle {
  Vec3f p0, e1, e2;
  Vec3f normal;                    // unit, on the emitting side
};

struct Light {
  const AreaLight* source = nullptr;
  const Texture* texture = nullptr;
  bool textured = false;
  Vec3f radiance;                  // where it is not textured
  // mesh
  const TriangleMesh* mesh = nullptr;
  std::vector<Triangle> triangles;
  std::vector<float> cdf;          // of triangle areas, last entry 1
  float inv_area = 0.0f;
  // sphere
  bool sphere = false;
  Vec3f center;
  float radius = 0.0f;
  float side = 1.0f;               // -1: emits inwards
};

Light make_light(const Scene& scene, const AreaLight& source) {
  Light l;
  l.source = &source;
  l.texture = &scene.textures[static_cast<std::size_t>(source.radiance)];
  l.textured = l.texture->kind != Texture::Kind::constant;
  l.radiance = l.texture->color0;
  const Shape& shape = scene.shapes[static_cast<std::size_t>(source.shape)];
  if (shape.kind == Shape::Kind::sphere) {
    const Sphere& s = scene.spheres[static_cast<std::size_t>(shape.geometry)];
    l.sphere = true;
    l.center = s.center;
    l.radius = s.radius;
    l.side = s.flip_normals ? -1.0f : 1.0f;
    l.inv_area = 1.0f / (4.0f * kPi * s.radius * s.radius);
    return l;
  }
  l.mesh = &scene.meshes[static_cast<std::size_t>(shape.geometry)];
  double area = 0.0;
  std::vector<double> cdf;
  for (const Vec3i& t : l.mesh->triangles) {
    Triangle tri;
    tri.p0 = l.mesh->positions[static_cast<std::size_t>(t.x)];
    tri.e1 = l.mesh->positions[static_cast<std::size_t>(t.y)] - tri.p0;
    tri.e2 = l.mesh->positions[static_cast<std::size_t>(t.z)] - tri.p0;
    const Vec3d n = cross(Vec3d(tri.e1), Vec3d(tri.e2));
    const double twice = length(n);
    if (twice > 0.0) tri.normal = Vec3f(n / (l.mesh->flip_normals ? -twice : twice));
    area += 0.5 * twice;
    cdf.push_back(area);
    l.triangles.push_back(tri);
  }
  for (const double c : cdf) l.cdf.push_back(area > 0.0 ? static_cast<float>(c / area) : 1.0f);
  l.inv_area = area > 0.0 ? static_cast<float>(1.0 / area) : 0.0f;
  return l;
}

Vec2f mesh_uv(const TriangleMesh& mesh, std::size_t triangle, Vec2f b) {
  if (mesh.uvs.empty()) return b;
  const Vec3i t = mesh.triangles[triangle];
  const Vec2f a = mesh.uvs[static_cast<std::size_t>(t.x)];
  return a + (mesh.uvs[static_cast<std::size_t>(t.y)] - a) * b.x + (mesh.uvs[static_cast<std::size_t>(t.z)] - a) * b.y;
}

// As interact() computes it.
Vec3f interpolated_normal(const TriangleMesh& mesh, std::size_t triangle, Vec2f b, Vec3f otherwise) {
  const Vec3i t = mesh.triangles[triangle];
  const Vec3f n = mesh.normals[static_cast<std::size_t>(t.x)] * (1.0f - b.x - b.y) + mesh.normals[static_cast<std::size_t>(t.y)] * b.x +
                  mesh.normals[static_cast<std::size_t>(t.z)] * b.y;
  const float l2 = dot(n, n);
  if (!(l2 > 1e-12f)) return otherwise;
  return n * ((mesh.flip_normals ? -1.0f : 1.0f) / std::sqrt(l2));
}

// Half-angle of the cone under which a sphere is seen: 1 - cos, accurate for small spheres far away.
float one_minus_cos_max(float radius, float distance2) {
  const float sin2 = std::min(1.0f, radius * radius / distance2);
  return sin2 / (1.0f + std::sqrt(1.0f - sin2));
}

}  // namespace

struct Lights::Impl {
  const Scene& scene;
  std::vector<Light> area;
  std::optional<EnvironmentMap> environment;
  int count = 0;
  float pick = 0.0f;               // probability of each emitter

  explicit Impl(const Scene& s) : scene(s) {}
  std::size_t index(float u_pick) const { return static_cast<std::size_t>(std::min(static_cast<int>(u_pick * static_cast<float>(count)), count - 1)); }
  LightSample sample_mesh(const Light& l, Vec3f x, Vec2f u) const;
  LightSample sample_sphere(const Light& l, Vec3f x, Vec2f u) const;
};

RayQuery shadow_ray(Vec3f position, Vec3f geometric_normal, const LightSample& sample) {
  const Vec3f origin = offset_origin(position, geometric_normal, sample.direction);
  if (sample.distance >= kEnvironmentDistance) return {origin, sample.direction, sample.distance};
  const Vec3f d = position - origin + sample.direction * sample.distance;
  const float l = length(d);
  return {origin, l > 0.0f ? d / l : sample.direction, l * kShadowShortening};
}

Lights::Lights(const Scene& scene) : impl_(std::make_unique<Impl>(scene)) {
  for (const AreaLight& source : scene.area_lights) impl_->area.push_back(make_light(scene, source));
  if (!scene.environments.empty()) impl_->environment.emplace(scene.environments.front());
  impl_->count = static_cast<int>(impl_->area.size()) + (impl_->environment ? 1 : 0);
  if (impl_->count > 0) impl_->pick = 1.0f / static_cast<float>(impl_->count);
}

Lights::~Lights() = default;

bool Lights::empty() const { return impl_->count == 0; }
bool Lights::has_environment() const { return impl_->environment.has_value(); }

LightSample Lights::Impl::sample_mesh(const Light& l, Vec3f x, Vec2f u) const {
  LightSample s;
  std::size_t i = 0;
  if (l.cdf.size() == 2) {
    i = u.x >= l.cdf[0] ? 1 : 0;
  } else if (l.cdf.size() > 2) {
    i = static_cast<std::size_t>(std::upper_bound(l.cdf.begin(), l.cdf.end(), u.x) - l.cdf.begin());
    i = std::min(i, l.cdf.size() - 1);
  } else if (l.cdf.empty()) {
    return s;
  }
  const float below = i > 0 ? l.cdf[i - 1] : 0.0f;
  const float share = l.cdf[i] - below;
  if (!(share > 0.0f)) return s;
  u.x = std::min((u.x - below) / share, 0.99999994f);
  const Triangle& t = l.triangles[i];
  const Vec2f b = square_to_triangle(u);
  const Vec3f d = t.p0 + t.e1 * b.x + t.e2 * b.y - x;
  const float distance2 = dot(d, d);
  s.distance = std::sqrt(distance2);
  if (!(s.distance > 0.0f)) return s;
  s.direction = d / s.distance;
  const float cos = -dot(s.direction, l.mesh->normals.empty() ? t.normal : interpolated_normal(*l.mesh, i, b, t.normal));
  if (!(cos > 0.0f)) return s;
  s.pdf = pick * l.inv_area * distance2 / cos;
  s.radiance = l.textured ? evaluate(*l.texture, mesh_uv(*l.mesh, i, b)) : l.radiance;
  s.valid = std::isfinite(s.pdf);
  return s;
}

LightSample Lights::Impl::sample_sphere(const Light& l, Vec3f x, Vec2f u) const {
  LightSample s;
  const Vec3f d = l.center - x;
  const float distance2 = dot(d, d);
  if (distance2 > l.radius * l.radius * (1.0f + 1e-4f)) {
    if (l.side < 0.0f) return s;
    const float range = one_minus_cos_max(l.radius, distance2);
    const float one_minus_cos = u.x * range, cos = 1.0f - one_minus_cos;
    const float sin2 = one_minus_cos * (1.0f + cos);
    const float sin = std::sqrt(std::max(0.0f, sin2)), phi = 2.0f * kPi * u.y;
    const Frame frame = make_frame(d / std::sqrt(distance2));
    s.direction = frame.to_world({sin * std::cos(phi), sin * std::sin(phi), cos});
    // Nearer root of |x + t w - c| = r with h = r^2 - (distance sin)^2.
    const float h = std::max(0.0f, l.radius * l.radius - distance2 * sin2);
    s.distance = std::sqrt(distance2) * cos - std::sqrt(h);
    s.pdf = pick / (2.0f * kPi * range);
  } else {
    if (l.side > 0.0f) return s;   // inside (or on) a sphere that emits outwards
    const float z = 1.0f - 2.0f * u.x, r = std::sqrt(std::max(0.0f, 1.0f - z * z)), phi = 2.0f * kPi * u.y;
    const Vec3f n{r * std::cos(phi), r * std::sin(phi), z};
    const Vec3f e = l.center + n * l.radius - x;
    s.distance = length(e);
    if (!(s.distance > 0.0f)) return s;
    s.direction = e / s.distance;
    const float cos = dot(s.direction, n);
    if (!(cos > 0.0f)) return s;
    s.pdf = pick * l.inv_area * s.distance * s.distance / cos;
  }
  s.valid = s.distance > 0.0f && std::isfinite(s.pdf);
  s.radiance = l.radiance;
  if (l.textured && s.valid) {
    Hit hit;
    hit.shape = l.source->shape;
    hit.primitive = 0;
    hit.t = s.distance;
    s.radiance = evaluate(*l.texture, interact(scene, hit, x, s.direction).uv);
  }
  return s;
}

LightSample Lights::sample(Vec3f x, float u_pick, Vec2f u) const {
  if (impl_->count == 0) return {};
  const std::size_t i = impl_->index(u_pick);
  if (i < impl_->area.size()) {
    const Light& l = impl_->area[i];
    return l.sphere ? impl_->sample_sphere(l, x, u) : impl_->sample_mesh(l, x, u);
  }
  const EnvironmentMap::Sample e = impl_->environment->sample(u);
  LightSample s;
  s.direction = e.direction;
  s.distance = kEnvironmentDistance;
  s.radiance = e.radiance;
  s.pdf = impl_->pick * e.pdf;
  s.valid = e.pdf > 0.0f;
  return s;
}

void Lights::prefetch_first(float u_pick, Vec2f u) const {
  if (impl_->environment && impl_->index(u_pick) >= impl_->area.size()) impl_->environment->prefetch_table(u);
}

void Lights::prefetch_second(float u_pick, Vec2f u) const {
  if (impl_->environment && impl_->index(u_pick) >= impl_->area.size()) impl_->environment->prefetch_pixels(u);
}

Vec3f Lights::environment(Vec3f direction, float& pdf) const {
  if (!impl_->environment) {
    pdf = 0.0f;
    return Vec3f(0.0f);
  }
  const Vec3f radiance = impl_->environment->radiance(direction, pdf);
  pdf *= impl_->pick;
  return radiance;
}

Vec3f Lights::emitted(const SurfaceInteraction& surface, Vec3f wo) const {
  if (surface.emitter < 0 || !(dot(surface.shading_normal, wo) > 0.0f)) return {0, 0, 0};
  const Light& l = impl_->area[static_cast<std::size_t>(surface.emitter)];
  return l.textured ? evaluate(*l.texture, surface.uv) : l.radiance;
}

float Lights::pdf(Vec3f x, const SurfaceInteraction& surface) const {
  if (surface.emitter < 0) return 0.0f;
  const Light& l = impl_->area[static_cast<std::size_t>(surface.emitter)];
  if (l.sphere) {
    const Vec3f d = l.center - x;
    const float distance2 = dot(d, d);
    if (distance2 > l.radius * l.radius * (1.0f + 1e-4f)) {
      return l.side < 0.0f ? 0.0f : impl_->pick / (2.0f * kPi * one_minus_cos_max(l.radius, distance2));
    }
    if (l.side > 0.0f) return 0.0f;
  }
  const Vec3f d = surface.position - x;
  const float distance2 = dot(d, d);
  const float cos = -dot(d, surface.shading_normal) / std::sqrt(distance2);
  return cos > 0.0f ? impl_->pick * l.inv_area * distance2 / cos : 0.0f;
}

Vec3f Lights::environment(Vec3f direction) const {
  return impl_->environment ? impl_->environment->radiance(direction) : Vec3f(0.0f);
}

float Lights::environment_pdf(Vec3f direction) const {
  return impl_->environment ? impl_->pick * impl_->environment->pdf(direction) : 0.0f;
}

}  // namespace octrad
