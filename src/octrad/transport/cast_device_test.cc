// cast() against one ray at a time: warps that take new rays lose none, and none is answered twice.
#include "octrad/transport/cast.h"

#include <cstring>
#include <span>
#include <vector>

#include "octrad/base/rng.h"
#include "octrad/device/array.h"
#include "octrad/device/stream_test_helper.h"
#include "octrad/scene/sample_scenes.h"
#include "octrad/transport/prepared_scene.h"

namespace octrad {
namespace {

struct Answer {
  Hit hit;
  std::uint32_t blocked = 0, times = 0;
};

template <bool kAnyHit>
struct CastAnswers : Kernel {
  Bvh8View tree;
  const std::uint32_t* rays_here;
  const RayQuery* rays;
  Answer* answers;
  std::uint32_t* launches;
  static constexpr bool kAny = kAnyHit;
  OCTRAD_HD Bvh8View bvh() const { return tree; }
  OCTRAD_HD std::uint32_t size() const { return *rays_here; }
  OCTRAD_HD void count() const { ++*launches; }
  OCTRAD_HD RayQuery ray(std::uint32_t i) const { return rays[i]; }
  OCTRAD_HD void met(std::uint32_t i, const Hit& hit) const {
    answers[i].hit = hit;
    atomic_add(&answers[i].times, 1u);
  }
  OCTRAD_HD void met(std::uint32_t i, bool any) const {
    answers[i].blocked = any ? 1 : 0;
    atomic_add(&answers[i].times, 1u);
  }
};

class DeviceCasts : public testing::StreamTest {};

TEST_P(DeviceCasts, EveryRayIsAnsweredOnce) {
  const PreparedScene scene(testing::open_room());
  constexpr std::uint32_t kMost = 40000;
  std::vector<RayQuery> rays(kMost);
  Rng rng(51, RngPurpose::test, 0);
  for (std::uint32_t i = 0; i < kMost; ++i) {
    const Vec3f direction = uniform_direction(rng.uniform2());
    rays[i] = {{rng.uniform(), 1.0f + rng.uniform(), rng.uniform()}, direction, i % 3 == 0 ? 2.0f : 1e30f};
    if (i % 7 == 0) rays[i].direction = Vec3f(0.0f);   // meets nothing, at once
    if (i / 100 % 5 == 0) rays[i].origin.y += 100.0f;  // whole warps that pass by
  }
  const DeviceArray<RayQuery> device_rays(*stream, std::span<const RayQuery>(rays), "test");
  const Bvh8View tree = scene.bvh8().view();
  for (const std::uint32_t n : {0u, 1u, 31u, 32u, 33u, 4097u, kMost}) {
    for (const auto& [capacity, dynamic] : {std::pair{n, false}, {kMost, false}, {n, true}, {kMost, true}}) {
      stream->tuning.cast_dynamic = dynamic;
      DeviceArray<std::uint32_t> taken(*stream, 2, "test");
      taken.fill(0);
      const std::vector<std::uint32_t> size = {n};
      const DeviceArray<std::uint32_t> device_size(*stream, std::span<const std::uint32_t>(size), "test");
      DeviceArray<Answer> closest(*stream, kMost, "test"), any(*stream, kMost, "test");
      DeviceArray<std::uint32_t> launches(*stream, 1, "test");
      closest.fill(0);
      any.fill(0);
      launches.fill(0);
      cast(*stream, capacity,
           CastAnswers<false>{
               {}, scene.world(*stream).bvh, device_size.data(), device_rays.data(), closest.data(), launches.data()},
           taken.data());
      cast(*stream, capacity,
           CastAnswers<true>{
               {}, scene.world(*stream).bvh, device_size.data(), device_rays.data(), any.data(), launches.data()},
           taken.data() + 1);
      const std::vector<Answer> hits = closest.download(), blocked = any.download();
      EXPECT_EQ(launches.download()[0], capacity == 0 ? 0u : 2u);
      int found = 0;
      for (std::uint32_t i = 0; i < kMost; ++i) {
        ASSERT_EQ(hits[i].times, i < n ? 1u : 0u) << i << " of " << n;
        ASSERT_EQ(blocked[i].times, i < n ? 1u : 0u) << i << " of " << n;
        if (i >= n) continue;
        const Hit expected = bvh8_intersect(tree, rays[i].origin, rays[i].direction, 0.0f, rays[i].t_max);
        ASSERT_EQ(hits[i].hit.shape, expected.shape) << i;
        ASSERT_EQ(hits[i].hit.primitive, expected.primitive) << i;
        ASSERT_FLOAT_EQ(hits[i].hit.t, expected.t) << i;
        if (!stream->on_device()) {
          ASSERT_EQ(std::memcmp(&hits[i].hit, &expected, sizeof(Hit)), 0) << i;
        }
        ASSERT_EQ(blocked[i].blocked, expected.valid() ? 1u : 0u) << i;
        found += expected.valid() ? 1 : 0;
      }
      if (n == kMost) {
        EXPECT_GT(found, 10000);
      }
    }
  }
}

// Shares are disjoint, complete and of whole warps.
TEST(Casts, SharesCoverAllRays) {
  for (const std::uint32_t size : {0u, 1u, 32u, 1000u, 131072u, 4000000000u}) {
    for (const std::uint32_t warps : {1u, 3u, 4096u}) {
      std::uint32_t next = 0;
      for (std::uint32_t warp = 0; warp < warps; ++warp) {
        const cast_detail::Share share = cast_detail::share_of(warp, warps, size);
        EXPECT_EQ(share.first, next);
        EXPECT_GE(share.last, share.first);
        EXPECT_TRUE(share.last == size || share.last % 32 == 0);
        next = share.last;
      }
      EXPECT_EQ(next, size);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, DeviceCasts, ::testing::Bool(), testing::stream_name);

}  // namespace
}  // namespace octrad
