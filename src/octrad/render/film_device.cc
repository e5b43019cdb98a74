#include "octrad/render/film_device.h"

#include <cmath>

#include "octrad/device/launch.h"

namespace octrad {
namespace {

OCTRAD_HD inline PixelSample load_sample(const SamplePlanes& samples, std::size_t k, bool& finite) {
  PixelSample s{samples.get3(0, k), samples.get3(3, k), samples.get3(6, k), samples.get(9, k), samples.get(10, k)};
  finite = is_finite(s.radiance);
  if (!finite) s.radiance = Vec3f(0.0f);
  return s;
}

// A thread gathers the samples that count for its pixel.
struct Gather : Kernel {
  [[maybe_unused]] static constexpr unsigned kMinBlocks = 6;  // 70 registers: nothing spills
  const CameraJob* job;
  SamplePlanes samples;
  double* sums;
  unsigned long long* non_finite;
  FilterShape filter;
  bool box;
  int x0, y0, width, height, reach;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    const int x = x0 + static_cast<int>(i % static_cast<std::uint32_t>(width)),
              y = y0 + static_cast<int>(i / static_cast<std::uint32_t>(width));
    const std::size_t stride = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    const CameraJob& j = *job;
    const int xa = x - reach > j.x0 ? x - reach : j.x0,
              xb = x + reach < j.x0 + j.width - 1 ? x + reach : j.x0 + j.width - 1;
    const int ya = y - reach > j.y0 ? y - reach : j.y0,
              yb = y + reach < j.y0 + j.height - 1 ? y + reach : j.y0 + j.height - 1;
    double local[kFilmNumbers];
    if (xa > xb || ya > yb) return;
    for (int n = 0; n < kFilmNumbers; ++n) local[n] = sums[static_cast<std::size_t>(n) * stride + i];
    unsigned long long dropped = 0;
    for (int sy = ya; sy <= yb; ++sy) {
      for (int sx = xa; sx <= xb; ++sx) {
        const std::uint32_t pixel = j.pixel_number(sx, sy);
        if (pixel == ListedPixels::kNone) continue;
        for (int s = 0; s < j.count; ++s) {
          const std::uint32_t k = pixel * static_cast<std::uint32_t>(j.count) + static_cast<std::uint32_t>(s);
          float weight = 1.0f;
          if (!box) {
            Rng rng = camera_sample_generator(j.view, j.seed, sx, sy, j.first + s);
            const Vec2f p = camera_sample_position(rng, sx, sy);
            const bool near =
                filter.first(p.x) <= x && x <= filter.last(p.x) && filter.first(p.y) <= y && y <= filter.last(p.y);
            weight =
                near ? filter(static_cast<float>(y) + 0.5f - p.y) * filter(static_cast<float>(x) + 0.5f - p.x) : 0.0f;
          }
          bool finite = true;
          const PixelSample sample = load_sample(samples, k, finite);
          if (!finite && sx == x && sy == y) ++dropped;
          if (weight != 0.0f) accumulate_sample(local, sample, static_cast<double>(weight));
        }
      }
    }
    for (int n = 0; n < kFilmNumbers; ++n) sums[static_cast<std::size_t>(n) * stride + i] = local[n];
    if (dropped > 0) atomic_add(non_finite, dropped);
  }
};

OCTRAD_HD inline void show_pixel(const float (&values)[3], const ToneMapping& mapping, unsigned char* pixel) {
  for (int c = 0; c < 3; ++c) pixel[c] = to_byte(tonemap(values[c], mapping));
  pixel[3] = 255;
}

struct Means : Kernel {
  const double* sums;  // planes
  std::size_t pixels, first, count;
  float* out;  // [pixels][count]
  OCTRAD_HD void operator()(std::uint32_t i) const {
    const double weight = sums[kPictureChannelCount * pixels + i];
    for (std::size_t c = 0; c < count; ++c) out[i * count + c] = pixel_mean(sums[(first + c) * pixels + i], weight);
  }
};

struct Show : Kernel {
  const double* sums;  // planes
  std::size_t pixels;
  ToneMapping mapping;
  unsigned char* out;  // [pixels][4]
  OCTRAD_HD void operator()(std::uint32_t i) const {
    const double weight = sums[kPictureChannelCount * pixels + i];
    float values[3];
    for (std::size_t c = 0; c < 3; ++c) values[c] = pixel_mean(sums[c * pixels + i], weight);
    show_pixel(values, mapping, out + 4 * static_cast<std::size_t>(i));
  }
};

struct ShowOnly : Kernel {
  const CameraJob* job;
  SamplePlanes samples;
  int x0, y0, width;
  ToneMapping mapping;
  unsigned char* out;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    const auto columns = static_cast<std::uint32_t>(width);
    const std::uint32_t y = i / columns,
                        k = job->pixel_number(x0 + static_cast<int>(i - y * columns), y0 + static_cast<int>(y));
    Vec3f radiance = samples.radiance(k);
    if (!is_finite(radiance)) radiance = Vec3f(0.0f);
    show_pixel({radiance.x, radiance.y, radiance.z}, mapping, out + 4 * static_cast<std::size_t>(i));
  }
};

}  // namespace

DeviceFilm::DeviceFilm(Stream& stream, int x0, int y0, int width, int height, const Film& film)
    : stream_(&stream),
      x0_(x0),
      y0_(y0),
      width_(width),
      height_(height),
      filter_(film),
      reach_(filter_.reach()),
      sums_(stream, pixels() * kFilmNumbers, "the picture"),
      means_(stream, pixels() * kPictureChannelCount, "the picture"),
      non_finite_(stream, 1, "counts of samples") {
  clear();
  non_finite_.fill(0);
}

std::size_t DeviceFilm::bytes(int width, int height) {
  return static_cast<std::size_t>(width) * static_cast<std::size_t>(height) *
         (kFilmNumbers * sizeof(double) + kPictureChannelCount * sizeof(float));
}

void DeviceFilm::clear() { sums_.fill(0); }

void DeviceFilm::add(const CameraJob* job, const SamplePlanes& samples) {
  launch(*stream_, pixels(),
         Gather{{},
                job,
                samples,
                sums_.data(),
                non_finite_.data(),
                filter_.shape(),
                filter_.reach() == 0,
                x0_,
                y0_,
                width_,
                height_,
                reach_});
}

void DeviceFilm::show(const ToneMapping& mapping, unsigned char* screen) const {
  launch(*stream_, pixels(), Show{{}, sums_.data(), pixels(), mapping, screen});
}

void DeviceFilm::show_only(const CameraJob* job, const SamplePlanes& samples, const ToneMapping& mapping,
                           unsigned char* screen) const {
  launch(*stream_, pixels(), ShowOnly{{}, job, samples, x0_, y0_, width_, mapping, screen});
}

std::vector<double> DeviceFilm::download() const {
  const std::vector<double> planes = sums_.download();
  std::vector<double> sums(planes.size());
  for (std::size_t i = 0; i < pixels(); ++i) {
    for (std::size_t n = 0; n < kFilmNumbers; ++n) sums[i * kFilmNumbers + n] = planes[n * pixels() + i];
  }
  return sums;
}

void DeviceFilm::upload(std::span<const double> sums) {
  std::vector<double> planes(sums.size());
  for (std::size_t i = 0; i < pixels(); ++i) {
    for (std::size_t n = 0; n < kFilmNumbers; ++n) planes[n * pixels() + i] = sums[i * kFilmNumbers + n];
  }
  sums_.upload(planes);
}

Image DeviceFilm::image(const ChannelRange& channels) const {
  Image image(width_, height_, channels.names());
  launch(*stream_, pixels(),
         Means{{},
               sums_.data(),
               pixels(),
               static_cast<std::size_t>(channels.first),
               static_cast<std::size_t>(channels.count),
               means_.data()});
  means_.download(image.data);
  return image;
}

unsigned long long DeviceFilm::take_non_finite() {
  const unsigned long long count = non_finite_.download()[0];
  non_finite_.fill(0);
  return count;
}

}  // namespace octrad
