#include "octrad/train/domain.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "octrad/base/bytes.h"
#include "octrad/base/error.h"
#include "octrad/base/threads.h"
#include "octrad/model/field_registry.h"
#include "octrad/transport/first_hit_math.h"
#include "octrad/transport/lhs_math.h"
#include "octrad/transport/rhs_math.h"

namespace octrad {
namespace {

constexpr std::size_t kRays = 8192;
constexpr int kVertices = 4;          // of each
constexpr std::size_t kFewest = 256;  // points that say something
constexpr double kCells = 256.0;
constexpr double kLeftOut[] = {0.0, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1};
constexpr float kMargin = 0.05f;  // of a side, on each side of the points
constexpr double kWorthIt = 2.0;  // times finer
constexpr double kCoarse = 0.1;   // cells above this share of the distance: about 6 degrees

double largest_side(const Domain& box) { return static_cast<double>(max_component(box.size)); }

// How far outside the box; 0 inside.
double distance_outside(const Domain& box, Vec3f p) {
  return static_cast<double>(std::max(0.0f, max_component(max(box.origin - p, p - (box.origin + box.size)))));
}

double cost(const Domain& box, const std::vector<Vec3f>& points) {
  const double cell = largest_side(box) / kCells;
  double sum = 0.0;
  for (const Vec3f& p : points) sum += std::log2(cell + distance_outside(box, p));
  return sum / static_cast<double>(points.size());
}

double median(std::vector<double>& values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// The box that leaves out `share` of the points on each side of each axis, with a margin, within the scene.
Bounds3f box_of(const std::vector<float> (&sorted)[3], double share, const Bounds3f& scene) {
  const auto n = sorted[0].size();
  const auto skip = static_cast<std::size_t>(share * static_cast<double>(n - 1));
  Bounds3f box;
  for (int a = 0; a < 3; ++a) {
    const float low = sorted[a][skip], high = sorted[a][n - 1 - skip], margin = (high - low) * kMargin;
    box.lower[a] = std::max(scene.lower[a], low - margin);
    box.upper[a] = std::min(scene.upper[a], high + margin);
  }
  return box;
}

Domain choose_box(const Domain& whole, const Bounds3f& scene, bool cube, const std::vector<Vec3f>& points) {
  if (points.size() < kFewest) return whole;
  std::vector<float> sorted[3];
  for (int a = 0; a < 3; ++a) {
    for (const Vec3f& p : points) sorted[a].push_back(p[a]);
    std::sort(sorted[a].begin(), sorted[a].end());
  }
  Domain best = whole;
  double least = cost(whole, points);
  for (const double share : kLeftOut) {
    const Domain box = scene_domain(box_of(sorted, share, scene), cube);
    if (largest_side(box) * kWorthIt > largest_side(whole)) continue;
    if (const double c = cost(box, points); c < least) {
      least = c;
      best = box;
    }
  }
  return best;
}

// Where rays end: half of them from the sensors, half from free space that sensors see, each with up to three bounces.
// Always the same for the same scene and sensors.
struct SeenSurfaces {
  std::vector<Vec3f> points;
  double distance = 0.0;  // of the first surfaces from their sensors: median, world units; 0: no sensor sees any
  double pixel = 0.0;     // side of what a pixel of the sensor covers there: median, world units
};

SeenSurfaces seen_surfaces(const PreparedScene& scene, const std::vector<Camera>& cameras) {
  std::vector<CameraView> views;
  for (const Camera& camera : scene.scene().cameras) views.push_back(camera.own_view());
  for (const Camera& camera : cameras) views.push_back(camera.own_view());
  SeenSurfaces seen;
  if (views.empty()) return seen;

  struct Walk {
    Vec3f points[kVertices];
    int count = 0;
    double distance = -1.0, pixel = 0.0;  // from a sensor that sees something
  };
  const TransportContext context = scene.context();
  FollowRules rules;
  rules.follow_below = kFollowDelta;
  rules.max_chain = 16;
  std::vector<Walk> walks(kRays);
  parallel_blocks(kRays, 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      Walk& walk = walks[i];
      Rng rng(0, RngPurpose::domain, i);
      const CameraView& view = views[i / 2 % views.size()];
      const bool sensor = i % 2 == 0;
      Ray ray;
      if (sensor) ray = random_ray(view, rng);
      else if (!pose_ray(context, view, rng, ray)) continue;
      Vec3f position = ray.origin, direction = ray.direction;
      const Vec3f* normal = nullptr;
      RayEnd hit;
      Vec3f geometric;
      for (int v = 0; v < kVertices; ++v) {
        FirstHit first;
        hit = v == 0 && sensor
                  ? follow_camera_ray(context, rules, ray, rng, first)
                  : follow_ray(context, position, normal, direction, rng, rules.follow_below, rules.max_chain);
        if (!hit.surface) break;
        walk.points[walk.count++] = hit.point.surface.position;
        if (v == 0 && sensor) {
          walk.distance = static_cast<double>(length(hit.point.surface.position - ray.origin));
          walk.pixel = pixel_footprint(view, walk.distance);
        }
        const float u_lobe = rng.uniform();
        const BsdfSample scattered =
            sample_bsdf(hit.point.bsdf, hit.point.to_local(hit.point.wo), u_lobe, rng.uniform2());
        if (!scattered.valid) break;
        position = hit.point.surface.position;
        direction = normalize(hit.point.to_world(scattered.wi));
        geometric = hit.point.surface.geometric_normal;
        normal = &geometric;
      }
    }
  });
  std::vector<double> distances, pixels;
  for (const Walk& walk : walks) {
    for (int v = 0; v < walk.count; ++v)
      if (is_finite(walk.points[v])) seen.points.push_back(walk.points[v]);
    if (walk.distance < 0.0) continue;
    distances.push_back(walk.distance);
    pixels.push_back(walk.pixel);
  }
  seen.distance = median(distances);
  seen.pixel = median(pixels);
  return seen;
}

}  // namespace

DomainFit fit_domain(const PreparedScene& scene, const Config& config, const std::vector<Camera>& cameras) {
  if (scene.scene().shapes.empty())
    throw InputError(scene.scene().file + ": the scene has no surface that could learn");
  const Bounds3f& bounds = scene.scene().bounds;
  const bool cube = config.octree_box == OctreeBox::cube;
  const Domain whole = scene_domain(bounds, cube);
  const SeenSurfaces seen = seen_surfaces(scene, cameras);
  DomainFit fit;
  fit.whole = largest_side(whole);
  fit.distance = seen.distance;
  fit.pixel = seen.pixel;
  if (const auto given = given_bounds(config)) fit.box = scene_domain(*given, cube);
  else fit.box = config.octree_bounds == "auto" ? choose_box(whole, bounds, cube, seen.points) : whole;
  std::size_t outside = 0;
  for (const Vec3f& p : seen.points) outside += distance_outside(fit.box, p) > 0.0;
  if (!seen.points.empty()) fit.outside = static_cast<double>(outside) / static_cast<double>(seen.points.size());
  if (const auto cells = field_entry(config.field).finest_cells) fit.cell = largest_side(fit.box) / cells(config);
  return fit;
}

std::string domain_text(const DomainFit& fit) {
  std::string text = fmt::format("box {:.4g} wide", largest_side(fit.box));
  if (largest_side(fit.box) < 0.999 * fit.whole)
    text += fmt::format(" (the scene {:.4g}; {:.1f} % of what is seen lies outside)", fit.whole, 100.0 * fit.outside);
  if (fit.cell > 0.0) text += fmt::format(", finest cell {}", format_three_digits(fit.cell));
  if (fit.cell > 0.0 && fit.pixel > 0.0)
    text += fmt::format(" ({} pixels at {}, the median distance of what the sensors see)",
                        format_three_digits(fit.cell / fit.pixel), format_three_digits(fit.distance));
  return text;
}

std::string domain_warning(const DomainFit& fit) {
  if (fit.cell <= kCoarse * fit.distance || fit.distance <= 0.0) return "";
  return fmt::format(
      "the finest cell is {} wide and the sensors see surfaces at {}: too coarse to show what is there; octree.bounds "
      "can give a smaller box, octree.levels more levels",
      format_three_digits(fit.cell), format_three_digits(fit.distance));
}

FieldDomain field_domain(const Scene& scene, const Config& config, const Domain& box) {
  FieldDomain domain{box.origin, box.size, {}};
  if (const int levels = field_entry(config.field).cell_levels(config); levels > 0) {
    domain.occupied_cells = config.octree_occupancy == OctreeOccupancy::sampled
                                ? sampled_cells(scene, box, levels, static_cast<unsigned long long>(config.seed))
                                : occupied_cells(scene, box, levels);
  }
  return domain;
}

}  // namespace octrad
