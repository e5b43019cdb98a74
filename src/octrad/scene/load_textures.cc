#include <algorithm>
#include <cmath>
#include <limits>

#include "octrad/base/error.h"
#include "octrad/base/memory_limit.h"
#include "octrad/image/io.h"
#include "octrad/scene/builder.h"

namespace octrad {
namespace {

// Linear sRGB of a spectrum that is 1 at every wavelength (the equal-energy illuminant); what a uniform emitter shows.
constexpr Vec3f kEqualEnergy{1.204793f, 0.948290f, 0.908917f};

float decode_srgb(double v) {
  return static_cast<float>(v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4));
}

bool is_scalar(TextureRole role) {
  return role != TextureRole::reflectance && role != TextureRole::radiance && role != TextureRole::normal;
}

struct Range {
  float low, high;
  const char* text;
  bool holds(float v, float tolerance = 0.0f) const { return v >= low - tolerance && v <= high + tolerance; }
};

Range range_of(TextureRole role) {
  constexpr float kMax = std::numeric_limits<float>::max();
  switch (role) {
    case TextureRole::reflectance: return {0.0f, 1.0f, "a reflectance must be between 0 and 1"};
    case TextureRole::radiance: return {0.0f, kMax, "a radiance must be finite and not negative"};
    case TextureRole::opacity: return {0.0f, 1.0f, "an opacity must be between 0 and 1"};
    case TextureRole::roughness: return {0.0f, 10.0f, "a roughness must be between 0 and 10"};
    case TextureRole::index: return {0.0f, 1000.0f, "an index of refraction must be between 0 and 1000"};
    case TextureRole::fraction: return {0.0f, 1.0f, "the value must be between 0 and 1"};
    case TextureRole::two_sides: return {0.0f, 2.0f, "the value must be between 0 and 2"};
    case TextureRole::normal: return {0.0f, 1.0f, "a normal map's colours must be between 0 and 1"};
    case TextureRole::height: return {-kMax, kMax, "a height must be finite"};
  }
  return {};
}

void check_range(Vec3f value, TextureRole role, const Element& element) {
  const Range range = range_of(role);
  if (!range.holds(value.x) || !range.holds(value.y) || !range.holds(value.z))
    fail(element.location, range.text + std::string(", not ") + element.get("value"));
}

}  // namespace

std::optional<Vec3f> SceneBuilder::constant_value(const Element& element, TextureRole role) {
  if (element.tag == "rgb") {
    const Vec3f value = parse_rgb(element);
    check_range(value, role, element);
    return value;
  }
  const auto number = [&](const Element& e) {
    const auto numbers = parse_numbers(e.get("value"));
    if (!numbers || numbers->size() != 1) {
      fail(e.location, "<" + e.tag + ">: \"" + e.get("value") + "\" is not one number" +
                           (e.tag == "spectrum" ? "; spectra over wavelengths are not supported, use <rgb>" : ""));
    }
    const Vec3f value(static_cast<float>((*numbers)[0]));
    check_range(value, role, e);
    return value;
  };
  if (element.tag == "float" || element.tag == "integer") return number(element);
  if (element.tag != "spectrum") return std::nullopt;
  const Vec3f white = role == TextureRole::radiance ? kEqualEnergy : Vec3f(1.0f);
  if (element.find("type")) {
    Params params(description_, element, scene_.warnings);
    Vec3f value(0.0f);
    if (params.type() == "uniform") {
      value = white * params.get_float("value", 1.0f);
    } else if (params.type() == "d65") {
      value = Vec3f(params.get_float("scale", 1.0f));  // the white of linear sRGB
    } else {
      fail(element.location,
           "spectrum \"" + params.type() + "\" is not supported; supported: uniform, d65; or use <rgb>");
    }
    params.finish();
    check_range(value, role, element);
    return value;
  }
  if (element.find("filename")) fail(element.location, "spectra from files are not supported, use <rgb>");
  return number(element) * white;
}

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

int SceneBuilder::texture(Params& params, const std::string& name, TextureRole role) {
  const Element* parameter = params.find(name);
  if (!parameter) return -1;
  if (const auto value = constant_value(*parameter, role))
    return constant_texture(is_scalar(role) ? Vec3f(luminance(*value)) : *value);
  const Element& target = follow_reference(description_, *parameter);
  if (target.tag != "texture") {
    fail(parameter->location, "parameter \"" + name + "\" of " + params.what() +
                                  " must be <float>, <rgb>, <spectrum> or <texture>, not <" + target.tag + ">");
  }
  return texture_object(target, role);
}

int SceneBuilder::texture_or(Params& params, const std::string& name, TextureRole role, float fallback) {
  const int index = texture(params, name, role);
  return index >= 0 ? index : constant_texture(Vec3f(fallback));
}

int SceneBuilder::texture_object(const Element& element, TextureRole role) {
  // A role matters only through its kind of value; one record serves all colours, another all scalars.
  const auto key = std::make_pair(&element, is_scalar(role));
  if (const auto found = textures_.find(key); found != textures_.end()) {
    if (const auto bitmap = bitmap_of_.find(found->second); bitmap != bitmap_of_.end()) {
      std::vector<TextureRole>& roles = bitmaps_[bitmap->second].roles;
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
    job.path = description_.resolve(file, job.where);
    params.ignore({"format", "accel"});
    job.roles = {role};
    bitmap_of_[index] = bitmaps_.size();
    bitmaps_.push_back(job);
  } else if (params.type() == "checkerboard") {
    t.kind = Texture::Kind::checkerboard;
    for (const auto& [name, color] : {std::make_pair("color0", &t.color0), std::make_pair("color1", &t.color1)}) {
      const Element* parameter = params.find(name);
      if (!parameter) continue;
      const auto value = constant_value(*parameter, role);
      if (!value)
        fail(parameter->location, std::string("parameter \"") + name +
                                      "\" of a checkerboard must be a constant: <rgb>, <float> or <spectrum>");
      *color = is_scalar(role) ? Vec3f(luminance(*value)) : *value;
    }
  } else {
    fail(element.location, "texture \"" + params.type() + "\" is not supported" +
                               did_you_mean(params.type(), {"bitmap", "checkerboard"}) +
                               "; supported: bitmap, checkerboard");
  }
  params.finish();
  textures_.emplace(key, index);
  scene_.textures.push_back(std::move(t));
  return index;
}

void SceneBuilder::load_bitmap(std::size_t number) {
  const BitmapJob& job = bitmaps_[number];
  const Image image = read_image(job.path);
  const std::size_t pixels = static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
  if (pixels == 0) fail(job.where, "the picture " + job.path + " is empty");
  // Alpha is not used (Mitsuba drops it as well); one or two channels are grey.
  int channel[3] = {image.channel("R"), image.channel("G"), image.channel("B")};
  if (channel[0] < 0 || channel[1] < 0 || channel[2] < 0) {
    int grey = image.channel("Y");
    if (grey < 0) grey = std::max(channel[0], 0);
    if (image.channel_count() < 1) fail(job.where, "the picture " + job.path + " has no channels");
    channel[0] = channel[1] = channel[2] = grey;
  }
  const auto encoding = image.metadata.find("encoding");
  const bool decode = !job.raw && encoding != image.metadata.end() && encoding->second == "srgb8";
  float table[256];
  for (int i = 0; i < 256; ++i) table[i] = decode_srgb(i / 255.0);
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
        x = std::fabs(x * 255.0f - static_cast<float>(byte)) < 1e-3f ? table[byte] : decode_srgb(x);  // 8 bits, or 16
      }
      bad += std::isfinite(x) ? 0 : 1;
      v[c] = x;
    }
    result[i] = job.scalar ? Vec3f(channel[0] == channel[1] ? v.x : luminance(v)) : v * job.scale;
  }
  if (bad > 0)
    fail(job.where, "the picture " + job.path + " has " + std::to_string(bad) + " values that are not finite");
  for (const TextureRole role : job.roles) {
    const Range range = range_of(role);
    constexpr float kTolerance = 1e-3f;  // of filters and of half precision
    for (const Vec3f& v : result) {
      for (int c = 0; c < 3; ++c) {
        if (!range.holds(v[c], range.high <= 1.0f ? kTolerance : 0.0f))
          fail(job.where, "the picture " + job.path + " has the value " + std::to_string(v[c]) + ": " + range.text);
      }
    }
  }
  if (job.texture >= 0) {
    Texture& t = scene_.textures[static_cast<std::size_t>(job.texture)];
    t.width = image.width;
    t.height = image.height;
    t.pixels = std::move(result);
  } else {
    Environment& e = scene_.environments[0];
    e.width = image.width;
    e.height = image.height;
    e.pixels = std::move(result);
  }
}

}  // namespace octrad
