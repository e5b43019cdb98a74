#include "render/film.h"

#include <algorithm>
#include <cmath>

namespace octrad {

const std::vector<std::string>& picture_channels() {
  static const std::vector<std::string> names = {"R", "G", "B", "albedo.R", "albedo.G", "albedo.B",
                                                 "normal.X", "normal.Y", "normal.Z", "depth.Z", "roughness.Y"};
  return names;
}

ReconstructionFilter::ReconstructionFilter(const Film& film) : type_(film.filter), radius_(film.filter_radius) {
  if (!(radius_ > 0.0f)) {
    radius_ = type_ == Film::Filter::box ? 0.5f : (type_ == Film::Filter::tent ? 1.0f : 4.0f * film.filter_stddev);
  }
  box_ = type_ == Film::Filter::box && radius_ <= 0.5f;
  if (type_ == Film::Filter::gaussian) {
    exponent_ = -0.5f / (film.filter_stddev * film.filter_stddev);
    floor_ = std::exp(exponent_ * radius_ * radius_);
  }
}

float ReconstructionFilter::operator()(float d) const {
  const float a = std::fabs(d);
  switch (type_) {
    case Film::Filter::box: return a <= radius_ ? 1.0f : 0.0f;
    case Film::Filter::tent: return std::max(0.0f, 1.0f - a / radius_);
    case Film::Filter::gaussian: return a < radius_ ? std::max(0.0f, std::exp(exponent_ * d * d) - floor_) : 0.0f;
  }
  return 0.0f;
}

FilmBuffer::FilmBuffer(int x0, int y0, int width, int height)
    : x0_(x0), y0_(y0), width_(width), height_(height),
      sums_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * kStride, 0.0) {}

void FilmBuffer::clear() { std::fill(sums_.begin(), sums_.end(), 0.0); }

namespace {

inline void accumulate(double* to, const PixelSample& s, double weight) {
  to[0] += weight * static_cast<double>(s.radiance.x);
  to[1] += weight * static_cast<double>(s.radiance.y);
  to[2] += weight * static_cast<double>(s.radiance.z);
  to[3] += weight * static_cast<double>(s.albedo.x);
  to[4] += weight * static_cast<double>(s.albedo.y);
  to[5] += weight * static_cast<double>(s.albedo.z);
  to[6] += weight * static_cast<double>(s.normal.x);
  to[7] += weight * static_cast<double>(s.normal.y);
  to[8] += weight * static_cast<double>(s.normal.z);
  to[9] += weight * static_cast<double>(s.depth);
  to[10] += weight * static_cast<double>(s.roughness);
  to[11] += weight;
}

}  // namespace

void FilmBuffer::add_to_pixel(int x, int y, const PixelSample& sample) { accumulate(pixel(x, y), sample, 1.0); }

void FilmBuffer::add(const ReconstructionFilter& filter, Vec2f p, const PixelSample& sample) {
  const float r = filter.radius();
  const int xa = std::max(x0_, static_cast<int>(std::ceil(p.x - r - 0.5f))), xb = std::min(x0_ + width_ - 1, static_cast<int>(std::floor(p.x + r - 0.5f)));
  const int ya = std::max(y0_, static_cast<int>(std::ceil(p.y - r - 0.5f))), yb = std::min(y0_ + height_ - 1, static_cast<int>(std::floor(p.y + r - 0.5f)));
  for (int y = ya; y <= yb; ++y) {
    const float wy = filter(static_cast<float>(y) + 0.5f - p.y);
    if (wy == 0.0f) continue;
    for (int x = xa; x <= xb; ++x) {
      const float w = wy * filter(static_cast<float>(x) + 0.5f - p.x);
      if (w > 0.0f) accumulate(pixel(x, y), sample, static_cast<double>(w));
    }
  }
}

void FilmBuffer::add(const FilmBuffer& other) {
  const int xa = std::max(x0_, other.x0_), xb = std::min(x0_ + width_, other.x0_ + other.width_);
  const int ya = std::max(y0_, other.y0_), yb = std::min(y0_ + height_, other.y0_ + other.height_);
  if (xa >= xb) return;
  for (int y = ya; y < yb; ++y) {
    double* to = pixel(xa, y);
    const double* from = other.pixel(xa, y);
    const std::size_t n = static_cast<std::size_t>(xb - xa) * kStride;
    for (std::size_t i = 0; i < n; ++i) to[i] += from[i];
  }
}

Image FilmBuffer::image() const {
  Image out(width_, height_, picture_channels());
  for (std::size_t i = 0; i < static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_); ++i) {
    const double* from = sums_.data() + i * kStride;
    const double weight = from[kPictureChannelCount];
    if (!(weight > 0.0)) continue;
    for (std::size_t c = 0; c < kPictureChannelCount; ++c) out.data[i * kPictureChannelCount + c] = static_cast<float>(from[c] / weight);
  }
  return out;
}

}  // namespace octrad
