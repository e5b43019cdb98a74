// What fields on the CPU get traced from their points.
#include "octrad/transport/query_point.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "octrad/base/sobol_math.h"
#include "octrad/scene/load.h"
#include "octrad/transport/hit_clusters_math.h"
#include "octrad/transport/prepared_scene.h"

namespace octrad {
namespace {

// Floors side by side - a mirror, rough metal, diffuse - below a ceiling two units above them, in the open.
PreparedScene open_scene() {
  const auto file = std::filesystem::temp_directory_path() / ("octrad_lobe_" + std::to_string(::getpid()) + ".xml");
  std::ofstream out(file);
  out << R"(<scene version="3.0.0"><sensor type="perspective"/><emitter type="constant"/>)";
  const char* bsdfs[] = {R"(<bsdf type="conductor"/>)",
                         R"(<bsdf type="roughconductor"><float name="alpha" value="0.3"/></bsdf>)",
                         R"(<bsdf type="diffuse"/>)"};
  for (int i = 0; i < 3; ++i) {
    out << R"(<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><translate x=")" << 2 * i
        << R"("/></transform>)" << bsdfs[i] << "</shape>";
  }
  out << R"(<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><scale value="4"/><translate x="2" y="2"/>
      </transform><bsdf type="diffuse"/></shape></scene>)";
  out.close();
  Scene scene = load_scene(file.string());
  std::filesystem::remove(file);
  return PreparedScene(std::move(scene));
}

// The floor's point under (x, 1, 0), seen from 45 degrees.
ShadingPoint floor_point(const TransportContext& context, float x) {
  const Vec3f d = normalize(Vec3f(0, -1, 1)), from = Vec3f(x, 0, 0) - d;
  const Hit hit = context.intersect(from, d, 0.0f, kRayInfinity);
  EXPECT_TRUE(hit.valid());
  return context.shade(context.interact(hit, from, d), -d);
}

QueryRays lobe_rays(int n) {
  QueryRays rays;
  rays.lobe = n;
  rays.lobe_below = 0.5f;
  rays.iterations = 3;
  return rays;
}

SurfacePoint traced(const TransportContext& context, const ShadingPoint& point, const QueryRays& rays,
                    std::uint64_t key = 1) {
  Rng rng(key, RngPurpose::test, 5);
  return field_query_point(context, point, rays, rng);
}

TEST(QueryPoint, AMirrorHasOneClusterAtItsReflection) {
  const PreparedScene scene = open_scene();
  const TransportContext context = scene.context();
  QueryRays rays = lobe_rays(32);
  rays.offset.traced = true;
  const SurfacePoint p = traced(context, floor_point(context, 0.1f), rays);
  EXPECT_NEAR(p.lobe[0].distance, 2.0f * std::sqrt(2.0f), 1e-3f);  // rays start beside the surface
  EXPECT_NEAR(p.lobe[0].deviation, 0.0f, 1e-3f);
  EXPECT_EQ(p.lobe[0].share, 1.0f);
  for (int k = 1; k < kHitClusters; ++k) EXPECT_EQ(p.lobe[k].share, 0.0f);
  EXPECT_NEAR(p.disparity * p.lobe[0].distance, 1.0f, 1e-4f);
}

// Where the look-up looks: along the normal on rough points, else along the mirror direction, or back to the viewer.
TEST(QueryPoint, TheOffsetsRayFollowsTheLookup) {
  const PreparedScene scene = open_scene();
  const TransportContext context = scene.context();
  const ShadingPoint metal = floor_point(context, 2.1f), diffuse = floor_point(context, 4.1f);
  QueryRays rays;
  rays.offset.traced = true;
  const float along_normal = 0.5f, along_mirror = 0.5f / std::sqrt(2.0f);
  EXPECT_NEAR(traced(context, metal, rays).disparity, along_mirror, 1e-3f);
  EXPECT_NEAR(traced(context, diffuse, rays).disparity, along_normal, 1e-3f);
  rays.offset.rule.rough_threshold = 0.2f;
  EXPECT_NEAR(traced(context, metal, rays).disparity, along_normal, 1e-3f);
  rays.offset.rule.rough = RoughDirection::mirror;
  EXPECT_NEAR(traced(context, diffuse, rays).disparity, along_mirror, 1e-3f);
  rays.offset.rule.glossy = LookupDirection::outgoing;  // 4.1 lies under the ceiling towards the viewer too
  const SurfacePoint p = traced(context, diffuse, rays);
  EXPECT_NEAR(p.disparity, along_mirror, 1e-3f);
  EXPECT_LT(dot(p.wo, reflect(p.wo, p.n)), 0.1f);  // which is elsewhere
}

TEST(QueryPoint, RoughPointsWithoutAnOffsetCostNoRay) {
  const PreparedScene scene = open_scene();
  const TransportContext context = scene.context();
  const ShadingPoint metal = floor_point(context, 2.1f), diffuse = floor_point(context, 4.1f);
  QueryRays rays;
  rays.offset.traced = true;
  rays.offset.rule.rough_offset = false;
  const SurfacePoint glossy = traced(context, metal, rays), rough = traced(context, diffuse, rays);
  EXPECT_GT(glossy.disparity, 0.0f);
  EXPECT_EQ(rays.count(glossy.alpha), 1);
  EXPECT_EQ(rough.disparity, 0.0f);
  EXPECT_EQ(rays.count(rough.alpha), 0);
}

// What the ray meets is described as it is seen from the point.
TEST(QueryPoint, TheOffsetsRayShowsWhatIsReflected) {
  const PreparedScene scene = open_scene();
  const TransportContext context = scene.context();
  QueryRays rays;
  rays.offset.traced = true;
  const SurfacePoint none = traced(context, floor_point(context, 2.1f), rays);
  EXPECT_EQ(none.reflected.met, 0.0f);
  rays.offset.reflected = true;
  rays.offset.rule.rough_offset = false;
  rays.offset.rule.rough_threshold = 1.0f;
  const SurfacePoint p = traced(context, floor_point(context, 2.1f), rays);
  ASSERT_EQ(p.reflected.met, 1.0f);
  const Vec3f w = lookup_direction(rays.offset.rule, p), y = p.x + w / p.disparity;
  Hit hit = context.intersect(y - w * 0.1f, w, 0.0f, kRayInfinity);
  ASSERT_TRUE(hit.valid());
  const SurfaceInteraction surface = context.interact(hit, y - w * 0.1f, w);
  EXPECT_LT(length(surface.position - y), 1e-3f);
  const SurfacePoint there = surface_point(context.shade(surface, -w));
  EXPECT_LT(length(p.reflected.n - there.n), 1e-5f);
  EXPECT_LT(dot(p.reflected.n, w), 0.0f);
  EXPECT_LT(length(p.reflected.albedo - there.albedo), 1e-5f);
  EXPECT_EQ(p.reflected.alpha, there.alpha);
  const SurfacePoint rough = traced(context, floor_point(context, 4.1f), rays);
  EXPECT_EQ(rough.reflected.met, 0.0f);
}

// With a spread the ray of a glossy point is as if the normal were another one: tangents of their angles fill a disc
// evenly. What it met is where it was drawn; rough points draw nothing.
TEST(QueryPoint, TheOffsetsRayIsDrawnAboutTheMirrorDirection) {
  const PreparedScene scene = open_scene();
  const TransportContext context = scene.context();
  const ShadingPoint metal = floor_point(context, 2.1f);
  QueryRays rays;
  rays.offset = {true, {}, true, 0.5f};
  const int n = 2000;
  const float radius = 0.5f * 0.3f;
  Vec3f mean(0.0f);
  int inner = 0;
  for (int i = 0; i < n; ++i) {
    Rng rng(static_cast<std::uint64_t>(i), RngPurpose::test, 7);
    const SurfacePoint p = field_query_point(context, metal, rays, rng);
    const Vec3f w = p.reflected.w;
    ASSERT_NEAR(length(w), 1.0f, 1e-5f);
    const Vec3f half = normalize(w + p.wo), tangent = half / dot(half, p.n) - p.n;
    ASSERT_LE(length(tangent), radius * 1.001f);
    inner += length(tangent) < radius * std::sqrt(0.5f);
    mean += tangent / static_cast<float>(n);
    ASSERT_EQ(p.reflected.met, 1.0f);
    EXPECT_NEAR(p.x.y + w.y / p.disparity, 2.0f, 1e-3f);  // the ceiling
  }
  EXPECT_NEAR(inner, n / 2, 5.0 * std::sqrt(n / 4.0));
  EXPECT_LT(length(mean), 5.0f * radius / std::sqrt(static_cast<float>(n)));

  Rng drawn(1, RngPurpose::test, 7), untouched(1, RngPurpose::test, 7);
  const SurfacePoint rough = field_query_point(context, floor_point(context, 4.1f), rays, drawn);
  EXPECT_EQ(drawn.bits(), untouched.bits());
  EXPECT_TRUE(rough.reflected.w == Vec3f(0.0f));
  rays.offset.spread = 0.0f;
  EXPECT_TRUE(traced(context, metal, rays).reflected.w == Vec3f(0.0f));
}

// No ray leads into the surface, not even at grazing angles; of normals that differ, neither into the real one.
TEST(QueryPoint, TheOffsetsRayStaysOnItsSide) {
  const OffsetRay offset{true, {}, true, 2.0f};
  SurfacePoint p;
  p.n = {0, 0, 1};
  p.wo = normalize(Vec3f(1.0f, 0.0f, 0.02f));
  p.alpha = 0.4f;
  int own = 0;
  for (int i = 0; i < 2000; ++i) {
    Rng rng(static_cast<std::uint64_t>(i), RngPurpose::test, 8);
    const bool bumpy = i % 2 != 0;
    const Vec3f real = bumpy ? normalize(Vec3f(0.3f, 0.0f, 1.0f)) : p.n;
    const Vec3f w = draw_offset_direction(offset, p, real, rng);
    if (w == Vec3f(0.0f)) {
      EXPECT_TRUE(bumpy);  // even the mirror direction leads into it
      ++own;
    } else {
      EXPECT_GT(w.z, 0.0f);
      EXPECT_GT(dot(w, real), 0.0f);
    }
  }
  EXPECT_LT(own, 900);
}

// What is seen through a surface is turned less by its roughness than what is reflected: nothing is drawn.
TEST(QueryPoint, PointsSeenThroughLookAlongOneRay) {
  const OffsetRay offset{true, {}, true, 0.6f};
  SurfacePoint p;
  p.n = {0, 0, 1};
  p.wo = normalize(Vec3f(0.3f, 0.0f, -1.0f));  // its mirror direction is behind the surface
  p.alpha = 0.2f;
  Rng rng(1, RngPurpose::test, 9), untouched(1, RngPurpose::test, 9);
  EXPECT_TRUE(draw_offset_direction(offset, p, p.n, rng) == Vec3f(0.0f));
  EXPECT_EQ(rng.bits(), untouched.bits());
}

TEST(QueryPoint, RoughMetalHasClustersOfItsLobe) {
  const PreparedScene scene = open_scene();
  const TransportContext context = scene.context();
  const ShadingPoint shading = floor_point(context, 2.1f);
  const QueryRays rays = lobe_rays(128);
  const SurfacePoint p = traced(context, shading, rays);
  float share = 0.0f;
  for (const HitCluster& c : p.lobe) {
    if (c.share == 0.0f) continue;
    share += c.share;
    EXPECT_GE(c.distance, 2.0f);
    EXPECT_LT(c.distance, 8.0f);
  }
  EXPECT_GT(share, 0.6f);  // some rays pass beside the ceiling
  EXPECT_LT(share, 0.999f);
  // Ray by ray, as the rhs estimator draws its directions.
  Rng rng(1, RngPurpose::test, 5);
  const SobolSet samples(rng);
  std::vector<float> distances;
  for (std::uint32_t i = 0; i < 128; ++i) {
    const SobolSet::Sample u = samples(i);
    const BsdfSample s = sample_bsdf(shading.bsdf, shading.to_local(shading.wo), u.u1, u.u2);
    if (!s.valid) continue;
    const Vec3f d = normalize(shading.to_world(s.wi));
    const Hit hit = context.intersect(offset_origin(p.x, shading.surface.geometric_normal, d), d, 0.0f, kRayInfinity);
    if (hit.valid()) distances.push_back(hit.t);
  }
  HitCluster expected[kHitClusters];
  cluster_hits(distances.data(), static_cast<int>(distances.size()), 128, 4, 3, expected);
  for (int k = 0; k < kHitClusters; ++k) {
    EXPECT_NEAR(p.lobe[k].distance, expected[k].distance, 1e-3f);
    EXPECT_NEAR(p.lobe[k].deviation, expected[k].deviation, 1e-3f);
    EXPECT_NEAR(p.lobe[k].share, expected[k].share, 1e-6f);
  }
}

TEST(QueryPoint, RepeatsForTheSameKeyAndLeavesRoughPointsAlone) {
  const PreparedScene scene = open_scene();
  const TransportContext context = scene.context();
  const ShadingPoint metal = floor_point(context, 2.1f), diffuse = floor_point(context, 4.1f);
  const SurfacePoint once = traced(context, metal, lobe_rays(32)), again = traced(context, metal, lobe_rays(32)),
                     other = traced(context, metal, lobe_rays(32), 2);
  EXPECT_EQ(once.lobe[0].distance, again.lobe[0].distance);
  EXPECT_EQ(once.lobe[0].share, again.lobe[0].share);
  EXPECT_NE(once.lobe[0].distance, other.lobe[0].distance);
  const QueryRays rays = lobe_rays(32);
  EXPECT_EQ(rays.count(once.alpha), 32);
  const SurfacePoint rough = traced(context, diffuse, rays);
  EXPECT_EQ(rays.count(rough.alpha), 0);
  EXPECT_EQ(rough.lobe[0].share, 0.0f);
}

}  // namespace
}  // namespace octrad
