#include "octrad/render/renderer.h"

#include <gtest/gtest.h>

#include <atomic>

#include "octrad/base/error.h"
#include "octrad/base/threads.h"
#include "octrad/render/film.h"
#include "octrad/scene/mitsuba_world_test_data.h"
#include "octrad/scene/sample_scenes.h"

namespace octrad {
namespace {

using SampleFunction = std::function<SampleCounts(std::span<CameraSample>, std::span<PixelSample>)>;

class FunctionIntegrator : public Integrator {
 public:
  explicit FunctionIntegrator(SampleFunction function) : function_(std::move(function)) {}
  SampleCounts sample(std::span<CameraSample> samples, std::span<PixelSample> out) override {
    return function_(samples, out);
  }

 private:
  SampleFunction function_;
};

// A picture that can be changed in any part before it is rendered.
struct Picture {
  View view;
  RenderSettings settings;
  RenderBudget budget;
};

Picture small(Film::Filter filter, int spp) {
  Picture p;
  p.view = {look_at({0, 0, 5}, {0, 0, 0}, {0, 1, 0}, 40.0f, Camera::FovAxis::x), 53, 37};
  p.settings.film.filter = filter;
  p.settings.film.filter_radius = 0.0f;
  p.settings.seed = 7;
  p.budget.spp = spp;
  return p;
}

RenderResult picture(const Picture& p, const SampleFunction& function) {
  static const PreparedScene nothing{Scene()};
  const auto renderer = make_renderer(nothing, std::make_unique<FunctionIntegrator>(function), p.settings);
  renderer->set_view(p.view);
  return render(*renderer, p.budget);
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

constexpr Film::Filter kFilters[] = {Film::Filter::box,      Film::Filter::tent,       Film::Filter::gaussian,
                                     Film::Filter::mitchell, Film::Filter::catmullrom, Film::Filter::lanczos};

TEST(Renderer, FiltersAreMitsubas) {
  for (const MitsubaFilter& expected : kMitsubaFilters) {
    Film film;
    film.filter = kFilters[&expected - kMitsubaFilters];
    const ReconstructionFilter filter(film);
    EXPECT_EQ(filter.radius(), expected.radius) << expected.type;
    for (int i = 0; i < 24; ++i) {
      // Theirs is tabulated; and a gaussian is cut off differently.
      EXPECT_NEAR(filter.shape()(-0.125f * static_cast<float>(i)), expected.values[i], 2e-3f) << expected.type << i;
    }
  }
}

TEST(Renderer, SameBitsAtAnyThreadCount) {
  for (const Film::Filter filter : kFilters) {
    set_thread_count(1);
    const RenderResult one = picture(small(filter, 5), noisy);
    set_thread_count(3);
    const RenderResult three = picture(small(filter, 5), noisy);
    set_thread_count(0);
    EXPECT_EQ(one.image.data, three.image.data);
    EXPECT_EQ(one.spp, 5);
    EXPECT_EQ(one.counts.queries, one.samples);
    Picture other = small(filter, 5);
    other.settings.seed = 8;
    EXPECT_NE(picture(other, noisy).image.data, one.image.data);
  }
}

TEST(Renderer, CropIsThatPartOfThePicture) {
  for (const Film::Filter filter : kFilters) {
    const RenderResult whole = picture(small(filter, 3), noisy);
    Picture o = small(filter, 3);
    o.view.crop = {11, 9, 20, 17};
    const RenderResult part = picture(o, noisy);
    ASSERT_EQ(part.image.width, 20);
    ASSERT_EQ(part.image.height, 17);
    for (int y = 0; y < 17; ++y) {
      for (int x = 0; x < 20; ++x) ASSERT_EQ(part.image.rgb(x, y), whole.image.rgb(x + 11, y + 9)) << x << " " << y;
    }
  }
}

// And of a mask: the same bits where it is 1, 0 elsewhere, and samples nowhere but around it.
TEST(Renderer, MaskLeavesPixelsOut) {
  for (const Film::Filter filter : kFilters) {
    const RenderResult whole = picture(small(filter, 3), noisy);
    for (const Crop crop : {Crop{}, Crop{11, 9, 20, 17}}) {
      Picture o = small(filter, 3);
      o.view.crop = crop;
      auto mask = std::make_shared<std::vector<std::uint8_t>>(53 * 37);
      const auto wanted = [](int x, int y) { return x % 17 < 3 && y % 12 < 4; };
      for (int y = 0; y < 37; ++y) {
        for (int x = 0; x < 53; ++x) (*mask)[static_cast<std::size_t>(y * 53 + x)] = wanted(x, y) ? 1 : 0;
      }
      o.view.mask = mask;
      const RenderResult part = picture(o, noisy);
      int pixels = 0;
      for (int y = 0; y < part.image.height; ++y) {
        for (int x = 0; x < part.image.width; ++x) {
          const bool in = wanted(x + crop.x, y + crop.y);
          pixels += in ? 1 : 0;
          for (int c = 0; c < static_cast<int>(part.image.channels.size()); ++c)
            ASSERT_EQ(part.image.at(x, y, c), in ? whole.image.at(x + crop.x, y + crop.y, c) : 0.0f) << x << " " << y;
        }
      }
      EXPECT_EQ(part.counts.queries, part.samples);
      if (filter == Film::Filter::box) EXPECT_EQ(part.samples, 3 * pixels);
      else EXPECT_LT(part.samples, 3 * part.image.width * part.image.height);
    }
  }
}

// Filters are normalised and symmetric: a constant stays itself, a ramp keeps its values on average.
TEST(Renderer, FiltersKeepConstantsAndRamps) {
  for (const Film::Filter filter : kFilters) {
    const RenderResult r = picture(small(filter, 64), noisy);
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

TEST(Renderer, WideFiltersBlurAsFarAsTheyReach) {
  const auto spot = [](std::span<CameraSample> samples, std::span<PixelSample> out) {
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const Vec2f p = samples[i].position;
      if (p.x >= 20.0f && p.x < 21.0f && p.y >= 20.0f && p.y < 21.0f) out[i].radiance = Vec3f(1.0f);
    }
    return SampleCounts{};
  };
  // The share of a pixel's weight that falls into its neighbour: tent 1/8 along one axis (3/4 stays in the pixel).
  const RenderResult tent = picture(small(Film::Filter::tent, 600), spot);
  EXPECT_NEAR(tent.image.rgb(20, 20).x, 0.75f * 0.75f, 0.02f);
  EXPECT_NEAR(tent.image.rgb(21, 20).x, 0.125f * 0.75f, 0.01f);
  EXPECT_NEAR(tent.image.rgb(21, 21).x, 0.125f * 0.125f, 0.005f);
  EXPECT_EQ(tent.image.rgb(22, 20).x, 0.0f);
  const RenderResult box = picture(small(Film::Filter::box, 4), spot);
  EXPECT_EQ(box.image.rgb(20, 20).x, 1.0f);
  EXPECT_EQ(box.image.rgb(21, 20).x, 0.0f);
}

TEST(Renderer, StopsWhenAsked) {
  Picture o = small(Film::Filter::box, 0);
  o.budget.seconds = 0.05;
  const RenderResult timed = picture(o, noisy);
  EXPECT_GE(timed.spp, 1);
  EXPECT_FALSE(timed.interrupted);
  // The same number of samples without a clock gives the same picture.
  EXPECT_EQ(picture(small(Film::Filter::box, timed.spp), noisy).image.data, timed.image.data);
  o = small(Film::Filter::gaussian, 1000000);
  std::vector<int> reported;
  o.budget.interrupted = [&] { return reported.size() >= 3; };
  o.budget.progress = [&](int spp, double) { reported.push_back(spp); };
  const RenderResult stopped = picture(o, noisy);
  EXPECT_TRUE(stopped.interrupted);
  EXPECT_EQ(reported, (std::vector<int>{1, 2, 4}));
  EXPECT_EQ(stopped.spp, 4);
  EXPECT_EQ(picture(small(Film::Filter::gaussian, 4), noisy).image.data, stopped.image.data);
}

TEST(Renderer, NonFiniteSamplesAreBlackAndCounted) {
  const RenderResult r =
      picture(small(Film::Filter::box, 1), [](std::span<CameraSample> samples, std::span<PixelSample> out) {
        for (std::size_t i = 0; i < samples.size(); ++i)
          out[i].radiance = Vec3f(samples[i].position.x < 1.0f ? NAN : 1.0f);
        return SampleCounts{};
      });
  EXPECT_EQ(r.counts.non_finite, 37);
  EXPECT_EQ(r.image.rgb(0, 5).x, 0.0f);
  EXPECT_EQ(r.image.rgb(1, 5).x, 1.0f);
}

TEST(Renderer, RefusesNonsense) {
  Picture o = small(Film::Filter::box, 1);
  o.view.width = 0;
  EXPECT_THROW(picture(o, noisy), UsageError);
  o = small(Film::Filter::box, 0);
  EXPECT_THROW(picture(o, noisy), UsageError);
  o = small(Film::Filter::box, 1);
  o.view.crop = {50, 0, 10, 10};
  EXPECT_THROW(picture(o, noisy), UsageError);
  o = small(Film::Filter::box, 1);
  o.view.mask = std::make_shared<std::vector<std::uint8_t>>(53 * 37 - 1, std::uint8_t{1});
  EXPECT_THROW(picture(o, noisy), UsageError);
  o.view.mask = std::make_shared<std::vector<std::uint8_t>>(53 * 37);  // nothing
  EXPECT_THROW(picture(o, noisy), UsageError);
  o = small(Film::Filter::tent, 1);
  o.settings.film.filter_radius = 20.0f;
  EXPECT_THROW(picture(o, noisy), InputError);
}

// A diffuse sphere that emits and a mirror floor, filmed: threads, layers and counters of the whole path integrator.
TEST(PathIntegrator, PictureWithLayers) {
  testing::SceneMaker maker;
  maker.sphere({0, 0, 0}, 1.0f, maker.diffuse(Vec3f(0.6f, 0.5f, 0.4f)), Vec3f(2.0f));
  Material mirror;
  mirror.type = BsdfType::conductor;
  maker.quad({-4, -1.02f, 4}, {8, 0, 0}, {0, 0, -8}, maker.material(mirror));
  const PreparedScene prepared(maker.scene);
  const Picture p = small(Film::Filter::box, 4);
  const auto renderer = make_renderer(prepared, "path", p.settings);
  renderer->set_view(p.view);
  set_thread_count(1);
  const RenderResult r = render(*renderer, p.budget);
  set_thread_count(2);
  EXPECT_EQ(render(*renderer, p.budget).image.data, r.image.data);
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

// A long pass that is interrupted leaves the film as it was: what is saved and continued has the bits of one run.
TEST(Renderer, AStoppedPassLeavesTheFilmAsItWas) {
  const PreparedScene nothing{Scene()};
  const Picture p = small(Film::Filter::gaussian, 4);
  const auto make = [&] {
    auto renderer = make_renderer(nothing, std::make_unique<FunctionIntegrator>(noisy), p.settings);
    renderer->set_view(p.view);
    return renderer;
  };
  const auto whole = make();
  ASSERT_TRUE(whole->add_samples(1));
  const FilmState first{1, whole->largest_pass(), 0.0, whole->take_counts(), whole->sums()};
  ASSERT_TRUE(whole->add_samples(2));

  const auto stopped = make();
  std::atomic<int> asked = 0;
  const auto third = [&] { return ++asked == 3; };
  EXPECT_FALSE(stopped->add_samples(1, third));  // in the first pass
  EXPECT_GE(asked, 3);
  EXPECT_EQ(stopped->samples(), 0);
  EXPECT_EQ(stopped->take_counts().queries, 0);
  for (const double v : stopped->sums()) ASSERT_EQ(v, 0.0);

  stopped->restore(first);
  asked = 0;
  EXPECT_FALSE(stopped->add_samples(2, third));
  EXPECT_EQ(stopped->samples(), 1);
  EXPECT_EQ(stopped->sums(), first.sums);
  EXPECT_TRUE(stopped->add_samples(2, [] { return false; }));
  EXPECT_EQ(stopped->sums(), whole->sums());
  EXPECT_EQ(stopped->take_counts().queries, whole->take_counts().queries);

  RenderBudget budget = p.budget;
  asked = 0;
  budget.interrupted = third;
  const auto picture = make();
  const RenderResult result = render(*picture, budget);
  EXPECT_TRUE(result.interrupted);
  EXPECT_EQ(result.spp, 0);
}

}  // namespace
}  // namespace octrad
