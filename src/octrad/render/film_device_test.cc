// The film on streams against the CPU's, and pictures made with it.
#include "octrad/render/film_device.h"

#include <algorithm>

#include "octrad/render/renderer.h"
#include "octrad/transport/device_test_helper.h"
#include "octrad/transport/path_device.h"

namespace octrad {
namespace {

class DeviceFilms : public ::testing::TestWithParam<bool> {};

std::vector<Film> films() {
  std::vector<Film> all(3);
  all[0].filter = Film::Filter::box;
  all[1].filter = Film::Filter::tent;
  all[1].filter_radius = 1.5f;
  all[2].filter = Film::Filter::gaussian;
  return all;
}

void expect_same_images(const Image& found, const Image& expected, double tolerance) {
  ASSERT_EQ(found.data.size(), expected.data.size());
  for (std::size_t i = 0; i < found.data.size(); ++i) {
    ASSERT_NEAR(found.data[i], expected.data[i], tolerance * (1.0 + std::fabs(static_cast<double>(expected.data[i]))))
        << i;
  }
}

// Made-up samples, handed over in strips, onto a film that is smaller than what they cover.
TEST_P(DeviceFilms, SumUpWhatTheCpuSumsUp) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  Camera camera;
  const int width = 23, height = 17, count = 3;
  for (const Film& film : films()) {
    SCOPED_TRACE(static_cast<int>(film.filter));
    const ReconstructionFilter filter(film);
    FilmBuffer expected(2, 1, 18, 14);
    DeviceFilm found(*stream, 2, 1, 18, 14, film);
    unsigned long long dropped = 0;
    DeviceArray<CameraJob> device_job(*stream, 1, "job");
    for (int y0 = 0; y0 < height; y0 += 5) {
      CameraJob job;
      job.view = camera.view(width, height);
      job.seed = 5;
      job.y0 = y0;
      job.width = width;
      job.height = std::min(5, height - y0);
      job.first = 2;
      job.count = count;
      device_job.upload(std::span<const CameraJob>(&job, 1));
      const std::size_t n = job.size();
      std::vector<float> numbers(n * kSampleNumbers);
      const SamplePlanes host{{numbers.data(), n}};
      Rng rng(1, RngPurpose::test, static_cast<std::uint64_t>(y0));
      for (std::uint32_t k = 0; k < n; ++k) {
        PixelSample s;
        s.radiance = {rng.uniform(), rng.uniform() * 100.0f, rng.uniform()};
        s.albedo = {rng.uniform(), 0.5f, 0.25f};
        s.normal = {0.0f, -rng.uniform(), 1.0f};
        s.depth = rng.uniform() * 10.0f;
        s.roughness = rng.uniform();
        const CameraJob::Place p = job.place(k);
        const bool bad = k % 50 == 7;
        host.set_radiance(k, bad ? Vec3f(1.0f, std::nanf(""), 0.0f) : s.radiance);
        if (bad) {
          s.radiance = Vec3f(0.0f);
          dropped += p.x >= 2 && p.x < 20 && p.y >= 1 && p.y < 15;
        }
        host.set_first(k, {true, s.albedo, s.normal, s.depth, s.roughness});
        if (filter.reach() > 0) expected.add(filter, job.sample(k).position, s);
        else if (p.x >= 2 && p.x < 20 && p.y >= 1 && p.y < 15) expected.add_to_pixel(p.x, p.y, s);
      }
      const DeviceArray<float> device(*stream, std::span<const float>(numbers), "samples");
      found.add(device_job.data(), {{device.data(), n}});
      stream->synchronize();
    }
    expect_same_images(found.image(), expected.image(), stream->on_device() ? 1e-4 : 1e-6);
    EXPECT_EQ(found.take_non_finite(), dropped);
    found.clear();
    EXPECT_EQ(found.image().data[0], 0.0f);
  }
}

// Camera, paths and film together make the CPU's picture.
TEST_P(DeviceFilms, HoldThePictureOfThePathTracer) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  const testing::DeviceSetup setup(*stream, testing::room());
  for (const Film& film : films()) {
    SCOPED_TRACE(static_cast<int>(film.filter));
    RenderSettings settings;
    settings.film = film;
    settings.max_depth = 6;
    settings.seed = 3;
    const auto renderer = make_renderer(setup.prepared, "path", settings);
    renderer->set_view({setup.scene.cameras.front(), 24, 18});
    const RenderResult expected = render(*renderer, {8});
    CameraJob job = testing::whole_picture(setup.scene, 4);
    DevicePathTracer tracer(*stream, setup.world(), job.size());
    DeviceFilm found(*stream, 0, 0, 24, 18, film);
    for (job.first = 0; job.first < 8; job.first += 4) {
      tracer.set(job);
      tracer.run({6, 5});
      found.add(tracer.job(), tracer.samples());
    }
    const Image image = found.image();
    if (!stream->on_device()) {
      expect_same_images(image, expected.image, 1e-6);
      continue;
    }
    double sum = 0.0, difference = 0.0;
    for (int y = 0; y < 18; ++y) {
      for (int x = 0; x < 24; ++x) {
        const double a = static_cast<double>(luminance(image.rgb(x, y))),
                     b = static_cast<double>(luminance(expected.image.rgb(x, y)));
        sum += b;
        difference += a - b;
      }
    }
    EXPECT_NEAR(difference / sum, 0.0, 0.01);
  }
}

INSTANTIATE_TEST_SUITE_P(All, DeviceFilms, ::testing::Values(false, true), testing::stream_name);

}  // namespace
}  // namespace octrad
