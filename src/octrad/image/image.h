// A picture in memory: float32 channels, interleaved, row 0 at the top.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "octrad/base/vec.h"

namespace octrad {

// width x height x channels floats. Channel names follow OpenEXR ("R", "albedo.G", "depth.Z" ...).
struct Image {
  int width = 0, height = 0;
  std::vector<std::string> channels;
  std::vector<float> data;                      // [height][width][channel]
  std::map<std::string, std::string> metadata;  // string attributes of the file

  Image() = default;
  Image(int w, int h, std::vector<std::string> names)
      : width(w),
        height(h),
        channels(std::move(names)),
        data(static_cast<std::size_t>(w) * static_cast<std::size_t>(h) * channels.size(), 0.0f) {}

  int channel_count() const { return static_cast<int>(channels.size()); }
  // Index of a channel by name, or -1.
  int channel(const std::string& name) const;
  std::size_t pixel_count() const { return static_cast<std::size_t>(width) * static_cast<std::size_t>(height); }
  float& at(int x, int y, int c) { return data[index(x, y, c)]; }
  float at(int x, int y, int c) const { return data[index(x, y, c)]; }
  // The three channels from `first` on as a colour.
  Vec3f rgb(int x, int y, int first = 0) const {
    const std::size_t i = index(x, y, first);
    return {data[i], data[i + 1], data[i + 2]};
  }
  void set_rgb(int x, int y, Vec3f v, int first = 0) {
    const std::size_t i = index(x, y, first);
    data[i] = v.x;
    data[i + 1] = v.y;
    data[i + 2] = v.z;
  }

 private:
  std::size_t index(int x, int y, int c) const {
    return (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)) *
               channels.size() +
           static_cast<std::size_t>(c);
  }
};

// 8-bit picture for display, interleaved, row 0 at the top; 1 (grey), 3 (RGB) or 4 (RGBA) channels.
struct Image8 {
  int width = 0, height = 0, channels = 3;
  std::vector<std::uint8_t> data;

  Image8() = default;
  Image8(int w, int h, int c)
      : width(w),
        height(h),
        channels(c),
        data(static_cast<std::size_t>(w) * static_cast<std::size_t>(h) * static_cast<std::size_t>(c)) {}
};

// The colour of `image` as a picture with the channels R, G, B (a grey "Y" is repeated). `layer`: "" for the main
// picture, "albedo" for "albedo.R/G/B" and so on. Throws InputError that names the channels there are.
Image extract_rgb(const Image& image, const std::string& layer = "");

}  // namespace octrad
