// Geometry of hits against Mitsuba 3.9.1's (ray_intersect), through scene files and the tracer.
#include <gtest/gtest.h>

#include "octrad/base/folder_test_helper.h"
#include "octrad/base/rng.h"
#include "octrad/geometry/tracer.h"
#include "octrad/scene/load.h"

namespace octrad {
namespace {

struct Expected {
  float t;
  Vec3f position, shading_normal;
  Vec2f uv;
  Vec3f dp_du, dp_dv;
};

class InteractionTest : public ::testing::Test {
 protected:
  SurfaceInteraction hit(const std::string& shape, Vec3f o, Vec3f d) const {
    const Scene scene = load_scene(
        folder_.write("s.xml", R"(<scene version="3.0.0"><sensor type="perspective"/>)" + shape + "</scene>"));
    const Hit h = make_embree_tracer(scene)->intersect(o, d, 0.0f, 1e30f);
    EXPECT_TRUE(h.valid());
    return interact(scene, h, o, d);
  }
  void expect(const std::string& shape, Vec3f o, Vec3f d, const Expected& e) const {
    const SurfaceInteraction s = hit(shape, o, d);
    EXPECT_NEAR(s.t, e.t, 2e-5f) << shape;
    EXPECT_LT(length(s.position - e.position), 1e-5f) << shape;
    EXPECT_LT(length(s.shading_normal - e.shading_normal), 1e-5f)
        << shape << s.shading_normal.x << " " << s.shading_normal.y << " " << s.shading_normal.z;
    EXPECT_NEAR(length(s.geometric_normal), 1.0f, 1e-5f);
    EXPECT_GT(dot(s.geometric_normal, s.shading_normal), 0.9f) << shape;
    EXPECT_NEAR(s.uv.x, e.uv.x, 1e-5f) << shape;
    EXPECT_NEAR(s.uv.y, e.uv.y, 1e-5f) << shape;
    EXPECT_LT(length(s.dp_du - e.dp_du), 2e-5f * (1.0f + length(e.dp_du)))
        << shape << s.dp_du.x << " " << s.dp_du.y << " " << s.dp_du.z;
    EXPECT_LT(length(s.dp_dv - e.dp_dv), 2e-5f * (1.0f + length(e.dp_dv)))
        << shape << s.dp_dv.x << " " << s.dp_dv.y << " " << s.dp_dv.z;
  }
  std::string obj(const std::string& text, const std::string& more = "") const {
    folder_.write("m.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\n" + text);
    return R"(<shape type="obj"><string name="filename" value="m.obj"/>)" + more + "</shape>";
  }

  TestFolder folder_;
};

const Vec3f kDown{0, 0, -1};
const Vec3f kSlanted = normalize(Vec3f(-0.3f, -0.2f, -1.0f));
const std::string kFlip = R"(<boolean name="flip_normals" value="true"/>)";
const std::string kPlaced =
    R"(<scale x="2" y="3"/><rotate x="1" angle="40"/><rotate y="1" angle="25"/><translate x="0.1"/></transform></shape>)";

// What a mesh says of its normals (TriangleMesh::flat) changes nothing but rounding.
TEST_F(InteractionTest, FlatMeshesNeedNoNormals) {
  const std::string
      flip = R"(<boolean name="flip_normals" value="true"/>)",
      turned = R"(<transform name="to_world"><scale x="-2" y="3" z="1"/><rotate x="1" angle="40"/></transform>)",
      group = R"(<shape type="shapegroup" id="g"><shape type="cube"/></shape><shape type="instance"><ref id="g"/>)";
  for (const std::string& shapes :
       {R"(<shape type="cube">)" + turned + "</shape>", R"(<shape type="cube">)" + turned + flip + "</shape>",
        group + turned + "</shape>"}) {
    Scene scene = load_scene(
        folder_.write("s.xml", R"(<scene version="3.0.0"><sensor type="perspective"/>)" + shapes + "</scene>"));
    const auto tracer = make_embree_tracer(scene);
    Rng rng(3, RngPurpose::test, 8);
    for (int i = 0; i < 100; ++i) {
      const Vec3f o = uniform_direction(rng.uniform2()) * 9.0f, d = normalize(-o);
      const Hit h = tracer->intersect(o, d, 0.0f, 1e30f);
      ASSERT_TRUE(h.valid());
      std::vector<SurfaceInteraction> found;
      for (const bool flat : {true, false}) {
        for (TriangleMesh& m : scene.meshes) {
          EXPECT_FALSE(m.normals.empty());
          m.flat = flat;
        }
        found.push_back(interact(scene, h, o, d));
      }
      EXPECT_LT(length(found[0].shading_normal - found[1].shading_normal), 1e-5f);
      EXPECT_EQ(found[0].geometric_normal, found[1].geometric_normal);
    }
  }
}

TEST_F(InteractionTest, TrianglesWithAndWithoutUv) {
  const Vec3f o{0.7f, 0.3f, 4};
  expect(obj("f 1 2 3\n"), o, kDown, {4, {0.7f, 0.3f, 0}, {0, 0, 1}, {0.4f, 0.3f}, {1, 0, 0}, {1, 1, 0}});
  expect(obj("f 1 2 3\n", kFlip), o, kDown, {4, {0.7f, 0.3f, 0}, {0, 0, -1}, {0.4f, 0.3f}, {1, 0, 0}, {1, 1, 0}});
  const std::string uv = "vt 0 0\nvt 1 0.2\nvt 0.7 0.9\nf 1/1 2/2 3/3\n";
  expect(obj(uv), o, kDown,
         {4, {0.7f, 0.3f, 0}, {0, 0, 1}, {0.61f, 0.65f}, {0.9210526f, -0.2631579f, 0}, {-0.3947369f, -1.315789f, 0}});
  expect(obj(uv, kFlip), o, kDown,
         {4, {0.7f, 0.3f, 0}, {0, 0, -1}, {0.61f, 0.65f}, {0.9210526f, -0.2631579f, 0}, {-0.3947369f, -1.315789f, 0}});
  expect(obj("vt 0 0\nf 1/1 2/1 3/1\n"), o, kDown, {4, {0.7f, 0.3f, 0}, {0, 0, 1}, {0, 1}, {1, 0, 0}, {0, 1, 0}});
}

TEST_F(InteractionTest, SmoothNormalsAreInterpolated) {
  const SurfaceInteraction s = hit(obj("v 0 1 0.5\nf 1 2 3\nf 1 3 4\n"), {0.7f, 0.3f, 4}, kDown);
  EXPECT_LT(length(s.shading_normal - Vec3f(0.137993f, -0.137993f, 0.980773f)), 2e-6f);
  EXPECT_EQ(s.geometric_normal, Vec3f(0, 0, 1));
}

TEST_F(InteractionTest, RectangleAndCube) {
  const Vec3f o{0.7f, 0.3f, 6}, n{0.3237444f, -0.6427876f, 0.694272f};
  const std::string begin = R"(<transform name="to_world">)", mirror = R"(<scale x="-1"/>)";
  expect(R"(<shape type="rectangle">)" + begin + kPlaced, o, kSlanted,
         {6.682822f,
          {-1.186001f, -0.9573341f, -0.2866698f},
          n,
          {0.2389097f, 0.2917148f},
          {3.625231f, 0, -1.690473f},
          {1.629923f, 4.596267f, 3.49538f}});
  expect(R"(<shape type="rectangle">)" + begin + mirror + kPlaced, o, kSlanted,
         {6.682822f,
          {-1.186001f, -0.9573341f, -0.2866698f},
          n,
          {0.7610902f, 0.2917148f},
          {-3.625231f, 0, 1.690473f},
          {1.629923f, 4.596267f, 3.49538f}});
  expect(R"(<shape type="cube">)" + begin + kPlaced, o, kSlanted,
         {5.079089f,
          {-0.7334015f, -0.655601f, 1.221995f},
          n,
          {0.4972123f, 0.1820611f},
          {1.629923f, 4.596267f, 3.49538f},
          {3.625231f, 0, -1.690473f}});
  expect(R"(<shape type="cube">)" + begin + mirror + kPlaced, o, kSlanted,
         {5.079089f,
          {-0.7334015f, -0.655601f, 1.221995f},
          n,
          {0.4972122f, 0.8179389f},
          {1.629923f, 4.596267f, 3.49538f},
          {-3.625231f, 0, 1.690473f}});
}

TEST_F(InteractionTest, Spheres) {
  const Vec3f o{0.7f, 0.3f, 4}, p{-0.2233233f, -0.3155489f, 0.9222558f};
  const Vec3f du{1.982652f, -1.403181f, 0}, dv{-1.673769f, -2.364983f, -1.214478f};
  expect(R"(<shape type="sphere"/>)", o, kSlanted, {3.271687f, p, p, {0.6519774f, 0.1263438f}, du, dv});
  expect(R"(<shape type="sphere">)" + kFlip + "</shape>", o, kSlanted,
         {3.271687f, p, -p, {0.6519774f, 0.1263438f}, du, dv});
  const std::string mirror = R"(<transform name="to_world"><scale x="-1"/></transform>)";
  expect(R"(<shape type="sphere">)" + mirror + "</shape>", o, kSlanted,
         {3.271687f, p, -p, {0.8480226f, 0.1263438f}, -du, dv});
  expect(R"(<shape type="sphere">)" + mirror + kFlip + "</shape>", o, kSlanted,
         {3.271687f, p, p, {0.8480226f, 0.1263438f}, -du, dv});
  expect(
      R"(<shape type="sphere"><point name="center" x="0.1" y="0.2" z="0.3"/><float name="radius" value="0.8"/></shape>)",
      o, kSlanted,
      {3.468369f,
       {-0.2788302f, -0.3525536f, 0.7372325f},
       {-0.4735378f, -0.6906919f, 0.5465406f},
       {0.6543486f, 0.3159444f},
       {3.471797f, -2.380261f, 0},
       {-0.7767246f, -1.132914f, -2.104698f}});
  expect(
      R"(<shape type="sphere"><transform name="to_world"><scale value="0.5"/><rotate x="1" angle="40"/><translate x="0.1"/></transform></shape>)",
      {0.2f, 0.1f, 4}, kDown,
      {3.520417f,
       {0.2f, 0.1f, 0.4795831f},
       {0.2f, 0.2f, 0.9591663f},
       {0.2095422f, 0.2926905f},
       {-2.418238f, 0.4813198f, 0.4038753f},
       {0.2394614f, 1.509019f, -0.3645832f}});
}

TEST_F(InteractionTest, PolesAndTinyTriangles) {
  const SurfaceInteraction pole = hit(R"(<shape type="sphere"/>)", {0, 0, 4}, kDown);
  EXPECT_EQ(pole.uv, (Vec2f{0, 0}));
  // Around the pole nothing turns: a length of 1e-6 keeps the direction. dp_dv is as long as a meridian.
  EXPECT_LT(length(pole.dp_du - Vec3f(0, 2.0f * kPi * 1e-6f, 0)), 1e-12f);
  EXPECT_LT(length(pole.dp_dv - Vec3f(kPi, 0, 0)), 1e-6f);
  EXPECT_EQ(pole.shading_normal, Vec3f(0, 0, 1));

  Scene scene;
  scene.meshes.push_back({{{0, 0, 0}, {1e-12f, 0, 0}, {0, 1e-12f, 0}}, {}, {}, {{0, 1, 2}}, false});
  scene.shapes.push_back({Shape::Kind::mesh, 0, 0, -1, ""});
  Hit h;
  h.shape = h.primitive = 0;
  h.u = h.v = 0.25f;
  EXPECT_EQ(interact(scene, h, {0, 0, 1}, kDown).geometric_normal, Vec3f(0, 0, 1));
  scene.meshes[0].triangles[0] = {0, 1, 1};
  EXPECT_EQ(interact(scene, h, {0, 0, 1}, kDown).geometric_normal, Vec3f(0, 0, 1)) << "no area: some unit vector";
}

}  // namespace
}  // namespace octrad
