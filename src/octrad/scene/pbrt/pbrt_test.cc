// pbrt files: cameras, transforms, lights, shapes.
#include "octrad/scene/pbrt/pbrt.h"

#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "octrad/image/io.h"
#include "octrad/scene/pbrt/pbrt_test_helper.h"
#include "octrad/scene/pbrt/shape.h"
#include "octrad/scene/spectrum.h"

namespace octrad {
namespace {

// Towards which side a triangle of a mesh shines.
Vec3d front(const Scene& scene, std::size_t mesh = 0, std::size_t triangle = 0) {
  const TriangleMesh& m = scene.meshes[mesh];
  const Vec3i t = m.triangles[triangle];
  const auto p = [&](int i) { return Vec3d(m.positions[static_cast<std::size_t>(i)]); };
  return normalize(cross(p(t.y) - p(t.x), p(t.z) - p(t.x))) * (m.flip_normals ? -1.0 : 1.0);
}

TEST_F(PbrtTest, Camera) {
  // Without a width there is no film.
  const auto camera_of = [&](std::string before, int width = 0, int height = 0, const std::string& film = "") {
    if (width > 0) {
      before += "Film \"rgb\" \"integer xresolution\" " + std::to_string(width) + " \"integer yresolution\" " +
                std::to_string(height) + film + "\n";
    }
    return load(kPbrtSphere, before).cameras[0];
  };
  // x to the right of the picture: pbrt's camera is left-handed.
  const Scene scene =
      load(kPbrtSphere,
           "LookAt 0 0 -5  0 0 0  0 1 0\nCamera \"perspective\" \"float fov\" 60\nFilm \"rgb\" \"integer "
           "xresolution\" 400 \"integer yresolution\" 200\nIntegrator \"volpath\" \"integer maxdepth\" 7\n");
  ASSERT_EQ(scene.cameras.size(), 1u);
  const Camera& camera = scene.cameras[0];
  EXPECT_EQ(camera.film_width, 400);
  EXPECT_EQ(scene.max_depth, 8);
  const auto direction = [&](float x, float y) { return Vec3d(camera_ray(camera.view(400, 200), {x, y}).direction); };
  expect_near(direction(200, 100), {0, 0, 1});
  // The field of view is that of the shorter side.
  const double up = std::tan(30.0 * std::numbers::pi / 180.0);
  expect_near(direction(200, 0), normalize(Vec3d(0, up, 1)));
  expect_near(direction(400, 100), normalize(Vec3d(2.0 * up, 0, 1)));
  // A mirroring scale, as exporters write, turns it over; other scales change nothing.
  const Camera mirrored =
      camera_of("Scale -2 2 2\nLookAt 0 0 -5 0 0 0 0 1 0\nCamera \"perspective\" \"float fov\" 60\n");
  expect_near(Vec3d(camera_ray(mirrored.view(1280, 720), {1280, 360}).direction),
              normalize(Vec3d(-up * 16.0 / 9.0, 0, 1)));
  expect_near(Vec3d(camera_ray(mirrored.view(1280, 720), {640, 360}).origin), {0, 0, -5}, 1e-3);
  // Tall pictures.
  const Camera tall = camera_of("Camera \"perspective\" \"float fov\" 60\n", 100, 300);
  expect_near(Vec3d(camera_ray(tall.view(100, 300), {100, 150}).direction), normalize(Vec3d(up, 0, 1)));
  // A window of the screen: its right half.
  const Camera window =
      camera_of("Camera \"perspective\" \"float fov\" 60 \"float screenwindow\" [0 1 -1 1]\n", 100, 200);
  expect_near(Vec3d(camera_ray(window.view(100, 200), {0, 100}).direction), {0, 0, 1}, 1e-4);
  expect_near(Vec3d(camera_ray(window.view(100, 200), {100, 0}).direction), normalize(Vec3d(up, up, 1)), 1e-4);
  const Camera upper =
      camera_of("Camera \"perspective\" \"float fov\" 60 \"float screenwindow\" [-1 1 0 1]\n", 200, 100);
  expect_near(Vec3d(camera_ray(upper.view(200, 100), {100, 100}).direction), {0, 0, 1}, 1e-4);
  expect_near(Vec3d(camera_ray(upper.view(200, 100), {200, 0}).direction), normalize(Vec3d(up, up, 1)), 1e-4);
  const Camera lens = camera_of("Camera \"perspective\" \"float lensradius\" .1 \"float focaldistance\" 7\n");
  EXPECT_EQ(lens.kind, CameraKind::thinlens);
  EXPECT_NEAR(lens.focus_distance, 7.0f, 1e-6f);
  const Camera flat = camera_of("Camera \"orthographic\" \"float screenwindow\" [-3 3 -2 2]\n", 300, 200);
  expect_near(Vec3d(camera_ray(flat.view(300, 200), {300, 0}).origin), {3, 2, 0}, 1e-3);
  const Camera aside = camera_of("Camera \"orthographic\" \"float screenwindow\" [0 2 0 2]\n", 100, 100);
  expect_near(Vec3d(camera_ray(aside.view(100, 100), {50, 50}).origin), {1, 1, 0}, 1e-3);
  expect_near(Vec3d(camera_ray(aside.view(100, 100), {100, 0}).origin), {2, 2, 0}, 1e-3);
  const Camera crop = camera_of("Camera \"perspective\"\n", 100, 50, " \"float cropwindow\" [.5 1 0 .2]");
  EXPECT_EQ(crop.film_width, 50);
  EXPECT_EQ(crop.film_height, 10);
  EXPECT_NEAR(crop.crop_offset.x, 0.5f, 1e-6f);
  EXPECT_EQ(load(kPbrtSphere, "Integrator \"directlighting\"\n").max_depth, 2);
  EXPECT_EQ(load(kPbrtSphere).max_depth, 6);
}

TEST_F(PbrtTest, Transforms) {
  const Scene scene = load(
      "Translate 1 2 3\nScale 2 2 2\nRotate 90 0 0 1\n" + kPbrtSquare + "AttributeBegin\nIdentity\n" + kPbrtSquare +
      "AttributeEnd\nTransform [1 0 0 0  0 1 0 0  0 0 1 0  5 6 7 1]\n" + kPbrtSquare +
      "CoordinateSystem \"here\"\nIdentity\nConcatTransform [0 1 0 0  -1 0 0 0  0 0 1 0  0 0 0 1]\nCoordSysTransform \"here\"\n" +
      kPbrtSquare);
  expect_near(Vec3d(scene.meshes[0].positions[1]), {1, 4, 3});
  expect_near(Vec3d(scene.meshes[1].positions[1]), {1, 0, 0});
  expect_near(Vec3d(scene.meshes[2].positions[1]), {6, 6, 7});
  expect_near(Vec3d(scene.meshes[3].positions[1]), {6, 6, 7});
  const Scene moving =
      load("ActiveTransform EndTime\nTranslate 9 9 9\nActiveTransform All\nTranslate 1 0 0\n" + kPbrtSquare);
  expect_near(Vec3d(moving.meshes[0].positions[0]), {1, 0, 0});
  assumes(moving, "animations are left out");
}

TEST_F(PbrtTest, Fronts) {
  const std::string light = "AreaLightSource \"diffuse\" \"rgb L\" [1 2 3] \"float scale\" 2\n";
  EXPECT_NEAR(front(load(light + kPbrtSquare)).z, 1.0, 1e-6);
  EXPECT_NEAR(front(load(light + "ReverseOrientation\n" + kPbrtSquare)).z, -1.0, 1e-6);
  // Mirrors keep the front where the object has it, with normals and without.
  EXPECT_NEAR(front(load(light + "Scale -1 1 1\n" + kPbrtSquare)).z, 1.0, 1e-6);
  EXPECT_NEAR(front(load(light + "Scale 1 1 -1\n" + kPbrtSquare)).z, -1.0, 1e-6);
  const std::string normals =
      "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 1 1 0] \"normal N\" [0 0 -1 0 0 -1 0 0 -1]\n";
  EXPECT_NEAR(front(load(light + "Shape \"disk\"\n")).z, 1.0, 1e-6);
  EXPECT_NEAR(front(load(light + "Shape \"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 0]\n")).z, 1.0, 1e-6);
  const Scene scene = load(light + kPbrtSquare);
  expect_near(Vec3d(scene.textures[static_cast<std::size_t>(scene.area_lights[0].radiance)].color0), {2, 4, 6});
  EXPECT_FALSE(load(light + kPbrtSphere).spheres[0].flip_normals);
  EXPECT_FALSE(load(light + "Scale -1 1 1\n" + kPbrtSphere).spheres[0].flip_normals);
  EXPECT_TRUE(load(light + "ReverseOrientation\n" + kPbrtSphere).spheres[0].flip_normals);
  // A light on both sides is two, whose fronts look away from one another.
  const Scene both = load("AreaLightSource \"diffuse\" \"bool twosided\" true\n" + kPbrtSquare);
  ASSERT_EQ(both.meshes.size(), 2u);
  EXPECT_EQ(both.area_lights.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i)
    EXPECT_GT(front(both, i).z * static_cast<double>(both.meshes[i].positions[0].z), 0.0);
  const std::string sides = "AreaLightSource \"diffuse\" \"bool twosided\" true\n";
  for (const std::string& text :
       {sides + "ReverseOrientation\n" + kPbrtSquare, sides + normals, sides + "Scale 1 1 -1\n" + kPbrtSquare}) {
    const Scene turned = load(text);
    ASSERT_EQ(turned.meshes.size(), 2u);
    for (std::size_t i = 0; i < 2; ++i) {
      const TriangleMesh& m = turned.meshes[i];
      const double shines =
          m.normals.empty() ? front(turned, i).z : static_cast<double>(m.normals[0].z) * (m.flip_normals ? -1.0 : 1.0);
      EXPECT_GT(shines * static_cast<double>(m.positions[0].z), 0.0) << text << i;
    }
  }
  // Normals of the file decide, as in pbrt.
  const TriangleMesh turned = load(light + normals).meshes[0];
  EXPECT_LT(Vec3d(turned.normals[0]).z * (turned.flip_normals ? -1.0 : 1.0), 0.0);
}

// A mesh in a file, and a whole sphere: as those that stand in the scene.
TEST_F(PbrtTest, LightsOnBothSides) {
  const std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n";
  folder_.write("m.ply", ply);
  const std::string
      mesh = "Shape \"plymesh\" \"string filename\" \"m.ply\"\n",
      same = "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 1 1 0 0 1 0] \"integer indices\" [0 1 2 0 2 3]\n";
  for (const char* before : {"", "ReverseOrientation\n", "Scale 1 1 -1\n"}) {
    for (const char* light :
         {"AreaLightSource \"diffuse\" \"bool twosided\" true\n", "AreaLightSource \"diffuse\" \"float power\" 10\n",
          "AreaLightSource \"diffuse\" \"bool twosided\" true \"float power\" 10\n"}) {
      const std::string text = std::string(before) + light;
      const Scene file = load(text + mesh + mesh);
      EXPECT_EQ(file.fingerprint, load(text + same + same).fingerprint) << text;
      EXPECT_TRUE(file.assumed.empty() || join(file.assumed).find("front") == std::string::npos) << join(file.assumed);
    }
    const Scene spheres =
        load(std::string(before) + "AreaLightSource \"diffuse\" \"bool twosided\" true\n" + kPbrtSphere);
    ASSERT_EQ(spheres.spheres.size(), 2u);
    EXPECT_EQ(spheres.area_lights.size(), 2u);
    // The larger one shines outwards.
    const Sphere &a = spheres.spheres[0], &b = spheres.spheres[1];
    EXPECT_NE(a.radius > b.radius, a.flip_normals) << before;
    EXPECT_NE(a.flip_normals, b.flip_normals) << before;
    EXPECT_NEAR(a.radius, 1.0f, 1e-3f);
  }
  // In an object nothing shines, and one surface is enough.
  EXPECT_EQ(load("ObjectBegin \"o\"\nAreaLightSource \"diffuse\" \"bool twosided\" true\n" + mesh +
                 "ObjectEnd\nObjectInstance \"o\"\n")
                .shapes.size(),
            1u);
  folder_.write("empty.ply",
                ply.substr(0, ply.find("element face 1")) +
                    "element face 0\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n");
  fails(
      "WorldBegin\nAreaLightSource \"diffuse\" \"float power\" 10\nShape \"plymesh\" \"string filename\" \"empty.ply\"\n",
      "2:27", "without an area");
}

TEST_F(PbrtTest, Power) {
  // Of luminance 1, 10 W over pi times the area of each triangle, which the transform makes 2.
  const Scene scene = load("Scale 2 2 2\nAreaLightSource \"diffuse\" \"float power\" 10\n" + kPbrtSquare);
  EXPECT_NEAR(scene.textures[static_cast<std::size_t>(scene.area_lights[0].radiance)].color0.x,
              10.0 / (2.0 * std::numbers::pi), 1e-5);
  const Scene point = load("LightSource \"point\" \"float power\" 10 \"point3 from\" [1 2 3]\n" + kPbrtSphere);
  EXPECT_NEAR(point.delta_lights[0].intensity.x, 10.0 / (4.0 * std::numbers::pi), 1e-5);
  expect_near(Vec3d(point.delta_lights[0].position), {1, 2, 3});
  // A black body is as bright as white light.
  const Scene warm = load("AreaLightSource \"diffuse\" \"blackbody L\" 3000\n" + kPbrtSquare);
  const Vec3f l = warm.textures[static_cast<std::size_t>(warm.area_lights[0].radiance)].color0;
  EXPECT_NEAR(0.212671f * l.x + 0.715160f * l.y + 0.072169f * l.z, 1.0f, 1e-3f);
  EXPECT_GT(l.x, 2.0f * l.z);
}

TEST_F(PbrtTest, OtherLights) {
  const Scene distant = load(
      "Rotate 90 0 1 0\nLightSource \"distant\" \"point3 from\" [0 0 0] \"point3 to\" [0 0 1] \"rgb L\" [1 2 3]\n" +
      kPbrtSphere);
  expect_near(Vec3d(distant.delta_lights[0].axis), {1, 0, 0});
  expect_near(Vec3d(distant.delta_lights[0].intensity), {1, 2, 3});
  const Scene spot = load(
      "LightSource \"spot\" \"point3 from\" [0 5 0] \"point3 to\" [0 0 0] \"float coneangle\" 40 \"float conedeltaangle\" 10\n" +
      kPbrtSphere);
  expect_near(Vec3d(spot.delta_lights[0].axis), {0, -1, 0});
  EXPECT_NEAR(spot.delta_lights[0].cutoff, 40.0 * std::numbers::pi / 180.0, 1e-6);
  EXPECT_NEAR(spot.delta_lights[0].cos_beam, std::cos(30.0 * std::numbers::pi / 180.0), 1e-6);
  EXPECT_EQ(
      load("LightSource \"infinite\" \"rgb L\" [1 2 3] \"float scale\" 2 \"string filename\" \"\"\n" + kPbrtSphere)
          .fingerprint,
      load_xml("<emitter type=\"constant\"><rgb name=\"radiance\" value=\"2 4 6\"/></emitter>" +
               on_sphere(two_sided("<bsdf type=\"diffuse\"/>")))
          .fingerprint);
}

// The radiance that an environment shows in a direction of the world, by Mitsuba's rule.
double seen(const Environment& e, Vec3d world) {
  Transform t;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) t(row, column) = static_cast<double>(e.to_world[row * 3 + column]);
  }
  const Vec3d d = normalize(t.inverse().vector(world));
  double u = std::atan2(d.x, -d.z) / (2.0 * std::numbers::pi);
  u -= std::floor(u);
  const double v = std::acos(std::clamp(d.y, -1.0, 1.0)) / std::numbers::pi;
  const int x = std::min(static_cast<int>(u * e.width), e.width - 1),
            y = std::min(static_cast<int>(v * e.height), e.height - 1);
  return static_cast<double>(e.pixels[static_cast<std::size_t>(y * e.width + x)].x);
}

// A direction of a pixel by equal areas (Clarberg 2008, the way from the square to the sphere).
Vec3d direction_of_square(double u, double v) {
  u = 2.0 * u - 1.0;
  v = 2.0 * v - 1.0;
  const double up = std::fabs(u), vp = std::fabs(v), distance = 1.0 - (up + vp), d = std::fabs(distance), r = 1.0 - d;
  const double phi = (r == 0.0 ? 1.0 : (vp - up) / r + 1.0) * std::numbers::pi / 4.0;
  const double z = std::copysign(1.0 - r * r, distance), s = r * std::sqrt(2.0 - r * r);
  return {std::copysign(std::cos(phi), u) * s, std::copysign(std::sin(phi), v) * s, z};
}

TEST_F(PbrtTest, Environments) {
  const auto light = [](Vec3d d) { return 1.0 + 0.5 * d.x + 0.3 * d.y - 0.2 * d.z; };
  constexpr int kSide = 64;
  Image square(kSide, kSide, {"R", "G", "B"}), wide(2 * kSide, kSide, {"R", "G", "B"});
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x)
      square.set_rgb(x, y, Vec3f(static_cast<float>(light(direction_of_square((x + 0.5) / kSide, (y + 0.5) / kSide)))));
    // Version 3: latitude from +z down, longitude from +x to +y.
    for (int x = 0; x < 2 * kSide; ++x) {
      const double theta = (y + 0.5) / kSide * std::numbers::pi, phi = (x + 0.5) / kSide * std::numbers::pi;
      wide.set_rgb(x, y,
                   Vec3f(static_cast<float>(
                       light({std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)}))));
    }
  }
  write_exr((folder_.path() / "square.exr").string(), square);
  write_exr((folder_.path() / "wide.exr").string(), wide);
  const std::string turn = "Rotate 30 0 1 0\n";
  const Scene now = load(turn + "LightSource \"infinite\" \"string filename\" \"square.exr\" \"float scale\" 2\n" +
                         kPbrtSphere),
              old = load_old(turn + "LightSource \"infinite\" \"string mapname\" \"wide.exr\" \"rgb scale\" [2 2 2]\n" +
                             kPbrtSphere);
  const Transform to_world = Transform::rotate({0, 1, 0}, 30.0);
  for (int i = 0; i < 200; ++i) {
    const double z = 1.0 - 2.0 * (i + 0.5) / 200.0, phi = 2.4 * i, r = std::sqrt(1.0 - z * z);
    const Vec3d d{r * std::cos(phi), r * std::sin(phi), z};
    EXPECT_NEAR(seen(now.environments[0], to_world.vector(d)), 2.0 * light(d), 0.08) << i;
    EXPECT_NEAR(seen(old.environments[0], to_world.vector(d)), 2.0 * light(d), 0.08) << i;
  }
}

TEST_F(PbrtTest, SkiesAddUp) {
  const Scene scene = load("LightSource \"infinite\" \"float scale\" 1\nLightSource \"infinite\" \"rgb L\" [1 0 .5]\n" +
                           std::string(kPbrtSphere));
  ASSERT_EQ(scene.environments.size(), 1u);
  EXPECT_EQ(scene.environments[0].pixels.at(0), Vec3f(2, 1, 1.5f));
}

// Directives of version 2 that change nothing here.
TEST_F(PbrtTest, VersionTwo) {
  EXPECT_EQ(load_scene(folder_.write("s.pbrt", "Renderer \"sampler\"\nVolumeIntegrator \"single\"\nWorldBegin\n" +
                                                   std::string(kPbrtSphere) + "WorldEnd\n"))
                .shapes.size(),
            1u);
}

TEST_F(PbrtTest, RoundShapes) {
  const auto area = [&](const std::string& shape) {
    const Scene scene = load(shape);
    RawMesh mesh;
    mesh.positions = scene.meshes[0].positions;
    mesh.triangles = scene.meshes[0].triangles;
    return mesh_area(mesh, Transform());
  };
  constexpr double pi = std::numbers::pi;
  EXPECT_NEAR(area("Shape \"disk\" \"float radius\" 2 \"float innerradius\" 1\n"), 3.0 * pi, 0.01);
  EXPECT_NEAR(area("Shape \"cylinder\" \"float radius\" 2 \"float zmin\" 0 \"float zmax\" 3 \"float phimax\" 90\n"),
              3.0 * pi, 0.01);
  EXPECT_NEAR(area("Shape \"cone\" \"float radius\" 3 \"float height\" 4\n"), 15.0 * pi, 0.02);
  EXPECT_NEAR(area("Shape \"sphere\" \"float zmin\" 0\n"), 2.0 * pi, 0.01);
  // pi r / (6 h^2) ((r^2 + 4 h^2)^(3/2) - r^3).
  EXPECT_NEAR(area("Shape \"paraboloid\"\n"), pi / 6.0 * (std::pow(5.0, 1.5) - 1.0), 0.01);
  // A cylinder as a hyperboloid whose line is parallel to the axis.
  EXPECT_NEAR(area("Shape \"hyperboloid\" \"point3 p1\" [1 0 0] \"point3 p2\" [1 0 2]\n"), 4.0 * pi, 0.01);
  // Spheres that the transform makes ellipsoids are meshes, whose normals point outwards.
  const Scene scene = load("Scale 1 2 3\n" + kPbrtSphere);
  ASSERT_EQ(scene.spheres.size(), 0u);
  for (std::size_t t = 0; t < scene.meshes[0].triangles.size(); t += 97) {
    const Vec3d p(scene.meshes[0].positions[static_cast<std::size_t>(scene.meshes[0].triangles[t].x)]);
    EXPECT_GT(dot(front(scene, 0, t), p), 0.0) << t;
  }
}

TEST_F(PbrtTest, Instances) {
  const Scene scene = load("ObjectBegin \"o\"\nTranslate 0 0 1\n" + kPbrtSquare + kPbrtSphere +
                           "ObjectEnd\nTranslate 5 0 0\n"
                           "ObjectInstance \"o\"\nScale 2 2 2\nObjectInstance \"o\"\n");
  EXPECT_EQ(scene.meshes.size(), 1u);
  EXPECT_EQ(scene.shapes.size(), 4u);
  expect_near(Vec3d(scene.placements[1].point(scene.meshes[0].positions[1])), {7, 0, 2});
  expect_near(Vec3d(scene.spheres[1].center), {5, 0, 2});
  assumes(load("ObjectBegin \"o\"\nAreaLightSource \"diffuse\"\n" + kPbrtSquare + "ObjectEnd\nObjectInstance \"o\"\n"),
          "lights in objects are left out");
}

TEST_F(PbrtTest, Plys) {
  const std::string body =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty float u\n"
      "property float v\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 "
      "0 .75\n3 0 1 2\n";
  folder_.write("m.ply", body);
  const std::string file = (folder_.path() / "z.ply.gz").string();
  const gzFile out = gzopen(file.c_str(), "wb");
  ASSERT_NE(out, nullptr);
  ASSERT_EQ(gzwrite(out, body.data(), static_cast<unsigned>(body.size())), static_cast<int>(body.size()));
  gzclose(out);
  const Scene plain = load("Shape \"plymesh\" \"string filename\" \"m.ply\"\n"),
              packed = load("Shape \"plymesh\" \"string filename\" \"z.ply.gz\"\n");
  EXPECT_EQ(plain.fingerprint, packed.fingerprint);
  EXPECT_EQ(plain.meshes[0].uvs[2].y, 0.25f);
  EXPECT_TRUE(plain.meshes[0].normals.empty());  // pbrt makes none
  folder_.write("b.ply.gz", "\x1f\x8bnothing");
  EXPECT_NE(error("WorldBegin\nShape \"plymesh\" \"string filename\" \"b.ply.gz\"\n").find("broken or cut off"),
            std::string::npos);
}

TEST_F(PbrtTest, CurvesAreTheSameCubics) {
  // A Bezier segment from (0,0,0) to (3,1,0), half as wide at its end; the tube's rings lie about its points.
  const Scene scene = load(
      "Material \"hair\"\nScale 2 2 2\nShape \"curve\" \"point3 P\" [0 0 0 1 0 0 2 1 0 3 1 0] \"float width0\" .2 "
      "\"float width1\" .1\n");
  const TriangleMesh& mesh = scene.meshes[0];
  EXPECT_TRUE(mesh.one_sided);
  Bounds3f box;
  for (const Vec3f& p : mesh.positions) box.extend(p);
  EXPECT_NEAR(box.lower.x, 0.0f, 1e-4f);
  EXPECT_NEAR(box.upper.x, 6.0f, 1e-4f);
  EXPECT_NEAR(box.upper.z, 0.2f, 2e-3f);  // radii grow with the transform
  EXPECT_NEAR(box.upper.y, 2.1f, 5e-3f);
  PbrtParameters p(1);
  const Location here{std::make_shared<const SourceFile>("s", ""), 0};
  p[0].type = "point3";
  p[0].name = "P";
  p[0].where = here;
  p[0].numbers = {0, 0, 0, 0, 1, 0, 1, 1, 0, 2, 1, 0, 2, 2, 0, 3, 2, 0, 3, 3, 0};
  SceneReport report(false);
  const Curves two = pbrt_curves(PbrtObject("Shape", "curve", here, p), Transform(), report);
  ASSERT_EQ(two.size(), 2u);
  const auto value = [](const std::vector<CurvePoint>& c, int end) {  // of a uniform cubic B-spline at 0 and 1
    const std::size_t k = static_cast<std::size_t>(end);
    return (c[k].position + c[k + 1].position * 4.0 + c[k + 2].position) / 6.0;
  };
  expect_near(value(two[0], 0), {0, 0, 0});
  expect_near(value(two[0], 1), {2, 1, 0});
  expect_near(value(two[1], 0), {2, 1, 0});
  expect_near(value(two[1], 1), {3, 3, 0});
}

TEST_F(PbrtTest, LoopSubdivision) {
  // An octahedron: each of its six corners has four neighbours.
  RawMesh mesh;
  mesh.positions = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  mesh.triangles = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  const RawMesh once = subdivide_loop(mesh, 1);
  EXPECT_EQ(once.triangles.size(), 32u);
  EXPECT_EQ(once.positions.size(), 18u);
  // Points on the limit stay where they are: 1 / (4 + 3 / (8 beta)) with beta = 3 / 32 leaves half of a corner.
  EXPECT_NEAR(length(Vec3d(once.positions[0])), 0.5, 1e-6);
  const RawMesh fine = subdivide_loop(mesh, 4);
  for (std::size_t i = 0; i < once.positions.size(); ++i)
    expect_near(Vec3d(fine.positions[i]), Vec3d(once.positions[i]), 1e-6);
  // The front is against the order of the corners, as in pbrt.
  int inwards = 0;
  for (std::size_t i = 0; i < fine.positions.size(); ++i)
    inwards += dot(Vec3d(fine.positions[i]), Vec3d(fine.normals[i])) < 0.0 ? 1 : 0;
  EXPECT_EQ(inwards, static_cast<int>(fine.positions.size()));
  // The boundary of a flat mesh stays straight where it is.
  RawMesh flat;
  flat.positions = {{0, 0, 0}, {2, 0, 0}, {4, 0, 0}, {1, 2, 0}, {3, 2, 0}};
  flat.triangles = {{0, 1, 3}, {1, 4, 3}, {1, 2, 4}};
  const RawMesh finer = subdivide_loop(flat, 2);
  for (const Vec3f& p : finer.positions) {
    EXPECT_EQ(p.z, 0.0f);
    EXPECT_GE(p.y, 0.0f);
  }
  EXPECT_EQ(finer.positions[1].y, 0.0f);
  const Scene scene = load(
      "Shape \"loopsubdiv\" \"integer levels\" 2 \"point3 P\" [1 0 0 -1 0 0 0 1 0 0 0 1] \"integer indices\" [0 2 3 2 1 3 1 0 3 0 1 2]\n");
  EXPECT_EQ(scene.meshes[0].triangles.size(), 64u);
}

// In version 3 a name stands for what had it when it was used; in version 4 for the last.
TEST_F(PbrtTest, NamesOfTwoThings) {
  const std::string text =
      "Texture \"t\" \"spectrum\" \"constant\" \"rgb value\" [.5 .1 .1]\nMakeNamedMaterial \"a\" \"string type\" \"matte\" "
      "\"texture Kd\" \"t\"\nTexture \"t\" \"spectrum\" \"constant\" \"rgb value\" [.1 .5 .1]\nNamedMaterial \"a\"\n" +
      kPbrtSphere;
  const auto red = [](const Scene& scene) {
    return scene.textures[static_cast<std::size_t>(scene.materials[1].reflectance)].color0.x;
  };
  EXPECT_EQ(red(load_old(text)), 0.5f);
  EXPECT_EQ(red(load(text)), 0.1f);
  const std::string object = "ObjectBegin \"o\"\n" + kPbrtSquare + "ObjectEnd\n";
  EXPECT_EQ(load_old(object + object + "ObjectInstance \"o\"\n").shapes.size(), 1u);
  fails("WorldBegin\n" + object + object, "5:1", "already");
  // The film says which version it is where WorldEnd does not.
  EXPECT_EQ(red(load(text, "Film \"image\"\n")), 0.5f);
  EXPECT_EQ(red(load(text + "WorldEnd\n", "Film \"rgb\"\n")), 0.1f);
  // A comment is no directive, and of a parameter that is given twice the last counts.
  EXPECT_EQ(red(load("# no WorldEnd here\n" + text)), 0.1f);
  EXPECT_NEAR(load("Shape \"sphere\" \"float radius\" 2 \"float radius\" 3\n").spheres[0].radius, 3.0f, 1e-6f);
}

// Version 4 looks up the materials of shapes, and their textures, at the end.
TEST_F(PbrtTest, NamesBeforeTheirDefinition) {
  const std::string texture = "Texture \"t\" \"spectrum\" \"constant\" \"rgb value\" [.1 .5 .1]\n",
                    material = "MakeNamedMaterial \"a\" \"string type\" \"diffuse\" \"texture reflectance\" \"t\"\n",
                    hole = "Texture \"h\" \"float\" \"constant\" \"float value\" .25\n",
                    use = "NamedMaterial \"a\"\nShape \"sphere\" \"texture alpha\" \"h\"\n";
  const Scene before = load(texture + material + hole + use), after = load(use + material + hole + texture);
  EXPECT_EQ(before.fingerprint, after.fingerprint);
  EXPECT_GE(after.materials.at(1).opacity, 0);
  // Parts of a mix; a name that is used on both sides of its definition is one material.
  const std::string mix = "MakeNamedMaterial \"m\" \"string type\" \"mix\" \"string materials\" [\"a\" \"b\"]\n",
                    other = "MakeNamedMaterial \"b\" \"string type\" \"conductor\"\n",
                    mixed = "NamedMaterial \"m\"\n" + kPbrtSquare;
  const Scene one = load(mixed + mix + texture + material + other + mixed);
  EXPECT_EQ(one.shapes.at(0).material, one.shapes.at(1).material);
  EXPECT_EQ(one.materials.at(static_cast<std::size_t>(one.shapes.at(0).material)).type, BsdfType::blendbsdf);
  // In an object, and as the material of curves.
  const std::string curve = "Shape \"curve\" \"point3 P\" [0 0 0 1 0 0 2 1 0 3 1 0]\n";
  const Scene group = load("ObjectBegin \"o\"\nNamedMaterial \"b\"\n" + kPbrtSquare + curve +
                           "ObjectEnd\nObjectInstance \"o\"\n" + other);
  ASSERT_EQ(group.shapes.size(), 2u);
  for (const Shape& shape : group.shapes)
    EXPECT_EQ(group.materials.at(static_cast<std::size_t>(shape.material)).type, BsdfType::conductor);
  // Textures lie on triangles without coordinates of their own all the same.
  Image picture(2, 2, {"R", "G", "B"});
  write_exr((folder_.path() / "p.exr").string(), picture);
  EXPECT_EQ(
      load("NamedMaterial \"a\"\nShape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 1 1 0]\nTexture \"t\" \"spectrum\" "
           "\"imagemap\" \"string filename\" \"p.exr\"\n" +
           material)
          .meshes.at(0)
          .uvs.size(),
      3u);
  // What turns out to show nothing does not shine.
  const std::string lamp = "AttributeBegin\nNamedMaterial \"i\"\nAreaLightSource \"diffuse\"\n" + kPbrtSquare +
                           "AttributeEnd\nMakeNamedMaterial \"i\" \"string type\" ";
  const Scene dark = load(lamp + "\"interface\"\n");
  EXPECT_TRUE(dark.area_lights.empty());
  assumes(dark, "lights on an interface material");
  EXPECT_EQ(load(lamp + "\"diffuse\"\n").area_lights.size(), 1u);
  // Names that are never defined, at their first use; version 3 wants the definition first.
  fails("WorldBegin\nNamedMaterial \"aa\"\n" + kPbrtSphere + texture + material, "2:1", "did you mean \"a\"");
  fails("WorldBegin\n" + kPbrtSphere + "NamedMaterial \"m\"\n" + kPbrtSphere + mix + texture + material, "5:43",
        "no material with the name \"b\"");
  load(kPbrtSphere + "NamedMaterial \"a\"\n");
  fails("WorldBegin\nNamedMaterial \"a\"\n" + kPbrtSphere + texture + material + "WorldEnd\n", "2:1",
        "no material with the name");
  EXPECT_EQ(check_scene_file(folder_.write("s.pbrt", "WorldBegin\nNamedMaterial \"a\"\n" + kPbrtSphere + kPbrtSphere))
                .refused.size(),
            1u);
}

TEST_F(PbrtTest, Exposure) {
  const std::string light = "AreaLightSource \"diffuse\" \"rgb L\" [1 1 1]\n" + kPbrtSquare + "LightSource \"point\"\n";
  const auto radiance = [](const Scene& scene) {
    return std::pair(scene.textures[static_cast<std::size_t>(scene.area_lights[0].radiance)].color0.x,
                     scene.delta_lights[0].intensity.x);
  };
  const Scene now = load(light, "Camera \"perspective\" \"float shutterclose\" .5\nFilm \"rgb\" \"float iso\" 400\n");
  EXPECT_EQ(radiance(now), std::pair(2.0f, 2.0f));
  assumes(now, "iso and the shutter time");
  EXPECT_EQ(radiance(load(light + "WorldEnd\n", "Film \"image\" \"float scale\" 3\n")), std::pair(3.0f, 3.0f));
}

// Of a black body version 3 has 1 at its peak: against Planck's law with its peak found by search.
TEST_F(PbrtTest, OldBlackBodies) {
  const auto light = [](const Scene& scene) {
    return Vec3d(scene.textures[static_cast<std::size_t>(scene.area_lights[0].radiance)].color0);
  };
  const std::string text = "AreaLightSource \"diffuse\" \"blackbody L\" [5000 2]\n" + kPbrtSquare;
  const Spectrum s = blackbody_spectrum(5000.0);  // whose peak, at 580 nm, can be seen
  const double peak = *std::max_element(s.values.begin(), s.values.end());
  const Vec3d expected = Vec3d(spectrum_rgb(s, SpectrumUse::emission)) * (2.0 / peak);
  expect_near(light(load_old(text)), expected, 1e-3);
}

TEST_F(PbrtTest, Filters) {
  const auto film = [&](const std::string& filter, bool old = false) {
    return load(kPbrtSphere + (old ? "WorldEnd\n" : ""), "Camera \"perspective\"\n" + filter + "\n").film;
  };
  EXPECT_EQ(film("").filter, Film::Filter::gaussian);
  EXPECT_EQ(film("", true).filter, Film::Filter::box);
  EXPECT_EQ(film("PixelFilter \"triangle\" \"float xradius\" 1.5").filter_radius, 1.5f);
  EXPECT_EQ(film("PixelFilter \"gaussian\" \"float sigma\" .7").filter_stddev, 0.7f);
  EXPECT_NEAR(film("PixelFilter \"gaussian\" \"float alpha\" 8", true).filter_stddev, 0.25f, 1e-6f);
  EXPECT_EQ(film("PixelFilter \"sinc\" \"float tau\" 4").filter_radius, 4.0f);
}

// What the ray tracer cannot take, of any file.
TEST_F(PbrtTest, InstancesBeyondTheRayTracer) {
  const auto scaled = [](const std::string& by) {
    return "WorldBegin\nObjectBegin \"o\"\nShape \"disk\"\nObjectEnd\nScale " + by + " " + by + " " + by +
           "\nObjectInstance \"o\"\n";
  };
  fails(scaled("1e-20"), "6:1", "too much or too little");
  EXPECT_EQ(error(scaled("1e-12")), "no error");
}

TEST_F(PbrtTest, Includes) {
  folder_.write("part.pbrt", kPbrtSphere);
  EXPECT_EQ(load("Include \"part.pbrt\"\nTranslate 3 0 0\nInclude \"part.pbrt\"\n").spheres.size(), 2u);
  // An import keeps to itself what it changes.
  folder_.write("moved.pbrt", "Translate 5 0 0\n" + kPbrtSphere);
  EXPECT_EQ(load("Import \"moved.pbrt\"\n" + kPbrtSphere).spheres[1].center.x, 0.0f);
  EXPECT_EQ(load("Include \"moved.pbrt\"\n" + kPbrtSphere).spheres[1].center.x, 5.0f);
  folder_.write("self.pbrt", "Include \"self.pbrt\"\n");
  EXPECT_NE(error("Include \"self.pbrt\"\n").find("nested more than 16 deep"), std::string::npos);
}

TEST_F(PbrtTest, Mistakes) {
  fails("WorldBegin\nShpae \"sphere\"\n", "2:1", "did you mean \"Shape\"");
  fails("WorldBegin\nShape \"sphere\" \"float radius\" [1\n", "3:1", "expected a value");
  fails("WorldBegin\nShape \"sphere\" \"float radius\" \"x\"\n", "2:16", "must be one number");
  fails("WorldBegin\nShape \"sphere\" \"radius\" 1\n", "2:16", "the type and the name of a parameter");
  fails("WorldBegin\nShape \"sphere\" \"rgb radius\" [1 1 1]\n", "2:16", "must be of the type float or integer");
  fails("WorldBegin\nShape \"sphere\n", "2:7", "not closed");
  fails("WorldBegin\nTranslate 1 2\nShape \"sphere\"\n", "3:1", "expected a number");
  fails("WorldBegin\nTranslate 1 2 1e999\n", "2:15", "not a finite number");
  fails("WorldBegin\nAttributeEnd\n", "2:1", "without its beginning");
  fails("WorldBegin\nAttributeBegin\nTransformEnd\n", "3:1", "another block begins at");
  fails("WorldBegin\nShape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 1 1 0] \"integer indices\" [0 1 3]\n", "2:53",
        "out of range");
  fails("WorldBegin\nShape \"trianglemesh\"\n", "2:1", "needs the parameter \"P\"");
  fails("WorldBegin\nShape \"nurbs\"\n", "2:1", "is not supported");
  fails("WorldBegin\nMaterial \"difuse\"\n" + kPbrtSphere, "2:1", "did you mean \"diffuse\"");
  fails("WorldBegin\nNamedMaterial \"m\"\n" + kPbrtSphere, "2:1", "no material with the name");
  fails("WorldBegin\nMaterial \"diffuse\" \"texture reflectance\" \"t\"\n" + kPbrtSphere, "2:20",
        "no texture of colours");
  fails("WorldBegin\nTexture \"t\" \"spectrum\" \"fbm\"\nMaterial \"diffuse\" \"texture reflectance\" \"t\"\n" +
            kPbrtSphere,
        "2:1", "bake it into a picture");
  fails(
      "WorldBegin\nTexture \"t\" \"spectrum\" \"scale\" \"texture tex\" \"t\"\nMaterial \"diffuse\" \"texture reflectance\" \"t\"\n" +
          kPbrtSphere,
      "2:32", "nested too deep");
  fails("WorldBegin\nObjectInstance \"o\"\n", "2:1", "no object with the name");
  fails("WorldBegin\nMakeNamedMedium \"m\" \"string type\" \"homogeneous\"\nMediumInterface \"m\" \"\"\n", "3:1",
        "a medium is not supported");
  load("MakeNamedMedium \"m\" \"string type\" \"homogeneous\"\nMediumInterface \"\" \"\"\n" + kPbrtSphere);
  fails("Camera \"realistic\"\nWorldBegin\n" + kPbrtSphere, "1:1", "supported: perspective, orthographic");
  fails("LookAt 0 0 0 0 0 0 0 1 0\n", "1:1", "must differ");
  fails("WorldBegin\nInclude \"none.pbrt\"\n", "2:1", "does not exist");
  // What nothing uses is not looked at.
  load("Texture \"t\" \"spectrum\" \"fbm\"\nMakeNamedMaterial \"m\" \"string type\" \"fourier\"\n" + kPbrtSphere);
  assumes(load("Shape \"sphere\" \"float rdius\" 2\n"), "\"rdius\" of Shape \"sphere\" is left out");
  assumes(load("AttributeBegin\n" + kPbrtSphere), "ends with the file");
}

// Each parameter that nobody asks for is noted.
TEST_F(PbrtTest, ParametersThatAreLeftOut) {
  const auto left_out = [&](const std::string& text, const std::string& name) {
    assumes(load(text + kPbrtSphere), "the parameter \"" + name + "\" of ");
  };
  left_out("LightSource \"infinite\" \"point3 portal\" [0 0 0 1 0 0 1 1 0 0 1 0]\n", "portal");
  left_out("LightSource \"infinite\" \"float power\" 3\n", "power");
  left_out("Material \"coateddiffuse\" \"float thickness\" 1\n", "thickness");
  left_out("Material \"coateddiffuse\" \"integer maxdepth\" 1\n", "maxdepth");
  left_out("Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 1 1 0] \"vector3 S\" [1 0 0 1 0 0 1 0 0]\n", "S");
  left_out("Attribute \"shape\" \"float rdius\" 2\n", "rdius");
  left_out("Attribute \"light\" \"float scale\" 2\n", "scale");
  const std::string camera = "Camera \"perspective\" \"float lens\" 1\n",
                    film = "Film \"rgb\" \"float maxcomponentvalue\" 10 \"float diagonal\" 40\n",
                    filter = "PixelFilter \"triangle\" \"float xradius\" 1 \"float yradius\" 2 \"float b\" 1\n";
  const Scene scene = load(kPbrtSphere, camera + film + filter);
  for (const char* name : {"lens", "maxcomponentvalue", "diagonal", "b"})
    assumes(scene, "the parameter \"" + std::string(name) + "\" of ");
  assumes(scene, "filters are as high as they are wide");
  assumes(load_old("Material \"translucent\" \"rgb Ks\" [.5 .5 .5]\n" + kPbrtSphere), "the parameter \"Ks\" of ");
  // What steers sampling alone is not, nor what Attribute gives and one of the objects reads.
  const Scene quiet = load(
      "Attribute \"shape\" \"float radius\" 2\nShape \"disk\"\nShape \"trianglemesh\" \"point3 P\" "
      "[0 0 0 1 0 0 1 1 0]\nLightSource \"infinite\" \"integer samples\" 4\n",
      "Camera \"perspective\"\nSampler \"halton\" \"integer pixelsamples\" 4\nFilm \"rgb\" \"string filename\" "
      "\"a.exr\"\n");
  EXPECT_TRUE(quiet.assumed.empty()) << join(quiet.assumed, "\n");
}

// Without texture coordinates each triangle has (0, 0), (1, 0) and (1, 1), where something shows them: whatever the
// shape is read from.
TEST_F(PbrtTest, MeshesWithoutCoordinates) {
  write_exr((folder_.path() / "p.exr").string(), Image(2, 2, {"R", "G", "B"}));
  const auto ply = [](const std::string& names, const std::string& values) {
    return "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n" + names +
           "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0" + values + "\n1 0 0" + values +
           "\n0 1 0" + values + "\n3 0 1 2\n";
  };
  folder_.write("bare.ply", ply("", ""));
  folder_.write("st.ply", ply("property float texture_s\nproperty float texture_t\n", " .25 .125"));
  const std::string textured =
      "Texture \"p\" \"spectrum\" \"imagemap\" \"string filename\" \"p.exr\"\nMaterial \"diffuse\" \"texture reflectance\" \"p\"\n";
  const std::string points = "\"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1 2]\n";
  const std::string from_file = "Shape \"plymesh\" \"string filename\" \"bare.ply\"\n";
  const auto uvs = [this](const std::string& world) { return load(world).meshes.at(0).uvs; };
  const std::vector<Vec2f> corners = uvs(textured + "Shape \"trianglemesh\" " + points);
  ASSERT_EQ(corners.size(), 3u);
  EXPECT_EQ(corners[1].x, 1.0f);
  EXPECT_EQ(uvs(textured + from_file), corners);
  EXPECT_EQ(uvs("Material \"diffuse\" \"string normalmap\" \"p.exr\"\n" + from_file), corners);
  EXPECT_EQ(uvs(textured + "Shape \"loopsubdiv\" \"integer levels\" 0 " + points), corners);
  EXPECT_TRUE(uvs("Material \"diffuse\"\n" + from_file).empty());
  EXPECT_EQ(uvs(textured + "Shape \"plymesh\" \"string filename\" \"st.ply\"\n"),
            (std::vector<Vec2f>(3, Vec2f{0.25f, 0.875f})));
}

}  // namespace
}  // namespace octrad
