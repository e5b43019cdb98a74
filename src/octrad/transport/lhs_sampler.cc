#include "octrad/transport/lhs_sampler.h"

#include <cmath>

#include "octrad/base/error.h"
#include "octrad/base/flat.h"
#include "octrad/base/threads.h"

namespace octrad {
namespace {

// The World of the CPU, with sampling of surfaces by area.
struct SampledWorld : TransportContext {
  const SurfaceSampler& surfaces;
  SurfaceInteraction sample_surface(float u_pick, Vec2f u) const { return surfaces.sample(u_pick, u); }
};

}  // namespace

LhsSampler::LhsSampler(const PreparedScene& scene, const LhsOptions& options, const std::vector<Camera>& cameras)
    : context_(scene.context()),
      options_(options),
      surfaces_(scene.surfaces()),
      poses_(scene.scene().cameras) {
  poses_.insert(poses_.end(), cameras.begin(), cameras.end());
  if (poses_.empty())
    throw InputError("the scene has no sensor and no camera file was given: there is nowhere to start walks from");
  fresh_poses_ = options.poses == 0 && cameras.empty();
  const std::vector<Camera> sensors = poses_;
  for (int i = 0; i < 8 * options.poses && static_cast<int>(poses_.size()) < options.poses && cameras.empty(); ++i) {
    Rng rng(options.seed, RngPurpose::poses, static_cast<unsigned long long>(i));
    Ray ray;
    if (!pose_ray(context_, sensors[static_cast<std::size_t>(i) % sensors.size()].own_view(), rng, ray)) continue;
    const Vec3f up = std::abs(ray.direction.y) < 0.99f ? Vec3f(0, 1, 0) : Vec3f(1, 0, 0);
    poses_.push_back(look_at(ray.origin, ray.origin + ray.direction, up, 90.0f, Camera::FovAxis::x));
  }
  for (const Camera& camera : poses_) views_.push_back(camera.own_view());
}

void LhsSampler::sample(unsigned long long step, std::span<ShadingPoint> points, std::span<const FarEnd> far_ends,
                        double by_area) const {
  const SampledWorld world{context_, surfaces_};
  const LhsPoses poses{views_.data(), static_cast<std::uint32_t>(views_.size()), fresh_poses_};
  parallel_blocks(points.size(), 16, [&](std::size_t begin, std::size_t end) {
    bool all = true;
    run_flat([&] {
      for (std::size_t i = begin; i < end; ++i) {
        if (i < far_ends.size() && far_ends[i].hit.valid()) points[i] = shade_far_end(world, far_ends[i]);
        else all = lhs_point(world, options_, poses, step, i, by_area, points[i]) && all;
      }
    });
    if (!all) throw InputError(no_lhs_point());
  });
}

std::string no_lhs_point() {
  return "no visible surface point found in " + std::to_string(kLhsTries) +
         " tries: is the scene empty, or all one-sided backs or null?";
}

}  // namespace octrad
