#include <algorithm>
#include <cmath>

#include "app/selftest/entries.h"
#include "octrad/base/rng.h"
#include "octrad/device/array.h"
#include "octrad/render/film_device.h"

namespace octrad::selftest {
namespace {

// Made-up samples of a job, and what the CPU's film makes of them; returns how many were dropped.
unsigned long long add_samples(const Context& c, const CameraJob& job, const ReconstructionFilter& filter,
                               const SamplePlanes& planes, FilmBuffer& film) {
  unsigned long long dropped = 0;
  for (std::uint32_t k = 0; k < job.size(); ++k) {
    const CameraJob::Place p = job.place(k);
    const bool inside =
        p.x >= film.x0() && p.x < film.x0() + film.width() && p.y >= film.y0() && p.y < film.y0() + film.height();
    Rng rng(c.seed + static_cast<std::uint64_t>(job.y0), RngPurpose::test, k);
    PixelSample s;
    s.radiance = {rng.uniform(), 100.0f * rng.uniform(), rng.uniform()};
    s.albedo = {rng.uniform(), rng.uniform(), rng.uniform()};
    s.normal = {2.0f * rng.uniform() - 1.0f, -rng.uniform(), 1.0f};
    s.depth = 10.0f * rng.uniform();
    s.roughness = rng.uniform();
    const bool bad = rng.uniform() < 0.01f;
    planes.set_radiance(k, bad ? Vec3f(1.0f, std::nanf(""), 0.0f) : s.radiance);
    planes.set_first(k, {true, s.albedo, s.normal, s.depth, s.roughness});
    if (bad) {
      s.radiance = Vec3f(0.0f);
      dropped += inside ? 1 : 0;
    }
    if (!(filter.reach() == 0)) film.add(filter, job.sample(k).position, s);
    else if (inside) film.add_to_pixel(p.x, p.y, s);
  }
  return dropped;
}

}  // namespace

// Strips of a picture, onto a film of a window in it.
CheckResult check_film(const Context& c) {
  const int size = c.items(1, 0) > 0 ? 512 : 48, border = 3, inner = size - 2 * border, strip = size / 4, count = 3;
  const Camera camera;
  Errors errors;
  bool same_counts = true;
  for (const Film::Filter type : {Film::Filter::box, Film::Filter::tent, Film::Filter::gaussian}) {
    Film film;
    film.filter = type;
    if (type == Film::Filter::tent) film.filter_radius = 1.5f;
    const ReconstructionFilter filter(film);
    FilmBuffer expected(border, border, inner, inner);
    DeviceFilm found(c.stream, border, border, inner, inner, film);
    DeviceArray<CameraJob> device_job(c.stream, 1, "selftest");
    unsigned long long dropped = 0;
    for (int y0 = 0; y0 < size; y0 += strip) {
      CameraJob job;
      job.view = camera.view(size, size);
      job.seed = c.seed;
      job.y0 = y0;
      job.width = size;
      job.height = std::min(strip, size - y0);
      job.first = 2;
      job.count = count;
      const std::size_t n = job.size();
      std::vector<float> numbers(n * kSampleNumbers);
      dropped += add_samples(c, job, filter, {{numbers.data(), n}}, expected);
      const DeviceArray<float> samples(c.stream, std::span<const float>(numbers), "selftest");
      device_job.upload(std::span<const CameraJob>(&job, 1));
      found.add(device_job.data(), {{samples.data(), n}});
      c.stream.synchronize();
    }
    const Image got = found.image(), wanted = expected.image();
    for (std::size_t i = 0; i < wanted.data.size(); ++i) {
      errors.add(std::fabs(static_cast<double>(got.data.at(i)) - wanted.data[i]) /
                 std::max(1.0, std::fabs(static_cast<double>(wanted.data[i]))));
    }
    same_counts = found.take_non_finite() == dropped && same_counts;
  }
  CheckResult r = errors.result("relative error of pixels", 1e-4);
  if (!same_counts) {
    r.passed = false;
    r.error += "; other samples dropped";
  }
  return r;
}

}  // namespace octrad::selftest
