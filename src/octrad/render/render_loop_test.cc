#include "octrad/render/render_loop.h"

#include <gtest/gtest.h>

#include <atomic>

#include "octrad/base/error.h"
#include "octrad/base/threads.h"
#include "octrad/render/path_integrator.h"
#include "octrad/shading/test_fixtures.h"

namespace octrad {
namespace {

RenderOptions small(Film::Filter filter, int spp) {
  RenderOptions o;
  o.camera = look_at({0, 0, 5}, {0, 0, 0}, {0, 1, 0}, 40.0f, Camera::FovAxis::x);
  o.width = 53;
  o.height = 37;
  o.spp = spp;
  o.film.filter = filter;
  o.film.filter_radius = 0.0f;
  o.seed = 7;
  return o;
}

// Radiance that depends on the position and on the sample's own random numbers.
SampleCounts noisy(std::span<CameraSample> samples, std::span<PixelSample> out) {
  for (std::size_t i = 0; i < samples.size(); ++i) {
    out[i].radiance = Vec3f(samples[i].position.x, samples[i].position.y, 0.3f + samples[i].rng.uniform());
    out[i].depth = 2.0f;
  }
  SampleCounts counts;
  counts.queries = static_cast<long long>(samples.size());
  return counts;
}

constexpr Film::Filter kFilters[] = {Film::Filter::box, Film::Filter::tent, Film::Filter::gaussian};

TEST(RenderLoop, SameBitsAtAnyThreadCount) {
  for (const Film::Filter filter : kFilters) {
    set_thread_count(1);
    const RenderResult one = render(small(filter, 5), noisy);
    set_thread_count(3);
    const RenderResult three = render(small(filter, 5), noisy);
    set_thread_count(0);
    EXPECT_EQ(one.image.data, three.image.data);
    EXPECT_EQ(one.spp, 5);
    EXPECT_EQ(one.counts.queries, one.samples);
    RenderOptions other = small(filter, 5);
    other.seed = 8;
    EXPECT_NE(render(other, noisy).image.data, one.image.data);
  }
}

TEST(RenderLoop, CropIsThatPartOfThePicture) {
  for (const Film::Filter filter : kFilters) {
    const RenderResult whole = render(small(filter, 3), noisy);
    RenderOptions o = small(filter, 3);
    o.crop = {11, 9, 20, 17};
    const RenderResult part = render(o, noisy);
    ASSERT_EQ(part.width, 20);
    ASSERT_EQ(part.height, 17);
    for (int y = 0; y < 17; ++y) {
      for (int x = 0; x < 20; ++x) ASSERT_EQ(part.image.rgb(x, y), whole.image.rgb(x + 11, y + 9)) << x << " " << y;
    }
  }
}

// Filters are normalised and symmetric: a constant stays itself, a ramp keeps its values on average.
TEST(RenderLoop, FiltersKeepConstantsAndRamps) {
  for (const Film::Filter filter : kFilters) {
    const RenderResult r = render(small(filter, 64), noisy);
    const int depth = r.image.channel("depth.Z");
    double sum = 0.0;
    for (int y = 4; y < 33; ++y) {
      for (int x = 4; x < 49; ++x) {
        EXPECT_NEAR(r.image.at(x, y, depth), 2.0f, 1e-5f);
        EXPECT_NEAR(r.image.rgb(x, y).x, static_cast<float>(x) + 0.5f, 0.3f);
        sum += static_cast<double>(r.image.rgb(x, y).x) - x - 0.5;
      }
    }
    EXPECT_NEAR(sum / (29 * 45), 0.0, 0.01);
  }
}

TEST(RenderLoop, WideFiltersBlurAsFarAsTheyReach) {
  const auto spot = [](std::span<CameraSample> samples, std::span<PixelSample> out) {
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const Vec2f p = samples[i].position;
      if (p.x >= 20.0f && p.x < 21.0f && p.y >= 20.0f && p.y < 21.0f) out[i].radiance = Vec3f(1.0f);
    }
    return SampleCounts{};
  };
  // The share of a pixel's weight that falls into its neighbour: tent 1/8 along one axis (3/4 stays in the pixel).
  const RenderResult tent = render(small(Film::Filter::tent, 600), spot);
  EXPECT_NEAR(tent.image.rgb(20, 20).x, 0.75f * 0.75f, 0.02f);
  EXPECT_NEAR(tent.image.rgb(21, 20).x, 0.125f * 0.75f, 0.01f);
  EXPECT_NEAR(tent.image.rgb(21, 21).x, 0.125f * 0.125f, 0.005f);
  EXPECT_EQ(tent.image.rgb(22, 20).x, 0.0f);
  const RenderResult box = render(small(Film::Filter::box, 4), spot);
  EXPECT_EQ(box.image.rgb(20, 20).x, 1.0f);
  EXPECT_EQ(box.image.rgb(21, 20).x, 0.0f);
}

TEST(RenderLoop, StopsWhenAsked) {
  RenderOptions o = small(Film::Filter::box, 0);
  o.seconds = 0.05;
  const RenderResult timed = render(o, noisy);
  EXPECT_GE(timed.spp, 1);
  EXPECT_FALSE(timed.interrupted);
  // The same number of samples without a clock gives the same picture.
  EXPECT_EQ(render(small(Film::Filter::box, timed.spp), noisy).image.data, timed.image.data);
  o = small(Film::Filter::gaussian, 1000000);
  int asked = 0;
  o.interrupted = [&] { return ++asked > 3; };
  std::vector<int> reported;
  o.progress = [&](int spp, double) { reported.push_back(spp); };
  const RenderResult stopped = render(o, noisy);
  EXPECT_TRUE(stopped.interrupted);
  EXPECT_EQ(reported, (std::vector<int>{1, 2, 4}));
  EXPECT_EQ(stopped.spp, 4);
  EXPECT_EQ(render(small(Film::Filter::gaussian, 4), noisy).image.data, stopped.image.data);
}

TEST(RenderLoop, NonFiniteSamplesAreBlackAndCounted) {
  const RenderResult r =
      render(small(Film::Filter::box, 1), [](std::span<CameraSample> samples, std::span<PixelSample> out) {
        for (std::size_t i = 0; i < samples.size(); ++i)
          out[i].radiance = Vec3f(samples[i].position.x < 1.0f ? NAN : 1.0f);
        return SampleCounts{};
      });
  EXPECT_EQ(r.counts.non_finite, 37);
  EXPECT_EQ(r.image.rgb(0, 5).x, 0.0f);
  EXPECT_EQ(r.image.rgb(1, 5).x, 1.0f);
}

TEST(RenderLoop, RefusesNonsense) {
  RenderOptions o = small(Film::Filter::box, 1);
  o.width = 0;
  EXPECT_THROW(render(o, noisy), UsageError);
  o = small(Film::Filter::box, 0);
  EXPECT_THROW(render(o, noisy), UsageError);
  o = small(Film::Filter::box, 1);
  o.crop = {50, 0, 10, 10};
  EXPECT_THROW(render(o, noisy), UsageError);
  o = small(Film::Filter::tent, 1);
  o.film.filter_radius = 20.0f;
  EXPECT_THROW(render(o, noisy), InputError);
}

// A diffuse sphere that emits and a mirror floor, filmed: threads, layers and counters of the whole path integrator.
TEST(PathIntegrator, PictureWithLayers) {
  testing::SceneMaker maker;
  maker.sphere({0, 0, 0}, 1.0f, maker.diffuse(Vec3f(0.6f, 0.5f, 0.4f)), Vec3f(2.0f));
  Material mirror;
  mirror.type = BsdfType::conductor;
  maker.quad({-4, -1.02f, 4}, {8, 0, 0}, {0, 0, -8}, maker.material(mirror));
  const Scene& scene = maker.scene;
  const PreparedScene prepared(scene);
  const TransportContext context = prepared.context();
  RenderOptions o = small(Film::Filter::box, 4);
  set_thread_count(1);
  const RenderResult r = render_path(context, o);
  set_thread_count(2);
  EXPECT_EQ(render_path(context, o).image.data, r.image.data);
  set_thread_count(0);
  EXPECT_EQ(r.image.channels, picture_channels());
  EXPECT_GT(r.counts.rays, r.samples);
  EXPECT_EQ(r.counts.non_finite, 0);
  const int x = 26, y = 18;
  EXPECT_NEAR(r.image.rgb(x, y).x, 2.0f, 1e-5f);
  EXPECT_NEAR(r.image.rgb(x, y, r.image.channel("albedo.R")).y, 0.5f, 1e-5f);
  EXPECT_GT(r.image.at(x, y, r.image.channel("normal.Z")), 0.95f);
  EXPECT_NEAR(r.image.at(x, y, r.image.channel("depth.Z")), 4.0f, 0.05f);
  EXPECT_EQ(r.image.at(x, y, r.image.channel("roughness.Y")), 1.0f);
  // The floor, of roughness 0, shows the sphere: what that emits and more, for it lights itself by the mirror.
  float brightest = 0.0f;
  for (int row = 28; row < 37; ++row) {
    if (r.image.at(x, row, r.image.channel("roughness.Y")) == 0.0f)
      brightest = std::max(brightest, r.image.rgb(x, row).x);
  }
  EXPECT_GE(brightest, 1.9999f);
}

}  // namespace
}  // namespace octrad
