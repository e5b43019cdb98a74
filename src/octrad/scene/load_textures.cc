#include <algorithm>
#include <cmath>
#include <memory>

#include "octrad/base/join.h"
#include "octrad/base/memory_limit.h"
#include "octrad/base/number_text.h"
#include "octrad/image/io.h"
#include "octrad/image/tonemap.h"
#include "octrad/image/tonemap_math.h"
#include "octrad/scene/builder.h"
#include "octrad/scene/built_files.h"
#include "octrad/scene/plugins.h"
#include "octrad/scene/texture_roles.h"

namespace octrad {
namespace {

const std::vector<std::string> kTextures = {"bitmap", "checkerboard", "mesh_attribute"};

// What can be written instead of textures that there are not.
std::string texture_advice(const std::string& type) {
  if (type == "volume") return "; bake what the volume shows on the surface into a bitmap";
  if (type == "scale") return "; Mitsuba 3 has none: multiply the picture or the colours in it by the factor";
  if (type == "gridtexture" || type == "wireframe" || type == "curvature") return "; bake it into a bitmap";
  if (type == "vertexcolors") return "; use mesh_attribute with the name vertex_color";
  return "";
}

// The channel of a picture without R, G and B that its texture is: Y, R, or the only one beside alpha. -1: none.
int grey_channel(const Image& image) {
  for (const char* name : {"Y", "R"}) {
    if (const int channel = image.channel(name); channel >= 0) return channel;
  }
  int only = -1;
  for (std::size_t i = 0; i < image.channels.size(); ++i) {
    const std::string& name = image.channels[i];
    if (name == "A" || name.ends_with(".A")) continue;
    if (only >= 0) return -1;
    only = static_cast<int>(i);
  }
  return only;
}

}  // namespace

std::vector<std::string> texture_types() { return kTextures; }

int SceneBuilder::constant_texture(Vec3f value) {
  const auto [at, inserted] =
      constants_.emplace(std::make_tuple(value.x, value.y, value.z), static_cast<int>(scene_.textures.size()));
  if (inserted) {
    Texture t;
    t.color0 = t.color1 = value;
    scene_.textures.push_back(t);
  }
  return at->second;
}

int SceneBuilder::product_texture(int a, int b) {
  const auto constant = [this](int texture) {
    return scene_.textures[static_cast<std::size_t>(texture)].kind == Texture::Kind::constant;
  };
  if (constant(a)) std::swap(a, b);
  if (!constant(b)) return -1;
  const float factor = scene_.textures[static_cast<std::size_t>(b)].color0.x;
  Texture t = scene_.textures[static_cast<std::size_t>(a)];
  if (constant(a)) return constant_texture(t.color0 * factor);
  if (factor == 1.0f) return a;
  const int index = static_cast<int>(scene_.textures.size());
  const auto [at, inserted] = products_.emplace(std::pair(a, factor), index);
  if (!inserted) return at->second;
  t.color0 = t.color0 * factor;
  t.color1 = t.color1 * factor;
  scene_.textures.push_back(std::move(t));
  // Its pixels are made when files and meshes are read.
  if (const auto bitmap = bitmap_of_.find(a); bitmap != bitmap_of_.end()) {
    BitmapJob job = bitmaps_[bitmap->second];
    job.texture = index;
    job.factor *= factor;
    bitmap_of_[index] = bitmaps_.size();
    bitmaps_.push_back(std::move(job));
  }
  const auto attribute = std::find_if(attribute_uses_.begin(), attribute_uses_.end(),
                                      [a](const AttributeUse& use) { return use.texture == a; });
  if (attribute != attribute_uses_.end()) {
    AttributeUse use = *attribute;
    use.texture = index;
    use.scale *= factor;
    attribute_uses_.push_back(std::move(use));
  }
  return index;
}

int SceneBuilder::texture(Params& params, const std::string& name, TextureRole role) {
  const Element* parameter = params.find(name);
  if (!parameter) return -1;
  int index = -1;
  const bool usable = report().attempt(parameter->location, [&] {
    const Element& target = follow_reference(description_, *parameter);
    if (const auto value = constant_value(target, role)) {
      index = constant_texture(is_scalar(role) ? Vec3f(number_of(*value)) : *value);
    } else if (target.tag == "texture") {
      index = texture_object(target, role);
    } else {
      fail(parameter->location, "parameter \"" + name + "\" of " + params.what() +
                                    " must be <float>, <rgb>, <spectrum> or <texture>, not <" + target.tag + ">");
    }
  });
  if (usable) return index;
  if (description_.understood) description_.understood->stand_ins.emplace(parameter, stand_in(role));
  return constant_texture(stand_in(role));
}

int SceneBuilder::texture_or(Params& params, const std::string& name, TextureRole role, float fallback) {
  const int index = texture(params, name, role);
  return index >= 0 ? index : constant_texture(Vec3f(fallback));
}

int SceneBuilder::texture_object(const Element& element, TextureRole role) {
  if (element.get("type") == "mesh_attribute") return attribute_texture(element, role);
  // Colours of a checkerboard are checked and converted by their role, pixels of a picture when they are read. What
  // shines may be brighter than 1, and keeps that where the same picture is a reflectance as well.
  const bool bitmap = element.get("type") == "bitmap";
  const TextureRole kind = is_scalar(role)                 ? TextureRole::fraction
                           : role == TextureRole::radiance ? TextureRole::radiance
                                                           : TextureRole::reflectance;
  const auto key = std::make_pair(&element, bitmap ? kind : role);
  if (const auto found = textures_.find(key); found != textures_.end()) {
    if (bitmap) {
      std::vector<TextureRole>& roles = bitmaps_[bitmap_of_.at(found->second)].roles;
      if (std::find(roles.begin(), roles.end(), role) == roles.end()) roles.push_back(role);
    }
    return found->second;
  }
  Params params(description_, element, scene_.warnings);
  Texture t;
  const Transform to_uv = params.get_transform("to_uv");
  const int pick[6] = {0, 1, 3, 4, 5, 7};  // the 2D part: rows x, y; columns x, y, translation
  for (int i = 0; i < 6; ++i) t.to_uv[i] = static_cast<float>(to_uv.m[static_cast<std::size_t>(pick[i])]);
  const int index = static_cast<int>(scene_.textures.size());
  if (params.type() == "bitmap") {
    t.kind = Texture::Kind::bitmap;
    t.filter = params.choice("filter_type", "bilinear", {"bilinear", "nearest"}) == "bilinear"
                   ? Texture::Filter::bilinear
                   : Texture::Filter::nearest;
    const std::string wrap = params.choice("wrap_mode", "repeat", {"repeat", "mirror", "clamp"});
    t.wrap = wrap == "repeat" ? Texture::Wrap::repeat : wrap == "mirror" ? Texture::Wrap::mirror : Texture::Wrap::clamp;
    BitmapJob job;
    job.texture = index;
    job.raw = params.get_bool("raw", false);
    job.scalar = is_scalar(role);
    const std::string file = params.required_string("filename");
    job.where = params.where("filename");
    job.built = description_.built_picture(file);
    job.path = job.built ? file : description_.resolve(file, job.where);
    params.ignore({"format", "accel"});
    job.roles = {role};
    bitmap_of_[index] = bitmaps_.size();
    bitmaps_.push_back(job);
  } else if (params.type() == "checkerboard") {
    t.kind = Texture::Kind::checkerboard;
    for (const auto& [name, color] : {std::make_pair("color0", &t.color0), std::make_pair("color1", &t.color1)}) {
      const Element* parameter = params.find(name);
      if (!parameter) continue;
      const auto value = constant_value(follow_reference(description_, *parameter), role);
      if (!value)
        fail(parameter->location, std::string("parameter \"") + name +
                                      "\" of a checkerboard must be a constant: <rgb>, <float> or <spectrum>; bake "
                                      "one of textures into a bitmap");
      *color = is_scalar(role) ? Vec3f(number_of(*value)) : *value;
    }
    // As Mitsuba's eval_1, which exchanges the colours that its eval shows.
    if (is_scalar(role)) std::swap(t.color0, t.color1);
  } else {
    params.fail_type(kTextures, "", texture_advice(params.type()));
  }
  params.finish();
  textures_.emplace(key, index);
  scene_.textures.push_back(std::move(t));
  return index;
}

void SceneBuilder::load_bitmap(std::size_t number) {
  BitmapJob& job = bitmaps_[number];
  const std::shared_ptr<const Image> picture =
      job.built ? std::make_shared<Image>(job.built->read())
                : picture_files_.at(job.path).take([&] { return read_image(job.path); });
  const Image& image = *picture;
  const std::size_t pixels = static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
  if (pixels == 0) fail(job.where, "the picture " + job.path + " is empty");
  // Alpha is not used (Mitsuba drops it as well).
  int channel[3] = {image.channel("R"), image.channel("G"), image.channel("B")};
  if (channel[0] < 0 || channel[1] < 0 || channel[2] < 0) {
    const int grey = grey_channel(image);
    if (grey < 0)
      fail(job.where, "the picture " + job.path +
                          " has neither R, G and B nor one channel that could be grey; it has " + join(image.channels));
    channel[0] = channel[1] = channel[2] = grey;
  }
  const bool decode = !job.raw && is_display_referred(image);
  float table[256];
  for (int i = 0; i < 256; ++i) table[i] = static_cast<float>(decode_srgb(i / 255.0));
  ask_memory(pixels * sizeof(Vec3f), job.path);
  std::vector<Vec3f> result(pixels);
  const std::size_t stride = image.channels.size();
  std::size_t bad = 0;
  for (std::size_t i = 0; i < pixels; ++i) {
    Vec3f v;
    for (int c = 0; c < 3; ++c) {
      float x = image.data[i * stride + static_cast<std::size_t>(channel[c])];
      if (decode) {
        const int byte = static_cast<int>(std::clamp(x, 0.0f, 1.0f) * 255.0f + 0.5f);
        x = std::fabs(x * 255.0f - static_cast<float>(byte)) < 1e-3f
                ? table[byte]
                : static_cast<float>(decode_srgb(static_cast<double>(x)));  // or 16 bits
      }
      bad += std::isfinite(x) ? 0 : 1;
      v[c] = x;
    }
    result[i] = job.scalar ? Vec3f(channel[0] == channel[1] ? v.x : luminance(v)) : v * job.scale;
  }
  if (bad > 0)
    fail(job.where, "the picture " + job.path + " has " + std::to_string(bad) + " values that are not finite");
  if (std::find(job.roles.begin(), job.roles.end(), TextureRole::radiance) != job.roles.end()) {
    for (Vec3f& v : result) {  // filters and denoisers overshoot
      for (int c = 0; c < 3; ++c) {
        if (v[c] >= 0.0f) continue;
        v[c] = 0.0f;
        ++job.negative;
      }
    }
  }
  for (const TextureRole role : job.roles) {
    const Range range = range_of(role);
    constexpr float kTolerance = 1e-3f,  // of half precision
        kOvershoot = 0.05f;              // of filters and of lossy compression
    for (Vec3f& v : result) {
      if (role == TextureRole::reflectance) {
        const float largest = std::max({v.x, v.y, v.z});
        if (largest > range.high + kOvershoot) {  // of an HDR picture
          v = min(v, Vec3f(range.high));
          ++job.bright;
          job.brightest = std::max(job.brightest, largest);
        }
      }
      for (int c = 0; c < 3; ++c) {
        if (role == TextureRole::reflectance && v[c] < range.low - kOvershoot) {  // of another gamut
          v[c] = range.low;
          ++job.negative;
        }
        if (range.holds(v[c], range.high <= 1.0f ? kTolerance : 0.0f)) continue;
        if (range.high > 1.0f || !range.holds(v[c], kOvershoot))
          fail(job.where, "the picture " + job.path + " has the value " + number_text(v[c]) + ": " + range.text);
        v[c] = std::clamp(v[c], range.low, range.high);
        ++job.beyond;
      }
    }
  }
  if (job.factor != 1.0f) {
    for (Vec3f& v : result) v = v * job.factor;
  }
  fill_bitmap(job, image.width, image.height, std::move(result));
}

void SceneBuilder::fill_bitmap(const BitmapJob& job, int width, int height, std::vector<Vec3f> pixels) {
  if (job.texture >= 0) {
    Texture& t = scene_.textures[static_cast<std::size_t>(job.texture)];
    t.width = width;
    t.height = height;
    t.pixels = std::move(pixels);
  } else {
    Environment& e = scene_.environments[0];
    e.width = width;
    e.height = height;
    e.pixels = std::move(pixels);
  }
}

}  // namespace octrad
