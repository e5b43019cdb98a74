// For tests of transport on streams: scenes with everything in them, on the CPU and on a stream.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "octrad/device/stream_test_helper.h"
#include "octrad/shading/test_fixtures.h"
#include "octrad/transport/camera_job.h"
#include "octrad/transport/device_memory.h"
#include "octrad/transport/prepared_scene.h"

namespace octrad::testing {

// The CPU traverses the same tree as the device.
struct DeviceSetup {
  PreparedScene prepared;
  const DeviceWorld& device;
  const Scene& scene = prepared.scene();
  TransportContext context = prepared.context();
  DeviceSetup(Stream& stream, Scene s)
      : prepared(std::move(s), PreparedScene::CpuTree::bvh8),
        device(prepared.world(stream)) {}
  const DeviceWorld& world() const { return device; }
};

struct BoxOptions {
  bool environment = true;
  bool lamp = true;
};

// An open room with a glossy floor, a lamp, a glass ball, a mirror ball and a curtain that lets half of the light pass,
// under a sky; the camera is before it.
inline Scene room(const BoxOptions& options = {}) {
  SceneMaker maker;
  const int white = maker.diffuse(Vec3f(0.7f), true);
  Material glass, mirror, mask, glossy;
  glass.type = BsdfType::dielectric;
  mirror.type = BsdfType::conductor;
  mask.reflectance = maker.texture(0.3f);
  mask.opacity = maker.texture(0.5f);
  mask.two_sided = true;
  glossy.type = BsdfType::roughplastic;
  glossy.reflectance = maker.texture(Vec3f(0.5f, 0.2f, 0.1f));
  glossy.alpha_u = maker.texture(0.1f);
  glossy.two_sided = true;
  maker.quad({-2, 0, 2}, {4, 0, 0}, {0, 0, -4}, maker.material(glossy));
  maker.quad({-2, 0, -2}, {4, 0, 0}, {0, 3, 0}, white);
  maker.quad({-2, 0, 2}, {0, 0, -4}, {0, 3, 0}, white);
  maker.quad({2, 0, -2}, {0, 0, 4}, {0, 3, 0}, maker.diffuse(Vec3f(0.2f, 0.6f, 0.3f)));  // one-sided, faces the room
  if (options.lamp) maker.quad({-0.5f, 2.9f, -0.5f}, {1, 0, 0}, {0, 0, 1}, white, Vec3f(8.0f, 7.0f, 5.0f));
  maker.sphere({-0.7f, 0.6f, -0.5f}, 0.6f, maker.material(glass));
  maker.sphere({0.8f, 0.6f, -0.8f}, 0.6f, maker.material(mirror));
  if (options.lamp) maker.sphere({0.1f, 0.3f, 0.6f}, 0.2f, white, Vec3f(2.0f));
  maker.quad({-1, 0.2f, 1}, {2, 0, 0}, {0, 1.5f, 0}, maker.material(mask));
  if (options.environment) {
    Environment e;
    e.width = 4;
    e.height = 3;
    for (int i = 0; i < 12; ++i) e.pixels.push_back(Vec3f(0.1f + 0.05f * static_cast<float>(i % 5), 0.2f, 0.3f));
    maker.scene.environments.push_back(e);
  }
  Camera camera = look_at({0.1f, 1.3f, 5.0f}, {0, 1, 0}, {0, 1, 0}, 50.0f, Camera::FovAxis::x);
  camera.film_width = 24;
  camera.film_height = 18;
  maker.scene.cameras.push_back(camera);
  return maker.scene;
}

inline CameraJob whole_picture(const Scene& scene, int count, unsigned long long seed = 3) {
  const Camera& camera = scene.cameras.front();
  CameraJob job;
  job.view = camera.view(camera.film_width, camera.film_height);
  job.seed = seed;
  job.width = camera.film_width;
  job.height = camera.film_height;
  job.count = count;
  return job;
}

// Planes in device memory, back on the host.
struct HostPlanes {
  std::vector<float> values;
  std::size_t stride = 0;
  HostPlanes(Stream& stream, const float* data, std::size_t plane_stride, int numbers)
      : values(plane_stride * static_cast<std::size_t>(numbers)),
        stride(plane_stride) {
    stream.download(values.data(), data, values.size() * sizeof(float));
  }
  FloatPlanes planes() { return {values.data(), stride}; }
};

template <typename T>
std::vector<T> fetch(Stream& stream, const T* data, std::size_t count) {
  std::vector<T> values(count);
  if (count > 0) stream.download(values.data(), data, count * sizeof(T));
  return values;
}

inline bool same_bits(Vec3f a, Vec3f b) { return std::memcmp(&a, &b, sizeof(a)) == 0; }

inline bool close(Vec3f a, Vec3f b) { return length(a - b) <= 2e-3f * (length(a) + length(b)) + 1e-5f; }

// On the host the same bits. On a device rounding separates some, and then means agree within 3 standard errors of the
// differences (and 0.1 %).
inline void expect_same(const Stream& stream, std::span<const Vec3f> found, std::span<const Vec3f> expected,
                        double share = 0.97) {
  ASSERT_EQ(found.size(), expected.size());
  const auto n = static_cast<double>(found.size());
  std::size_t same = 0, near = 0, first = found.size();
  double sum = 0.0, square = 0.0, size = 0.0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    const bool equal = same_bits(found[i], expected[i]);
    same += equal;
    near += equal || close(found[i], expected[i]);
    if (!equal && first == found.size()) first = i;
    const double d = static_cast<double>(luminance(found[i])) - static_cast<double>(luminance(expected[i]));
    sum += d;
    square += d * d;
    size += std::fabs(static_cast<double>(luminance(expected[i])));
  }
  if (!stream.on_device()) {
    EXPECT_EQ(same, found.size()) << "first difference at " << first << ": "
                                  << (first < found.size() ? found[first].x : 0.0f) << " instead of "
                                  << (first < found.size() ? expected[first].x : 0.0f);
    return;
  }
  EXPECT_GE(static_cast<double>(near), share * n);
  const double error = std::sqrt(square / n / n);
  EXPECT_NEAR(sum / n, 0.0, 3.0 * error + 1e-3 * size / n);
}

}  // namespace octrad::testing
