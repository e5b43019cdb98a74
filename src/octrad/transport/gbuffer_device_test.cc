// First hits on streams against following the camera's rays on the CPU, sample by sample.
#include "octrad/transport/gbuffer_device.h"

#include "octrad/transport/device_test_helper.h"

namespace octrad {
namespace {

using testing::DeviceSetup;
using Bounce = FirstHitOptions::Bounce;

class DeviceGBuffers : public ::testing::TestWithParam<bool> {};

Vec3f answer(const SurfacePoint& p) {
  return {0.5f + 0.4f * std::sin(3.0f * p.x.x), p.albedo.y, p.alpha + p.disparity};
}
Vec3f right_hand_side(const ShadingPoint& p, unsigned long long key) {
  return {p.surface.position.y, p.wo.z, static_cast<float>(key % 1000)};
}

void expect_cpu_samples(Stream& stream, const FirstHitOptions& options, bool traced) {
  const DeviceSetup setup(stream, testing::room());
  const CameraJob job = testing::whole_picture(setup.scene, 3);
  const std::size_t n = job.size();
  std::vector<Vec3f> radiance, attributes;
  std::uint32_t queries = 0, bounces = 0;
  unsigned long long rays = 0;
  for (std::uint32_t k = 0; k < n; ++k) {
    CameraSample sample = job.sample(k);
    FirstHit first;
    RayEnd end;
    const FirstHitQuery query = trace_first_hit(setup.context, options, sample, end, first);
    rays += static_cast<unsigned long long>(end.rays);
    Vec3f sum = query.known;
    if (query.next == FirstHitQuery::Next::bounce) {
      sum += end.throughput * right_hand_side(end.point, query.key);
      ++bounces;
    } else if (query.next == FirstHitQuery::Next::query) {
      rays += traced;
      sum += end.throughput * answer(field_query_point(setup.context, end.point, traced));
      ++queries;
    }
    radiance.push_back(sum);
    attributes.push_back(first.albedo);
    attributes.push_back(first.normal);
    attributes.push_back({first.depth, first.roughness, 0.0f});
  }
  EXPECT_EQ(bounces > 0, options.bounce != Bounce::none);
  EXPECT_EQ(queries > 0, options.bounce != Bounce::all);

  DeviceGBuffer buffer(stream, setup.world(), n + 100, options.bounce != Bounce::none, traced);
  buffer.set(job);
  const auto graph = stream.capture([&] { buffer.run(options); });
  for (int again = 0; again < 2; ++again) {
    stream.replay(*graph);
    const std::uint32_t asked = testing::fetch(stream, buffer.query_count(), 1)[0],
                        bounced = testing::fetch(stream, buffer.bounce_count(), 1)[0];
    testing::HostPlanes host(stream, buffer.queries().data, buffer.queries().stride, kSurfacePointNumbers);
    std::vector<Vec3f> answers, right;
    for (std::uint32_t q = 0; q < asked; ++q)
      answers.push_back(answer(SurfacePointArray{host.values.data(), host.stride}.load(q)));
    const auto points = testing::fetch(stream, buffer.bounce_points(), bounced);
    const auto keys = testing::fetch(stream, buffer.bounce_keys(), bounced);
    for (std::uint32_t b = 0; b < bounced; ++b) right.push_back(right_hand_side(points[b], keys[b]));
    const DeviceArray<Vec3f> device_answers(stream, std::span<const Vec3f>(answers), "answers"),
        device_right(stream, std::span<const Vec3f>(right), "right");
    buffer.add(device_answers.data(), device_right.data());
    testing::HostPlanes samples(stream, buffer.samples().data, buffer.samples().stride, kSampleNumbers);
    std::vector<Vec3f> found, found_attributes;
    for (std::uint32_t k = 0; k < n; ++k) {
      found.push_back(samples.planes().get3(0, k));
      found_attributes.push_back(samples.planes().get3(3, k));
      found_attributes.push_back(samples.planes().get3(6, k));
      found_attributes.push_back({samples.planes().get(9, k), samples.planes().get(10, k), 0.0f});
    }
    testing::expect_same(stream, found, radiance);
    testing::expect_same(stream, found_attributes, attributes);
    const TraceCounts counts = buffer.take_counts();
    if (stream.on_device()) {
      EXPECT_NEAR(static_cast<double>(counts.rays), static_cast<double>(rays), 0.01 * static_cast<double>(rays));
    } else {
      EXPECT_EQ(counts.rays, rays);
      EXPECT_EQ(counts.queries, queries);
      EXPECT_EQ(bounced, bounces);
    }
  }
}

TEST_P(DeviceGBuffers, SeeWhatTheCpuSees) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  for (const bool follow : {false, true}) {
    for (const Bounce bounce : {Bounce::none, Bounce::glossy, Bounce::all}) {
      SCOPED_TRACE(static_cast<int>(bounce) + 10 * follow);
      FirstHitOptions options;
      options.follow_delta = follow;
      options.bounce = bounce;
      options.emission_inside = follow;
      options.max_chain = 5;
      expect_cpu_samples(*stream, options, bounce == Bounce::glossy);
    }
  }
}

TEST_P(DeviceGBuffers, MemoryIsWhatWasSaid) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  const DeviceSetup setup(*stream, testing::room());
  for (const bool all : {false, true}) {
    const std::size_t before = stream->allocated_bytes(), n = 100'000;
    const DeviceGBuffer buffer(*stream, setup.world(), n, all, all);
    const auto taken = static_cast<double>(stream->allocated_bytes() - before),
               said = static_cast<double>(DeviceGBuffer::bytes(n, all, all));
    EXPECT_NEAR(taken, said, 0.01 * said);
  }
}

INSTANTIATE_TEST_SUITE_P(All, DeviceGBuffers, ::testing::Values(false, true), testing::stream_name);

}  // namespace
}  // namespace octrad
