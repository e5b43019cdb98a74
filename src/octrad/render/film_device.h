// The film of render/film.h in the memory of a Stream: sums of filtered samples of a window of the picture, in double
// and in a fixed order.
#pragma once

#include "octrad/device/array.h"
#include "octrad/image/tonemap_math.h"
#include "octrad/render/film.h"
#include "octrad/transport/camera_job.h"

namespace octrad {

class DeviceFilm {
 public:
  // Window [x0, x0 + width) x [y0, y0 + height) of the picture's pixels.
  DeviceFilm(Stream& stream, int x0, int y0, int width, int height, const Film& film);

  void clear();
  // Adds the samples of *job (device memory), each to all pixels of the window within the filter's reach. Samples whose
  // radiance is not finite count as black. Both can be recorded.
  void add(const CameraJob* job, const SamplePlanes& samples);
  // What a screen shows of the film, as octrad tonemap without options: [pixels()][4] bytes.
  void show(const ToneMapping& mapping, unsigned char* screen) const;
  // The same of one sample a pixel that the film does not have yet: what add() to an empty film and show() would give,
  // without the sums in double. Only with a box filter (reach() 0), for a job of the whole window of the film.
  void show_only(const CameraJob* job, const SamplePlanes& samples, const ToneMapping& mapping,
                 unsigned char* screen) const;
  // How many pixels around a window have samples that reach into it.
  int reach() const { return reach_; }

  // The sums, kFilmNumbers planes of a double a pixel, in device memory.
  const double* sums() const { return sums_.data(); }
  std::size_t pixels() const { return static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_); }
  // They on the host, kFilmNumbers a pixel.
  std::vector<double> download() const;
  void upload(std::span<const double> sums);
  Image image(const ChannelRange& channels = {}) const;
  unsigned long long take_non_finite();  // since the last call
  static std::size_t bytes(int width, int height);

 private:
  Stream* stream_;
  int x0_, y0_, width_, height_;
  ReconstructionFilter filter_;
  int reach_;
  DeviceArray<double> sums_;
  DeviceArray<float> means_;  // what image() downloads: made beforehand, so that a picture is not lost for want of it
  DeviceArray<unsigned long long> non_finite_;
};

}  // namespace octrad
