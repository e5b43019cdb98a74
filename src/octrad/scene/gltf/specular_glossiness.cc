#include "octrad/scene/gltf/specular_glossiness.h"

#include <algorithm>
#include <cmath>

#include "octrad/base/memory_limit.h"
#include "octrad/scene/picture_values.h"

namespace octrad {
namespace {

double brightness(Vec3d c) { return std::sqrt(0.299 * c.x * c.x + 0.587 * c.y * c.y + 0.114 * c.z * c.z); }

// The picture in linear colours times `factor`, in [0, 1].
Image linear_colors(const Image& in, Vec3d factor, const std::string& name) {
  const std::vector<int> from = color_channels(in);
  ask_memory(in.pixel_count() * 3 * sizeof(float), name);
  Image out(in.width, in.height, {"R", "G", "B"});
  const LinearValues linear(in);
  const std::size_t stride = in.channels.size();
  for (std::size_t i = 0; i < in.pixel_count(); ++i) {
    for (int c = 0; c < 3; ++c) {
      const float value = in.data[i * stride + static_cast<std::size_t>(from[static_cast<std::size_t>(c)])];
      out.data[3 * i + static_cast<std::size_t>(c)] =
          static_cast<float>(std::clamp(linear(value) * factor[c], 0.0, 1.0));
    }
  }
  return out;
}

}  // namespace

GltfMetal metal_of_specular(Vec3d diffuse, Vec3d specular) {
  constexpr double kLeast = 1e-6;
  const double strongest = std::max({specular.x, specular.y, specular.z});
  const Vec3d under = diffuse * ((1.0 - strongest) / (1.0 - kGltfDielectric));
  const double d = brightness(under), s = brightness(specular);
  GltfMetal metal{under, 0.0};
  if (s > kGltfDielectric) {
    const double a = kGltfDielectric, b = d + s - 2.0 * a, c = a - s;  // c < 0: one root is above 0
    metal.metallic = std::clamp((std::sqrt(b * b - 4.0 * a * c) - b) / (2.0 * a), 0.0, 1.0);
    const Vec3d by_diffuse = under / std::max(1.0 - metal.metallic, kLeast),
                by_specular = (specular - Vec3d(a * (1.0 - metal.metallic))) / std::max(metal.metallic, kLeast);
    const double share = metal.metallic * metal.metallic;
    metal.base = by_diffuse * (1.0 - share) + by_specular * share;
  }
  for (int i = 0; i < 3; ++i) metal.base[i] = std::clamp(metal.base[i], 0.0, 1.0);
  return metal;
}

Image picture_of_metal(const GltfSpecularPictures& pictures, bool metallic) {
  const MemoryScope scope;
  const std::function<Image()>* sources[2] = {&pictures.diffuse_picture, &pictures.specular_picture};
  const Vec3d factors[2] = {pictures.diffuse, pictures.specular};
  Image parts[2];
  int width = 0, height = 0;
  for (int i = 0; i < 2; ++i) {
    if (!*sources[i]) continue;
    parts[i] = linear_colors((*sources[i])(), factors[i], pictures.name);
    if (i == 1 && parts[1].pixel_count() <= parts[0].pixel_count()) continue;
    width = parts[i].width;
    height = parts[i].height;
  }
  ask_memory(
      static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height) * (metallic ? 1 : 3) * sizeof(float),
      pictures.name);
  Image out(width, height, metallic ? std::vector<std::string>{"Y"} : std::vector<std::string>{"R", "G", "B"});
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      Vec3d colors[2];
      for (int i = 0; i < 2; ++i) {
        const Image& part = parts[i];
        if (!*sources[i]) colors[i] = factors[i];
        else if (part.width == width && part.height == height) colors[i] = Vec3d(part.rgb(x, y));
        else colors[i] = color_between(part, (x + 0.5) / width, (y + 0.5) / height, pictures.repeats);
      }
      const GltfMetal metal = metal_of_specular(colors[0], colors[1]);
      if (metallic) out.at(x, y, 0) = static_cast<float>(metal.metallic);
      else out.set_rgb(x, y, Vec3f(metal.base));
    }
  }
  return out;
}

}  // namespace octrad
