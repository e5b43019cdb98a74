#include "octrad/render/film.h"

#include <algorithm>
#include <cmath>

namespace octrad {

const std::vector<std::string>& picture_channels() {
  static const std::vector<std::string> names = {
      "R", "G", "B", "albedo.R", "albedo.G", "albedo.B", "normal.X", "normal.Y", "normal.Z", "depth.Z", "roughness.Y"};
  return names;
}

std::vector<std::string> ChannelRange::names() const {
  return {picture_channels().begin() + first, picture_channels().begin() + first + count};
}

ChannelRange channels_of(const std::string& layer) {
  if (layer.empty()) return {0, 3};
  ChannelRange range{0, 0};
  for (int c = 0; c < kPictureChannelCount; ++c) {
    if (picture_channels()[static_cast<std::size_t>(c)].rfind(layer + ".", 0) != 0) continue;
    if (range.count++ == 0) range.first = c;
  }
  return range.count > 0 ? range : ChannelRange{};
}

ReconstructionFilter::ReconstructionFilter(const Film& film) {
  using Filter = Film::Filter;
  using Type = FilterShape::Type;
  float usual = 2.0f;
  switch (film.filter) {
    case Filter::box: shape_.type = Type::box, usual = 0.5f; break;
    case Filter::tent: shape_.type = Type::tent, usual = 1.0f; break;
    case Filter::gaussian: shape_.type = Type::gaussian, usual = 4.0f * film.filter_stddev; break;
    case Filter::mitchell: shape_.type = Type::cubic, shape_.b = film.filter_b, shape_.c = film.filter_c; break;
    case Filter::catmullrom: shape_.type = Type::cubic, shape_.b = 0.0f, shape_.c = 0.5f; break;
    case Filter::lanczos: shape_.type = Type::lanczos, usual = 3.0f; break;
  }
  shape_.radius = film.filter_radius > 0.0f ? film.filter_radius : usual;
  reach_ =
      shape_.type == FilterShape::Type::box && shape_.radius <= 0.5f ? 0 : static_cast<int>(std::ceil(shape_.radius));
  if (shape_.type == FilterShape::Type::gaussian) {
    shape_.exponent = -0.5f / (film.filter_stddev * film.filter_stddev);
    shape_.floor = std::exp(shape_.exponent * shape_.radius * shape_.radius);
  }
}

FilmBuffer::FilmBuffer(int x0, int y0, int width, int height)
    : x0_(x0),
      y0_(y0),
      width_(width),
      height_(height),
      sums_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * kStride, 0.0) {}

void FilmBuffer::clear() { std::fill(sums_.begin(), sums_.end(), 0.0); }

void FilmBuffer::add_to_pixel(int x, int y, const PixelSample& sample) { accumulate_sample(pixel(x, y), sample, 1.0); }

void FilmBuffer::add(const ReconstructionFilter& filter, Vec2f p, const PixelSample& sample) {
  const FilterShape& shape = filter.shape();
  const int xa = std::max(x0_, shape.first(p.x)), xb = std::min(x0_ + width_ - 1, shape.last(p.x));
  const int ya = std::max(y0_, shape.first(p.y)), yb = std::min(y0_ + height_ - 1, shape.last(p.y));
  for (int y = ya; y <= yb; ++y) {
    const float wy = shape(static_cast<float>(y) + 0.5f - p.y);
    if (wy == 0.0f) continue;
    for (int x = xa; x <= xb; ++x) {
      const float w = wy * shape(static_cast<float>(x) + 0.5f - p.x);
      if (w != 0.0f) accumulate_sample(pixel(x, y), sample, static_cast<double>(w));
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

Image FilmBuffer::image(const ChannelRange& channels) const {
  Image out(width_, height_, channels.names());
  const auto first = static_cast<std::size_t>(channels.first), count = static_cast<std::size_t>(channels.count);
  for (std::size_t i = 0; i < static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_); ++i) {
    const double* from = sums_.data() + i * kStride;
    for (std::size_t c = 0; c < count; ++c)
      out.data[i * count + c] = pixel_mean(from[first + c], from[kPictureChannelCount]);
  }
  return out;
}

}  // namespace octrad
