// Rays against Mitsuba 3.9.1's (sensor.sample_ray of a 40 x 20 film), camera files, picture sizes.
#include "octrad/scene/camera.h"

#include <gtest/gtest.h>

#include "octrad/base/error.h"
#include "octrad/base/folder_test_helper.h"
#include "octrad/scene/load.h"
#include "octrad/scene/mitsuba_world_test_data.h"

namespace octrad {
namespace {

struct ExpectedCamera {
  Vec2f at;  // relative position on the film
  Vec3f origin, direction;
  float t_max;
};

void expect_rays(const Camera& camera, std::initializer_list<ExpectedCamera> rays, int width = 40, int height = 20) {
  for (const ExpectedCamera& e : rays) {
    const Ray ray = camera_ray(camera.view(width, height),
                               {e.at.x * static_cast<float>(width), e.at.y * static_cast<float>(height)});
    EXPECT_LT(length(ray.direction - e.direction), 2e-6f)
        << e.at.x << " " << e.at.y << ": " << ray.direction.x << " " << ray.direction.y << " " << ray.direction.z;
    EXPECT_LT(length(ray.origin - e.origin), 2e-6f) << e.at.x << " " << e.at.y;
    EXPECT_NEAR(ray.t_max / e.t_max, 1.0f, 1e-5f);
    EXPECT_NEAR(length(ray.direction), 1.0f, 1e-6f);
  }
}

Camera camera_60(Camera::FovAxis axis) {
  Camera c;
  c.right = {-1, 0, 0};  // camera to world is the identity
  c.fov_degrees = 60.0f;
  c.fov_axis = axis;
  return c;
}

TEST(Camera, FieldOfViewAlongX) {
  expect_rays(
      camera_60(Camera::FovAxis::x),
      {{{0, 0}, {0.005773502f, 0.002886751f, 0.01f}, {0.4850713f, 0.2425356f, 0.8401681f}, 11902.368f},
       {{1, 0}, {-0.005773502f, 0.002886751f, 0.01f}, {-0.4850713f, 0.2425356f, 0.8401681f}, 11902.368f},
       {{0.25f, 0.75f}, {0.002886752f, -0.001443375f, 0.01f}, {0.2747211f, -0.1373605f, 0.9516619f}, 10507.924f}});
  expect_rays(camera_60(Camera::FovAxis::larger),
              {{{0, 0}, {0.005773502f, 0.002886751f, 0.01f}, {0.4850713f, 0.2425356f, 0.8401681f}, 11902.368f}});
}

TEST(Camera, FieldOfViewAlongYAndDiagonal) {
  for (const Camera::FovAxis axis : {Camera::FovAxis::y, Camera::FovAxis::smaller}) {
    expect_rays(
        camera_60(axis),
        {{{0, 0}, {0.01154700f, 0.005773502f, 0.01f}, {0.7071068f, 0.3535534f, 0.6123724f}, 16329.916f},
         {{0.25f, 0.75f}, {0.005773503f, -0.002886751f, 0.01f}, {0.4850713f, -0.2425355f, 0.8401681f}, 11902.369f}});
  }
  expect_rays(
      camera_60(Camera::FovAxis::diagonal),
      {{{0, 0}, {0.005163977f, 0.002581989f, 0.01f}, {0.4472136f, 0.2236068f, 0.8660254f}, 11546.993f},
       {{0.25f, 0.75f}, {0.002581989f, -0.001290994f, 0.01f}, {0.2480695f, -0.1240347f, 0.9607689f}, 10408.319f}});
}

TEST(Camera, LookAtOffsetAndClipping) {
  Camera c = look_at({1, 2, 3}, {0, 0, 1}, {0, 1, 0}, 60.0f, Camera::FovAxis::x);
  expect_rays(
      c, {{{0, 0}, {0.9906420f, 1.9954849f, 2.9941940f}, {-0.7862272f, -0.3793367f, -0.4878019f}, 11902.368f},
          {{1, 0}, {1.0009700f, 1.9954849f, 2.9890301f}, {0.0814947f, -0.3793367f, -0.9216629f}, 11902.368f},
          {{0.25f, 0.75f}, {0.9945150f, 1.9922575f, 2.9954851f}, {-0.5219857f, -0.7368237f, -0.4296763f}, 10507.923f}});
  Camera clipped = c;
  clipped.near_clip = 1.0f;
  clipped.far_clip = 3.0f;
  expect_rays(
      clipped,
      {{{0, 0}, {0.0642025f, 1.5484990f, 2.4193995f}, {-0.7862272f, -0.3793367f, -0.4878019f}, 2.3804760f},
       {{0.25f, 0.75f}, {0.4515009f, 1.2257504f, 2.5484991f}, {-0.5219857f, -0.7368237f, -0.4296763f}, 2.1015868f}});
  Camera shifted = c;
  shifted.principal_point_offset = {0.1f, 0.2f};
  expect_rays(
      shifted,
      {{{0, 0}, {0.9920191f, 1.9946244f, 2.9943662f}, {-0.7157457f, -0.4821020f, -0.5052579f}, 11150.476f},
       {{1, 0}, {1.0023470f, 1.9946244f, 2.9892023f}, {0.1909994f, -0.4374661f, -0.8787165f}, 12288.192f},
       {{0.25f, 0.75f}, {0.9958920f, 1.9913968f, 2.9956572f}, {-0.3921217f, -0.8212126f, -0.4145485f}, 10476.153f}});
}

TEST(Camera, SensorsOfScenesAreMitsubas) {
  const TestFolder folder;
  std::vector<Camera> cameras;
  for (const char* sensor : kMitsubaSensors) {
    cameras.push_back(load_scene(folder.write("s.xml", std::string("<scene version=\"3.0.0\"><shape type=\"cube\"/>") +
                                                           sensor + "</scene>"))
                          .cameras.at(0));
  }
  for (const MitsubaRay& expected : kMitsubaRays) {
    SCOPED_TRACE(kMitsubaSensors[expected.sensor]);
    const Camera& c = cameras[static_cast<std::size_t>(expected.sensor)];
    const Vec2f pixel{expected.position.x * static_cast<float>(c.film_width),
                      expected.position.y * static_cast<float>(c.film_height)};
    const Ray ray = camera_ray(c.view(c.film_width, c.film_height), pixel);
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR(ray.origin[i], expected.origin[i], 1e-5f);
      EXPECT_NEAR(ray.direction[i], expected.direction[i], 1e-5f);
    }
    EXPECT_NEAR(ray.t_max, expected.t_max, 1e-4f * expected.t_max);
    if (c.kind != CameraKind::thinlens) continue;
    // Whatever the point of the lens, rays meet where the one through its centre crosses the plane in focus.
    const CameraView view = c.view(c.film_width, c.film_height);
    const Ray centre = camera_ray(view, pixel);
    const Vec3f focus = c.origin + centre.direction * (c.focus_distance / dot(centre.direction, c.forward));
    Rng rng(1, RngPurpose::test, 0);
    double radius2 = 0.0;
    constexpr int kRays = 4000;
    for (int i = 0; i < kRays; ++i) {
      const Ray r = sample_camera_ray(view, pixel, rng);
      const Vec3f to_focus = focus - r.origin;
      EXPECT_LT(length(cross(to_focus, r.direction)), 2e-5f);
      EXPECT_NEAR(dot(r.direction * r.t_max, c.forward), c.far_clip - c.near_clip, 1e-3f);
      const Vec3f on_lens = r.origin - r.direction * (c.near_clip / dot(r.direction, c.forward)) - c.origin;
      EXPECT_NEAR(dot(on_lens, c.forward), 0.0f, 1e-5f);
      radius2 += static_cast<double>(dot(on_lens, on_lens)) / kRays;
    }
    EXPECT_NEAR(std::sqrt(2.0 * radius2), c.aperture_radius, 0.003) << "uniform on a disk of that radius";
  }
}

TEST(Camera, LookAtRefusesDegenerateViews) {
  EXPECT_THROW(look_at({1, 2, 3}, {1, 2, 3}, {0, 1, 0}, 60.0f, Camera::FovAxis::x), InputError);
  EXPECT_THROW(look_at({0, 0, 0}, {0, 5, 0}, {0, 1, 0}, 60.0f, Camera::FovAxis::x), InputError);
  EXPECT_THROW(look_at({0, 0, 0}, {0, 0, 5}, {0, 1, 0}, 180.0f, Camera::FovAxis::x), InputError);
}

TEST(Camera, FilesOfCameras) {
  const TestFolder folder;
  const std::string file = folder.write(
      "c.json", R"([{"origin": [1,2,3], "target": [0,0,1], "fov": 60, "fov_axis": "y", "width": 40, "height": 20},
    {"to_world": [-1,0,0,4, 0,1,0,5, 0,0,-1,6, 0,0,0,1], "fov": 50}])");
  const std::vector<Camera> cameras = read_cameras(file);
  ASSERT_EQ(cameras.size(), 2u);
  const auto one = [&](const std::string& more) {
    return read_cameras(folder.write("d.json", R"({"origin": [0,0,4], "target": [0,0,0], )" + more + "}"))[0];
  };
  // The same ray from the other side of the picture; as a transform that mirrors along x says it.
  const Camera plain = one(R"("fov": 50)"), mirrored = one(R"("fov": 50, "mirrored": true)");
  EXPECT_FALSE(plain.mirrored() || one(R"("fov": 50, "mirrored": false)").mirrored() || Camera().mirrored());
  EXPECT_TRUE(mirrored.mirrored());
  EXPECT_EQ(camera_ray(mirrored.view(30, 20), {5, 7}).direction, camera_ray(plain.view(30, 20), {25, 7}).direction);
  const std::string matrix = R"({"to_world": [1,0,0,0, 0,1,0,0, 0,0,-1,4, 0,0,0,1], "fov": 50)";
  const Camera by_matrix = read_cameras(folder.write("e.json", matrix + "}"))[0];
  EXPECT_TRUE(by_matrix.mirrored());
  EXPECT_EQ(camera_ray(by_matrix.view(30, 20), {5, 7}).direction, camera_ray(mirrored.view(30, 20), {5, 7}).direction);
  EXPECT_THROW(read_cameras(folder.write("e.json", matrix + R"(, "mirrored": true})")), InputError);
  EXPECT_THROW(one(R"("fov": 50, "mirrored": 1)"), InputError);
  const Camera wide = one(R"("type": "orthographic", "view_width": 3, "width": 30, "height": 20)");
  const Ray corner = camera_ray(wide.view(30, 20), {0, 0});
  EXPECT_NEAR(corner.origin.x, -1.5f, 1e-6f);
  EXPECT_NEAR(corner.origin.y, 1.0f, 1e-6f);
  EXPECT_EQ(corner.direction, Vec3f(0, 0, -1));
  const Camera lens = one(R"("type": "thinlens", "aperture_radius": 0.1, "focus_distance": 2, "fov": 30)");
  EXPECT_EQ(lens.aperture_radius, 0.1f);
  EXPECT_THROW(one(R"("type": "orthographic")"), InputError);
  EXPECT_THROW(one(R"("type": "thinlens", "aperture_radius": 0.1)"), InputError);
  EXPECT_THROW(one(R"("view_width": 3)"), InputError);
  EXPECT_THROW(one(R"("type": "fisheye")"), InputError);
  const Camera expected = look_at({1, 2, 3}, {0, 0, 1}, {0, 1, 0}, 60.0f, Camera::FovAxis::y);
  EXPECT_EQ(cameras[0].forward, expected.forward);
  EXPECT_EQ(cameras[0].right, expected.right);
  EXPECT_EQ(cameras[0].fov_axis, Camera::FovAxis::y);
  EXPECT_EQ(cameras[0].film_width, 40);
  EXPECT_EQ(cameras[1].origin, Vec3f(4, 5, 6));
  EXPECT_EQ(cameras[1].right, Vec3f(1, 0, 0));
  EXPECT_EQ(cameras[1].forward, Vec3f(0, 0, -1));
  EXPECT_EQ(cameras[1].fov_degrees, 50.0f);

  const auto message = [&](const std::string& text) -> std::string {
    try {
      read_cameras(folder.write("bad.json", text));
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_NE(message("[{\"origin\": [1,2], \"target\": [0,0,0]}]").find("camera 1: \"origin\" must be a list of 3"),
            std::string::npos);
  EXPECT_NE(message("{\"orign\": [1,2,3]}").find("did you mean \"origin\""), std::string::npos);
  EXPECT_NE(message("[]").find("expected a camera"), std::string::npos);
  EXPECT_NE(message("[1]").find("must be an object"), std::string::npos);
  EXPECT_NE(message("[{").find("bad.json"), std::string::npos);
  EXPECT_NE(message("{\"origin\": [0,0,0], \"target\": [0,0,0]}").find("define no view"), std::string::npos);
  EXPECT_NE(message("{\"origin\": [0,0,0], \"target\": [0,0,1], \"fov\": 190}").find("\"fov\""), std::string::npos);
  EXPECT_NE(message("{\"origin\": [0,0,0], \"target\": [0,0,1], \"fov_axis\": \"z\"}").find("supported: x, y"),
            std::string::npos);
  EXPECT_NE(message("{\"to_world\": [2,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]}").find("scale"), std::string::npos);
  EXPECT_THROW(read_cameras(folder.file("none.json")), IoError);
}

TEST(Camera, PictureSizeKeepsTheAspect) {
  EXPECT_EQ(picture_size(1280, 720, 0, 0), (Vec2i{1280, 720}));
  EXPECT_EQ(picture_size(1280, 720, 256, 0), (Vec2i{256, 144}));
  EXPECT_EQ(picture_size(1280, 720, 0, 360), (Vec2i{640, 360}));
  EXPECT_EQ(picture_size(1280, 720, 10, 20), (Vec2i{10, 20}));
  EXPECT_EQ(picture_size(1280, 720, 1, 0), (Vec2i{1, 1}));
}

}  // namespace
}  // namespace octrad
