#include "transport/lhs_sampler.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/threads.h"

namespace octrad {
namespace {

constexpr int kTries = 64;  // per point: a walk may leave the scene, an area sample may lie on a black back

Vec3f uniform_sphere(Vec2f u) {
  const float z = 1.0f - 2.0f * u.x;
  const float r = std::sqrt(std::max(0.0f, 1.0f - z * z));
  return {r * std::cos(2.0f * kPi * u.y), r * std::sin(2.0f * kPi * u.y), z};
}

// Cosine-distributed direction around `n`.
Vec3f cosine_direction(Vec3f n, Vec2f u) {
  const Vec3f v = n + uniform_sphere(u) * 0.9999f;  // a unit sphere tangent at the point, seen from it: cosine density
  return normalize(v);
}

// Through a uniform pixel of the camera's own film.
Ray random_ray(const Camera& camera, Rng& rng) {
  const int width = std::max(1, camera.film_width), height = std::max(1, camera.film_height);
  const Vec2f u = rng.uniform2();
  return camera.generate({u.x * static_cast<float>(width), u.y * static_cast<float>(height)}, width, height);
}

}  // namespace

LhsSampler::LhsSampler(const TransportContext& context, const LhsOptions& options, const std::vector<Camera>& cameras)
    : context_(context), options_(options), surfaces_(context.scene), poses_(context.scene.cameras) {
  poses_.insert(poses_.end(), cameras.begin(), cameras.end());
  if (poses_.empty()) throw InputError("the scene has no sensor and no camera file was given: there is nowhere to start walks from");
  fresh_poses_ = options.poses == 0 && cameras.empty();
  for (int i = 0; i < 8 * options.poses && static_cast<int>(poses_.size()) < options.poses && cameras.empty(); ++i) {
    Rng rng(options.seed, RngPurpose::poses, static_cast<unsigned long long>(i));
    Ray ray;
    if (!free_ray(rng, ray)) continue;
    const Vec3f up = std::abs(ray.direction.y) < 0.99f ? Vec3f(0, 1, 0) : Vec3f(1, 0, 0);
    poses_.push_back(look_at(ray.origin, ray.origin + ray.direction, up, 90.0f, Camera::FovAxis::x));
  }
}

// A ray from a point of the free space that the first camera can reach (part of the way along a short random walk from it;
// nothing inside closed objects can be reached so) in a uniform direction.
bool LhsSampler::free_ray(Rng& rng, Ray& ray) const {
  Ray walk = random_ray(poses_.front(), rng);
  const int segments = 1 + static_cast<int>(rng.below(3));
  for (int s = 0; s < segments; ++s) {
    const Hit hit = context_.tracer.intersect(walk.origin, walk.direction, 0.0f, kRayInfinity);
    if (!hit.valid()) return s > 0;
    ray.origin = walk.origin + walk.direction * (hit.t * (0.02f + 0.96f * rng.uniform()));
    ray.direction = uniform_sphere(rng.uniform2());
    const SurfaceInteraction surface = interact(context_.scene, hit, walk.origin, walk.direction);
    const Vec3f n = dot(surface.geometric_normal, walk.direction) > 0.0f ? -surface.geometric_normal : surface.geometric_normal;
    walk = {offset_origin(surface.position, surface.geometric_normal, n), cosine_direction(n, rng.uniform2())};
  }
  return true;
}

// Shades the surface as seen from a random direction on the side of `n`; false where that side is black. A cosine density
// hardly ever looks along a surface, but pictures of glossy floors and walls do: hence the uniform alternative.
bool LhsSampler::fresh_direction(Rng& rng, const SurfaceInteraction& surface, Vec3f n, ShadingPoint& point) const {
  const Vec2f u = rng.uniform2();
  point = shade(context_.materials, surface, cosine_direction(n, u));
  if (options_.uniform_glossy && !point.black && roughness(point.bsdf) < options_.rough_threshold) {
    const Vec3f wo = uniform_sphere(u);
    point = shade(context_.materials, surface, dot(wo, n) < 0.0f ? -wo : wo);
  }
  point.bsdf.opacity = 1.0f;
  return !point.black;
}

bool LhsSampler::walk_point(Rng& rng, ShadingPoint& point) const {
  Ray ray;
  if (fresh_poses_) {
    if (!free_ray(rng, ray)) return false;
  } else {
    ray = random_ray(poses_[rng.below(static_cast<std::uint32_t>(poses_.size()))], rng);
  }
  RayEnd end = follow_ray(context_, ray.origin, nullptr, ray.direction, rng, false, options_.max_walk);
  for (int vertex = 0; vertex < options_.max_walk && end.surface; ++vertex) {
    if (rng.uniform() < options_.stop_probability) {
      point = end.point;
      if (rng.uniform() < options_.keep_direction) return true;
      const Vec3f n = dot(point.ns, point.wo) < 0.0f ? -point.ns : point.ns;
      return fresh_direction(rng, end.point.surface, n, point);
    }
    const float u_lobe = rng.uniform();
    const BsdfSample scattered = octrad::sample(end.point.bsdf, end.point.to_local(end.point.wo), u_lobe, rng.uniform2());
    if (!scattered.valid) return false;
    const Vec3f direction = normalize(end.point.to_world(scattered.wi));
    const Vec3f position = end.point.surface.position, normal = end.point.surface.geometric_normal;
    end = follow_ray(context_, position, &normal, direction, rng, false, options_.max_walk);
  }
  return false;
}

bool LhsSampler::view_point(Rng& rng, ShadingPoint& point) const {
  const Ray ray = random_ray(poses_.front(), rng);
  const RayEnd end = follow_ray(context_, ray.origin, nullptr, ray.direction, rng, false, options_.max_walk);
  point = end.point;
  return end.surface;
}

bool LhsSampler::area_point(Rng& rng, ShadingPoint& point) const {
  const float u_pick = rng.uniform();
  const SurfaceInteraction surface = surfaces_.sample(u_pick, rng.uniform2());
  const float side = rng.uniform() < 0.5f ? -1.0f : 1.0f;  // one-sided backs turn out black and are drawn again
  return fresh_direction(rng, surface, surface.geometric_normal * side, point);
}

void LhsSampler::sample(unsigned long long step, std::span<ShadingPoint> points) const {
  parallel_blocks(points.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      Rng rng(options_.seed, RngPurpose::walk, mix64(step + 1) ^ i);
      const double kind = rng.uniform();
      bool found = false;
      for (int t = 0; t < kTries && !found; ++t) {
        if (kind < options_.view) found = view_point(rng, points[i]);
        else if (kind < options_.view + options_.walks && t < kTries / 2) found = walk_point(rng, points[i]);
        else found = area_point(rng, points[i]);
        // What a glossy surface shows also depends on the direction: it needs more points than a rough one of its size.
        if (found && options_.glossy_boost > 1.0 && t < kTries / 2 && roughness(points[i].bsdf) >= options_.rough_threshold) {
          found = rng.uniform() * options_.glossy_boost < 1.0;
        }
      }
      if (!found) throw InputError("no visible surface point found in " + std::to_string(kTries) + " tries: is the scene empty or all one-sided backs?");
    }
  });
}

}  // namespace octrad
