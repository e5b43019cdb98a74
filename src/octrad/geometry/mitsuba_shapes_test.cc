// Disks, cylinders, curves and instances against hits that Mitsuba 3 computed (tests/mitsuba_world_values.py);
// instances through both kinds of trees.
#include <gtest/gtest.h>

#include "octrad/base/error.h"
#include "octrad/base/folder_test_helper.h"
#include "octrad/geometry/bvh8.h"
#include "octrad/geometry/surface_sampling.h"
#include "octrad/geometry/tracer.h"
#include "octrad/geometry/voxelize.h"
#include "octrad/scene/load.h"
#include "octrad/scene/mitsuba_world_test_data.h"

namespace octrad {
namespace {

Scene load_text(const std::string& body) {
  const TestFolder folder;
  folder.write("c.txt", kMitsubaCurves);
  return load_scene(
      folder.write("s.xml", R"(<scene version="3.0.0"><sensor type="perspective"/>)" + body + "</scene>"));
}

TEST(MitsubaShapes, HitsAgree) {
  int previous = -1, hits = 0, differ = 0, differ_at_curves = 0, curves = 0, uvs_at_curves = 0;
  bool curve = false;
  Scene scene;
  std::unique_ptr<Tracer> trees[2];
  for (const MitsubaHit& expected : kMitsubaHits) {
    if (expected.shape != previous) {
      scene = load_text(kMitsubaShapes[expected.shape]);
      trees[0] = make_embree_tracer(scene);
      trees[1] = make_bvh8_tracer(scene);
      previous = expected.shape;
      curve = std::string(kMitsubaShapes[expected.shape]).find("curve") != std::string::npos;
    }
    SCOPED_TRACE(kMitsubaShapes[expected.shape]);
    for (const auto& tree : trees) {
      const Hit hit = tree->intersect(expected.origin, expected.direction, 0.0f, 1e30f);
      if (hit.valid() != (expected.t >= 0.0f)) {
        // At a silhouette, whose facets lie a little off.
        ++(curve ? differ_at_curves : differ);
        continue;
      }
      if (!hit.valid()) continue;
      ++hits;
      // Along the ray facets are off by more where it grazes the surface.
      EXPECT_NEAR(hit.t, expected.t, curve ? 5e-3f : 2e-3f);
      const SurfaceInteraction s = interact(scene, hit, expected.origin, expected.direction);
      EXPECT_GT(dot(s.geometric_normal, expected.normal), curve ? 0.99f : 0.9995f);
      EXPECT_GT(dot(s.shading_normal, expected.shading_normal), 0.9995f);
      const float around = s.uv.x - expected.uv.x;
      if (curve) {
        ++curves;  // spheres between parts have their coordinates from one of them there
        uvs_at_curves += std::fabs(around - std::round(around)) < 3e-3f && std::fabs(s.uv.y - expected.uv.y) < 3e-3f;
      } else {
        EXPECT_NEAR(around, 0.0f, 3e-3f);
        EXPECT_NEAR(s.uv.y, expected.uv.y, 3e-3f);
      }
      EXPECT_LT(length(s.position - (expected.origin + expected.direction * hit.t)), 2e-4f);
      EXPECT_TRUE(tree->occluded(expected.origin, expected.direction, 0.0f, hit.t * 1.01f));
    }
  }
  EXPECT_GT(hits, 150);
  EXPECT_LE(differ, 2);
  EXPECT_LE(differ_at_curves, 2);
  EXPECT_GT(curves, 50);
  EXPECT_GT(uvs_at_curves, 9 * curves / 10);
}

// Rays inside a curve pass its surface, single ones and packets, in instances and mirrored ones, in both trees; all
// others meet it, and shadow rays as well.
TEST(Curves, RaysInsidePass) {
  const TestFolder folder;
  folder.write("c.txt", "0 0 0 .3\n1 0 0 .3\n2 0 .5 .4\n3 0 1 .3\n4 1 1 .2\n");
  const char* curve = R"(<shape type="%"><string name="filename" value="c.txt"/></shape>)";
  for (const std::string type : {"linearcurve", "bsplinecurve"}) {
    const std::string shape = std::string(curve).replace(std::string(curve).find('%'), 1, type);
    for (const bool mirrored : {false, true}) {
      const Scene scene = load_scene(folder.write(
          "s.xml", R"(<scene version="3.0.0"><sensor type="perspective"/><shape type="shapegroup" id="g">)" + shape +
                       R"(</shape><shape type="instance"><ref id="g"/><transform name="to_world"><scale x=")" +
                       (mirrored ? "-2" : "2") + R"(" y="2" z="2"/></transform></shape>)" + shape + "</scene>"));
      const std::unique_ptr<Tracer> trees[] = {make_embree_tracer(scene), make_bvh8_tracer(scene)};
      Rng rng(9, RngPurpose::test, mirrored ? 1 : 0);
      std::vector<RayQuery> rays;
      for (int i = 0; i < 4000; ++i) {
        const float z = 2.0f * rng.uniform() - 1.0f, phi = 2.0f * kPi * rng.uniform(), r = std::sqrt(1.0f - z * z);
        const Vec3f d{r * std::cos(phi), r * std::sin(phi), z};
        // From the middle of the curve, of its instance, and from around.
        const float side = mirrored ? -2.0f : 2.0f;
        const Vec3f from[] = {{2, 0.02f, 0.5f}, {2 * side, 0.04f, 1}, Vec3f(2, 0, 0.5f) - d * 9.0f};
        rays.push_back({from[i % 3], d, 1e30f});
      }
      std::vector<Hit> hits[2] = {std::vector<Hit>(rays.size()), std::vector<Hit>(rays.size())};
      int met = 0, differ = 0, own = 0;
      for (int t = 0; t < 2; ++t) {
        std::vector<unsigned char> blocked(rays.size());
        trees[t]->intersect(rays, hits[t].data());
        trees[t]->occluded(rays, blocked.data());
        for (std::size_t i = 0; i < rays.size(); ++i) {
          const Hit hit = hits[t][i], alone = trees[t]->intersect(rays[i].origin, rays[i].direction, 0.0f, 1e30f);
          EXPECT_EQ(hit.valid(), alone.valid());
          EXPECT_EQ(hit.valid(), blocked[i] != 0);
          EXPECT_EQ(hit.valid(), trees[t]->occluded(rays[i].origin, rays[i].direction, 0.0f, 1e30f));
          if (!hit.valid()) continue;
          ++met;
          const bool plain = scene.shapes[static_cast<std::size_t>(hit.shape)].placement < 0;
          own += i % 3 == (plain ? 0 : 1) && hit.t < 0.5f;
          const SurfaceInteraction s = interact(scene, hit, rays[i].origin, rays[i].direction);
          EXPECT_LT(dot(s.geometric_normal, rays[i].direction), 1e-3f);
        }
      }
      for (std::size_t i = 0; i < rays.size(); ++i) {
        const bool same = hits[0][i].shape == hits[1][i].shape;
        differ += !same || (hits[0][i].valid() && std::fabs(hits[0][i].t - hits[1][i].t) > 1e-3f);
      }
      EXPECT_GT(met, 2000);
      EXPECT_EQ(own, 0) << "none of those from inside meets its own curve";
      EXPECT_LE(differ, 4) << "rays along the surface";
    }
  }
}

TEST(Curves, HaveNoOtherSide) {
  for (const char* type : {"linearcurve", "bsplinecurve"}) {
    EXPECT_THROW(
        load_text(std::string("<shape type=\"") + type +
                  R"("><string name="filename" value="c.txt"/><boolean name="flip_normals" value="true"/></shape>)"),
        InputError);
  }
}

const std::string kGroup =
    R"(<shape type="shapegroup" id="g"><shape type="cube"><bsdf type="conductor"/></shape><shape type="rectangle"/>
  <shape type="sphere"><float name="radius" value="2"/></shape></shape>)";

std::string instances(int count) {
  std::string text = kGroup;
  for (int i = 0; i < count; ++i) {
    const std::string x = std::to_string(5 * i), angle = std::to_string(7 * i);
    text += R"(<shape type="instance"><ref id="g"/><transform name="to_world"><rotate x="0" y="1" z="0" angle=")" +
            angle + R"("/><scale value="0.5"/><translate x=")" + x + R"("/></transform></shape>)";
  }
  return text;
}

TEST(Instances, ShareTheirMeshes) {
  const Scene scene = load_text(instances(1000));
  EXPECT_EQ(scene.meshes.size(), 2u) << "one copy, however many instances";
  EXPECT_EQ(scene.placements.size(), 1000u);
  EXPECT_EQ(scene.shapes.size(), 3000u);
  EXPECT_EQ(scene.spheres.size(), 1000u);
  const auto tracer = make_embree_tracer(scene);
  for (const int i : {0, 17, 999}) {
    const Vec3f origin{5.0f * static_cast<float>(i), 9.0f, 0.0f};
    const Hit hit = tracer->intersect(origin, {0, -1, 0}, 0.0f, 1e30f);
    ASSERT_TRUE(hit.valid());
    EXPECT_EQ(scene.shapes[static_cast<std::size_t>(hit.shape)].kind, Shape::Kind::sphere);
    EXPECT_NEAR(hit.t, 8.0f, 1e-3f);
    EXPECT_EQ(hit.shape / 3, i);
  }
  EXPECT_NEAR(scene.bounds.upper.x, 4996.0f, 0.1f);
}

// Of every instance the share of its area, and all over its mesh.
TEST(Instances, AreSampledByArea) {
  const Scene scene = load_text(
      R"(<shape type="shapegroup" id="g"><shape type="cube"/></shape><shape type="rectangle"/>
      <shape type="instance"><ref id="g"/></shape>
      <shape type="instance"><ref id="g"/><transform name="to_world"><scale value="2"/><translate x="9"/></transform></shape>)");
  const SurfaceSampler sampler(scene);
  EXPECT_NEAR(sampler.view().total_area, 4.0 + 24.0 + 96.0, 1e-4);
  Rng rng(1, RngPurpose::test, 0);
  constexpr int kPoints = 20000;
  int of_shape[3] = {}, of_side[2][6] = {}, upper = 0;
  for (int i = 0; i < kPoints; ++i) {
    const float pick = rng.uniform();
    const Vec2f u = rng.uniform2();
    const SurfaceInteraction s = sampler.sample(pick, u);
    EXPECT_LT(length(s.position - sampler.sample_position(pick, u)), 1e-5f);
    ++of_shape[s.shape];
    if (s.shape == 0) continue;
    const Vec3f p = s.shape == 1 ? s.position : (s.position - Vec3f(9, 0, 0)) * 0.5f;
    const Vec3f a{std::fabs(p.x), std::fabs(p.y), std::fabs(p.z)};
    const int axis = a.x > a.y && a.x > a.z ? 0 : a.y > a.z ? 1 : 2;
    EXPECT_NEAR(a[axis], 1.0f, 1e-5f);
    ++of_side[s.shape - 1][2 * axis + (p[axis] > 0.0f)];
    upper += p[(axis + 1) % 3] > 0.5f;
  }
  EXPECT_NEAR(of_shape[0], kPoints * 4.0 / 124.0, 120);
  EXPECT_NEAR(of_shape[2], kPoints * 96.0 / 124.0, 300);
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(of_side[1][i], kPoints * 16.0 / 124.0, 220) << i;
  EXPECT_NEAR(upper, 0.25 * kPoints * 120.0 / 124.0, 300) << "uniform on each side";
}

TEST(Instances, OccupyTheirCells) {
  const Scene placed = load_text(instances(3)), none = load_text(R"(<shape type="cube"/>)");
  const auto cells = occupied_cells(placed, scene_domain(placed.bounds, true), 3);
  const SurfaceSampler sampler(placed);
  const auto sampled = sampled_cells(placed, scene_domain(placed.bounds, true), 3, 1, 20000);
  for (const Vec3i& c : sampled.back())
    EXPECT_NE(std::find(cells.back().begin(), cells.back().end(), c), cells.back().end());
  EXPECT_NE(placed.fingerprint, none.fingerprint);
  EXPECT_NE(placed.fingerprint, load_text(instances(4)).fingerprint);
}

TEST(Instances, MistakesAreNamed) {
  const auto error = [](const std::string& body) -> std::string {
    try {
      load_text(body);
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_NE(error(R"(<shape type="instance"/>)").find("an instance holds one <ref> to a shapegroup"),
            std::string::npos);
  EXPECT_NE(error(R"(<shape type="cube" id="c"/><shape type="instance"><ref id="c"/></shape>)").find("to a shapegroup"),
            std::string::npos);
  EXPECT_NE(error(R"(<shape type="shapegroup" id="g"><shape type="cube"><emitter type="area"/></shape></shape>)")
                .find("an emitter cannot stand in a shapegroup"),
            std::string::npos);
  EXPECT_NE(error(kGroup + R"(<shape type="shapegroup"><shape type="instance"><ref id="g"/></shape></shape>)")
                .find("cannot hold another one"),
            std::string::npos);
  EXPECT_NE(
      error(kGroup +
            R"(<shape type="instance"><ref id="g"/><transform name="to_world"><scale x="2"/></transform></shape>)")
          .find("to_world of a sphere must"),
      std::string::npos);
  EXPECT_NE(
      error(
          R"(<shape type="shapegroup" id="g"><shape type="cube"/></shape><shape type="instance"><ref id="g"/><transform name="to_world"><translate x="2e9"/></transform></shape>)")
          .find("the instance is too large or too far away"),
      std::string::npos);
  EXPECT_NE(
      error(kGroup +
            R"(<shape type="instance"><ref id="g"/><transform name="to_world"><scale x="0"/></transform></shape>)")
          .find("singular"),
      std::string::npos);
}

}  // namespace
}  // namespace octrad
