#include <algorithm>

#include "octrad/base/rng.h"
#include "octrad/device/array.h"
#include "octrad/render/checks.h"
#include "octrad/render/film_device.h"

namespace octrad {
namespace {

// Random samples of a job, and what the CPU's film makes of them; returns how many were dropped.
unsigned long long add_samples(const CameraJob& job, const ReconstructionFilter& filter, const SamplePlanes& planes,
                               FilmBuffer& film) {
  unsigned long long dropped = 0;
  for (std::uint32_t k = 0; k < job.size(); ++k) {
    const CameraJob::Place p = job.place(k);
    const bool inside =
        p.x >= film.x0() && p.x < film.x0() + film.width() && p.y >= film.y0() && p.y < film.y0() + film.height();
    Rng rng(job.seed + static_cast<std::uint64_t>(job.y0), RngPurpose::test, k);
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

CheckResult check_film(Stream& stream, int width, int height, int strip, std::uint64_t seed) {
  const int x0 = 2, y0 = 1, inner_width = width - 5, inner_height = height - 3;
  CheckErrors errors;
  bool same_counts = true, cleared = true;
  for (const Film::Filter type : {Film::Filter::box, Film::Filter::tent, Film::Filter::gaussian, Film::Filter::mitchell,
                                  Film::Filter::catmullrom, Film::Filter::lanczos}) {
    Film film;
    film.filter = type;
    if (type == Film::Filter::tent) film.filter_radius = 1.5f;
    const ReconstructionFilter filter(film);
    FilmBuffer expected(x0, y0, inner_width, inner_height);
    DeviceFilm found(stream, x0, y0, inner_width, inner_height, film);
    DeviceArray<CameraJob> device_job(stream, 1, "check");
    unsigned long long dropped = 0;
    for (int y = 0; y < height; y += strip) {
      CameraJob job;
      job.view = Camera().view(width, height);
      job.seed = seed;
      job.y0 = y;
      job.width = width;
      job.height = std::min(strip, height - y);
      job.first = 2;
      job.count = 3;
      job.tiles = y % 2 != 0;
      const std::size_t n = job.size();
      std::vector<float> numbers(n * kSampleNumbers);
      dropped += add_samples(job, filter, {{numbers.data(), n}}, expected);
      const DeviceArray<float> samples(stream, std::span<const float>(numbers), "check");
      device_job.upload(std::span<const CameraJob>(&job, 1));
      found.add(device_job.data(), {{samples.data(), n}});
      stream.synchronize();
    }
    errors.compare(found.image().data, expected.image().data);
    same_counts = found.take_non_finite() == dropped && same_counts;
    found.clear();
    const Image empty = found.image();
    cleared = cleared && std::count(empty.data.begin(), empty.data.end(), 0.0f) == std::ssize(empty.data);
  }
  CheckResult r = errors.exact_on_host(stream, "relative error of pixels", 1e-4);
  r.require(same_counts, "other samples dropped");
  r.require(cleared, "clear() leaves something");
  return r;
}

}  // namespace octrad
