// Colours, spectra and textures of pbrt. What depends on constants alone becomes one, what is a picture with factors
// becomes a bitmap or a picture that is made; textures that are computed from the place are refused.
#include <algorithm>
#include <array>
#include <cmath>

#include "octrad/base/join.h"
#include "octrad/base/number_text.h"
#include "octrad/base/read_decimal.h"
#include "octrad/image/io.h"
#include "octrad/image/tonemap.h"
#include "octrad/scene/named_materials.h"
#include "octrad/scene/pbrt/material.h"
#include "octrad/scene/picture_values.h"

namespace octrad {
namespace {

constexpr int kMostNested = 64;

// pbrt-v3: TrowbridgeReitzDistribution::RoughnessToAlpha.
double old_alpha(double roughness) {
  const double l = std::log(std::max(roughness, 1e-3));
  return 1.62142 + l * (0.819955 + l * (0.1734 + l * (0.0171201 + l * 0.000640711)));
}

Vec3d clamped(Vec3d v) { return {std::clamp(v.x, 0.0, 1.0), std::clamp(v.y, 0.0, 1.0), std::clamp(v.z, 0.0, 1.0)}; }

// Of a luminance of 1.
Vec3d normalized_light(const Spectrum& spectrum, const Location& where) {
  const Vec3f rgb = spectrum_rgb(spectrum, SpectrumUse::emission);
  const double y = static_cast<double>(luminance(rgb));
  if (!(y > 0.0)) fail(where, "the spectrum gives no light that can be seen");
  return Vec3d(rgb) / y;
}

// Of brass; refractiveindex.info, at 650, 550 and 450 nm.
constexpr Vec3d kBrassEta{0.444, 0.527, 1.094}, kBrassK{3.695, 2.765, 1.829};

Vec3d mixture(const PbrtMix& mix, Vec3d a, Vec3d b, Vec3d amount) {
  const Vec3d share(channel_mean(amount));
  return mix.product ? a * b : a * (Vec3d(1.0) - share) + b * share;
}

// The alpha channel, where a pixel is not opaque; else -1.
int used_alpha(const Image& image) {
  const int alpha = image.channel("A");
  for (int y = 0; y < image.height && alpha >= 0; ++y) {
    for (int x = 0; x < image.width; ++x) {
      if (image.at(x, y, alpha) < 1.0f) return alpha;
    }
  }
  return -1;
}

// The colours of a picture, with its factors; of numbers, which may be below 0.
Image linear_picture(const PbrtTexture& t, bool numbers) {
  const std::vector<std::string> rgb = {"R", "G", "B"};
  if (!t.mix) {
    const Image in = read_image(t.file);
    const std::vector<int> from = color_channels(in);
    const LinearValues linear(in);
    ask_memory(in.pixel_count() * 3 * sizeof(float), t.file);
    Image out(in.width, in.height, rgb);
    const int alpha = t.number ? used_alpha(in) : -1;
    const bool encoded = t.gamma != 0.0 && is_display_referred(in);  // other formats hold numbers as they are
    for (int y = 0; y < in.height; ++y) {
      for (int x = 0; x < in.width; ++x) {
        Vec3d v;
        for (int c = 0; c < 3; ++c) {
          const float stored = in.at(x, y, alpha >= 0 ? alpha : from[static_cast<std::size_t>(c)]);
          v[c] = !encoded ? linear(stored) : std::pow(std::max(static_cast<double>(stored), 0.0), t.gamma);
          v[c] = t.invert ? 1.0 - t.gain * v[c] : t.gain * v[c];
          if (t.invert || !numbers) v[c] = std::max(0.0, v[c]);
        }
        if (t.number) v = Vec3d(channel_mean(v));
        out.set_rgb(x, y, Vec3f(v * t.value));
      }
    }
    return out;
  }
  // As large as the largest of them; a constant is one pixel, and a field of a checkerboard a whole number of pixels,
  // 16 where they are few.
  const PbrtMix& mix = *t.mix;
  const PbrtTexture* parts[3] = {&mix.a, &mix.b, &mix.amount};
  const PbrtTexture* first = nullptr;  // of the pictures
  Image pictures[3];
  int size[2] = {1, 1};
  for (int i = 0; i < 3; ++i) {
    if (parts[i]->kind != PbrtTexture::Kind::picture) {
      pictures[i] = Image(1, 1, rgb);
      pictures[i].set_rgb(0, 0, Vec3f(parts[i]->value));
    } else {
      pictures[i] = linear_picture(*parts[i], numbers || parts[i] == &mix.amount);
      if (!first) first = parts[i];
    }
    size[0] = std::max(size[0], pictures[i].width * mix.repeats[0]);
    size[1] = std::max(size[1], pictures[i].height * mix.repeats[1]);
  }
  for (int i = 0; i < 2; ++i) {
    const int fields = mix.fields[i], least = fields > 1 ? std::max(fields, std::min(16 * fields, 4096)) : 1;
    size[i] = (std::max(size[i], least) + fields - 1) / fields * fields;
  }
  const int width = size[0], height = size[1];
  ask_memory(static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height) * 3 * sizeof(float), "a texture");
  Image out(width, height, rgb);
  const bool repeat = t.wrap == "repeat";
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      // At the middle of this pixel, in pictures from the upper left corner.
      const double u = (x + 0.5) / width * mix.repeats[0], v = (y + 0.5) / height * mix.repeats[1];
      Vec3d values[3];
      for (int i = 0; i < 3; ++i) {
        if (parts[i]->kind == PbrtTexture::Kind::checkerboard) {
          const double up[2] = {u, mix.repeats[1] - v};  // v of pbrt
          double sum = 0.0;
          for (int k = 0; k < 2; ++k)
            sum += std::floor((up[k] - first->offset[k]) / first->scale[k] * parts[i]->scale[k] + parts[i]->offset[k]);
          values[i] = std::fmod(sum, 2.0) == 0.0 ? parts[i]->value : parts[i]->other;
          continue;
        }
        values[i] = color_between(pictures[i], u, v, repeat);
      }
      out.set_rgb(x, y, Vec3f(mixture(mix, values[0], values[1], values[2]) * t.value));
    }
  }
  return out;
}

template <typename Numbers>
void append(std::string& text, const Numbers& numbers) {
  for (const double v : numbers) text.append(" ").append(number_text(v));
}

// What the picture is made of.
std::string text_of(const PbrtTexture& t) {
  std::string text = std::to_string(static_cast<int>(t.kind)) + (t.invert ? " inverted " : " ") +
                     (t.number ? "number " : "") + (t.nearest ? "nearest " : "") + t.wrap + " " + number_text(t.gamma) +
                     " " + number_text(t.gain);
  append(text, std::array{t.value.x, t.value.y, t.value.z, t.other.x, t.other.y, t.other.z});
  text += " " + t.file;
  if (t.mix) {
    text += t.mix->product ? " product" : " mix";
    for (const PbrtTexture* part : {&t.mix->a, &t.mix->b, &t.mix->amount}) {
      text += " (" + text_of(*part);
      append(text, std::array{part->scale[0], part->scale[1], part->offset[0], part->offset[1]});
      text += ")";
    }
  }
  return text;
}

}  // namespace

double pbrt_map(PbrtMap map, double value) {
  switch (map) {
    case PbrtMap::none: return value;
    case PbrtMap::root: return std::sqrt(std::max(value, 0.0));
    case PbrtMap::fourth_root: return std::sqrt(std::sqrt(std::max(value, 0.0)));
    case PbrtMap::old_alpha: return old_alpha(value);
    case PbrtMap::old_alpha_root: return std::sqrt(std::max(old_alpha(value), 0.0));
    case PbrtMap::old_cut: return value == 0.0 ? 0.0 : 1.0;
  }
  return value;
}

std::optional<Vec3d> PbrtMaterials::named_spectrum(const std::string& name, SpectrumUse use) const {
  // Metals: "metal-Cu-eta", "metal-Cu-k".
  if (name.starts_with("metal-")) {
    const std::size_t dash = name.rfind('-');
    const std::string metal = name.substr(6, dash > 6 ? dash - 6 : 0), part = name.substr(dash + 1);
    if (part != "eta" && part != "k") return std::nullopt;
    if (metal == "CuZn") return part == "eta" ? kBrassEta : kBrassK;
    if (const auto known = named_conductor(metal)) return Vec3d(part == "eta" ? known->eta : known->k);
    return std::nullopt;
  }
  // Schott's glasses at 587.6 nm.
  static const std::pair<const char*, double> glasses[] = {
      {"glass-BK7", 1.5168}, {"glass-BAF10", 1.6700}, {"glass-FK51A", 1.4866}, {"glass-LASF9", 1.8503},
      {"glass-F5", 1.6727},  {"glass-SF5", 1.6727},   {"glass-F10", 1.7283},   {"glass-SF10", 1.7283},
      {"glass-F11", 1.7847}, {"glass-SF11", 1.7847}};
  for (const auto& [glass, index] : glasses) {
    if (name == glass) return Vec3d(index);
  }
  if (use != SpectrumUse::emission) return std::nullopt;
  if (name == "stdillum-D65") return Vec3d(1.0);  // the white of RGB
  if (name == "stdillum-A") return normalized_light(blackbody_spectrum(2856.0), {});
  if (name == "stdillum-D50") return normalized_light(blackbody_spectrum(5003.0), {});
  return std::nullopt;
}

std::optional<Vec3d> PbrtMaterials::color(const PbrtObject& object, std::string_view name, SpectrumUse use) const {
  const PbrtParameter* p = object.find(name, {"rgb", "color", "spectrum", "blackbody", "xyz", "float"});
  if (!p) return std::nullopt;
  const auto count = [&](std::size_t wanted, const char* text) {
    if (p->numbers.size() != wanted)
      fail(p->where, "the parameter \"" + p->name + "\" of " + object.what() + " must be " + text);
  };
  if (p->type == "float") {
    count(1, "one number");
    return Vec3d(p->numbers[0]);
  }
  if (p->type == "blackbody") {
    // Version 3 may give a factor as well.
    if (p->numbers.size() != 2) count(1, "a temperature in kelvin");
    if (!(p->numbers[0] >= 200.0 && p->numbers[0] <= 1e6))
      fail(p->where, "a temperature must be from 200 to 1e6 kelvin");
    const double kelvin = p->numbers[0], factor = p->numbers.size() == 2 ? p->numbers[1] : 1.0;
    if (!old_) return normalized_light(blackbody_spectrum(kelvin), p->where) * factor;
    // Version 3: of 1 where it is highest, which is at 2.8977720e-3 m K.
    return Vec3d(spectrum_rgb(blackbody_spectrum(kelvin), SpectrumUse::emission)) *
           (factor / blackbody_radiance(2.8977720e6 / kelvin, kelvin));
  }
  if (p->type == "rgb" || p->type == "color" || p->type == "xyz") {
    count(3, "three numbers");
    const Vec3d v{p->numbers[0], p->numbers[1], p->numbers[2]};
    if (p->type != "xyz") return v;
    return rgb_of_xyz(v);
  }
  const auto rgb = [&](Spectrum spectrum) {
    if (old_) spectrum = held_at_ends(std::move(spectrum));
    return use == SpectrumUse::emission && !old_ ? normalized_light(spectrum, p->where)
                                                 : Vec3d(spectrum_rgb(spectrum, use));
  };
  if (!p->texts.empty()) {
    if (p->texts.size() != 1) fail(p->where, "the spectrum \"" + p->name + "\" must be one name or file");
    if (const auto named = named_spectrum(p->texts[0], use)) return named;
    if (p->texts[0].starts_with("stdillum-") || p->texts[0].starts_with("illum-"))
      fail(p->where, "the illuminant \"" + p->texts[0] + "\" is not known; give the light as rgb or blackbody");
    if (p->texts[0].starts_with("metal-") || p->texts[0].starts_with("glass-"))
      fail(p->where, "the spectrum \"" + p->texts[0] + "\" is not known; give it as rgb, or glass as a number");
    const std::string file = description_.resolve(p->texts[0], p->where);
    const std::pair key{file, use};
    const auto known = spectra_.find(key);
    return known != spectra_.end() ? known->second : spectra_[key] = rgb(read_spectrum(file));
  }
  if (p->numbers.size() == 1) return Vec3d(p->numbers[0]);
  if (p->numbers.size() % 2 != 0) fail(p->where, "a spectrum is pairs of a wavelength and a value");
  std::vector<std::pair<double, double>> pairs;
  for (std::size_t i = 0; i < p->numbers.size(); i += 2) pairs.emplace_back(p->numbers[i], p->numbers[i + 1]);
  if (old_) std::sort(pairs.begin(), pairs.end());  // version 3 takes any order; of files it must be this one
  std::vector<double> wavelengths, values;
  for (const auto& [wavelength, value] : pairs) {
    wavelengths.push_back(wavelength);
    values.push_back(value);
  }
  return rgb(make_spectrum(std::move(wavelengths), std::move(values), p->where));
}

PbrtTexture PbrtMaterials::texture(const PbrtObject& object, std::string_view name, bool number, Vec3d fallback) {
  PbrtTexture t;
  t.value = fallback;
  if (const PbrtParameter* p = object.find(name); p && p->type == "texture") {
    if (p->texts.size() != 1) fail(p->where, "the parameter \"" + p->name + "\" must name one texture");
    return named_texture(p->texts[0], number, *p);
  }
  if (number) t.value = Vec3d(object.number(name, fallback.x));
  else t.value = color(object, name, SpectrumUse::reflectance).value_or(fallback);
  return t;
}

bool PbrtMaterials::has_texture(const PbrtObject& object, std::string_view name, bool number) const {
  const PbrtParameter* p = object.find(name);
  return p && p->type == "texture" && p->texts.size() == 1 && objects_.count({number, p->texts[0]}) > 0;
}

const PbrtMaterials::Object* PbrtMaterials::defined(const Definitions& all, std::size_t serial) const {
  if (!old_) return &all.back().second;
  const Object* last = nullptr;
  for (const auto& [when, object] : all) {
    if (when < serial) last = &object;
  }
  return last;
}

double PbrtMaterials::constant_number(const PbrtObject& object, std::string_view name, double fallback) {
  const PbrtTexture t = texture(object, name, true, Vec3d(fallback));
  if (t.is_constant()) return t.value.x;
  report_.assume(object.where(name), "\"" + std::string(name) + "\" of " + object.what() +
                                         " is one number: " + number_text(fallback) + " instead of a texture");
  return fallback;
}

Vec3d PbrtMaterials::strength(const PbrtObject& light, const char* name) const {
  Vec3d factor(exposure);
  if (const PbrtParameter* p = light.find("scale"); p && p->type != "float")
    factor = factor * color(light, "scale", SpectrumUse::emission).value_or(Vec3d(1.0));
  else factor = factor * light.number("scale", 1.0, 0.0);
  Vec3d v = color(light, name, SpectrumUse::emission).value_or(Vec3d(1.0));
  for (int c = 0; c < 3; ++c) v[c] = std::max(v[c], 0.0);
  return v * factor;
}

PbrtTexture PbrtMaterials::named_texture(const std::string& name, bool number, const PbrtParameter& user) {
  const auto found = objects_.find({number, name});
  const Object* definition = found == objects_.end() ? nullptr : defined(found->second, user.serial);
  if (!definition) {
    std::vector<std::string> known;
    for (const auto& [key, object] : objects_) {
      if (key.first == number && known.size() < 1000) known.push_back(key.second);
    }
    fail(user.where, std::string("there is no texture of ") + (number ? "numbers" : "colours") + " with the name \"" +
                         name + "\"" + did_you_mean(name, known));
  }
  const Object object = *definition;
  if (const auto known = values_.find(object.get()); known != values_.end()) return known->second;
  if (open_ >= kMostNested) fail(user.where, "textures are nested too deep, or one uses itself");
  ++open_;
  struct Close {
    int& open;
    ~Close() { --open; }
  } const close{open_};
  const PbrtTexture value = evaluate(*object, number);
  object->note_unused(report_);
  values_.emplace(object.get(), value);
  return value;
}

PbrtTexture PbrtMaterials::evaluate(const PbrtObject& object, bool number) {
  const std::string& type = object.type();
  if (type == "constant") return texture(object, "value", number, Vec3d(1.0));
  if (type == "imagemap") {
    PbrtTexture t = picture(object);
    t.number = number && !old_;
    return t;
  }
  if (type == "scale") {
    const bool v3 = object.has("tex1") || object.has("tex2");
    PbrtTexture a = texture(object, v3 ? "tex1" : "tex", number, Vec3d(1.0));
    PbrtTexture b = texture(object, v3 ? "tex2" : "scale", v3 ? number : true, Vec3d(1.0));
    if (a.is_constant()) std::swap(a, b);
    if (!b.is_constant()) return mixed(object, {a, b, {}, true});
    a.value = a.value * b.value;
    a.other = a.other * b.value;
    return a;
  }
  if (type == "mix") {
    const PbrtTexture a = texture(object, "tex1", number, Vec3d(0.0)), b = texture(object, "tex2", number, Vec3d(1.0)),
                      amount = texture(object, "amount", true, Vec3d(0.5));
    if (a == b || (amount.is_constant() && amount.value.x <= 0.0)) return a;
    if (amount.is_constant() && amount.value.x >= 1.0) return b;
    if (!a.is_constant() || !b.is_constant() || !amount.is_constant()) return mixed(object, {a, b, amount, false});
    PbrtTexture result = a;
    result.value = a.value * (1.0 - amount.value.x) + b.value * amount.value.x;
    return result;
  }
  if (type == "checkerboard") {
    if (object.number("dimension", 2.0) != 2.0)
      fail(object.location(), "a checkerboard of three dimensions is not supported; bake it into a picture");
    const PbrtTexture a = texture(object, "tex1", number, Vec3d(1.0)), b = texture(object, "tex2", number, Vec3d(0.0));
    object.ignore({"aamode"});
    PbrtTexture t = picture(object);  // its texture coordinates
    t.kind = PbrtTexture::Kind::checkerboard;
    if (!a.is_constant() || !b.is_constant()) {
      t.value = Vec3d(0.0);
      t.other = Vec3d(1.0);
      return mixed(object, {a, b, t, false});
    }
    t.value = a.value;
    t.other = b.value;
    return t;
  }
  fail(object.location(), object.what() +
                              " is not supported; bake it into a picture and load that as an imagemap. "
                              "Supported: constant, imagemap, scale, mix, checkerboard");
}

// A checkerboard of checkerboards, or a picture that is made of others; each must lie on the surface in one way.
PbrtTexture PbrtMaterials::mixed(const PbrtObject& object, PbrtMix mix) const {
  constexpr int kMostFiles = 16, kMostRepeats = 8, kMostFields = 1024;
  const auto refuse = [&](const std::string& text) {
    fail(object.location(), object.what() + " of " + text + " is not supported; bake it into a picture");
  };
  const PbrtTexture *picture = nullptr, *checks = nullptr;
  int files = 0;
  for (const PbrtTexture* part : {&mix.a, &mix.b, &mix.amount}) {
    if (part->is_constant()) continue;
    const bool is_picture = part->kind == PbrtTexture::Kind::picture;
    const PbrtTexture*& first = is_picture ? picture : checks;
    if (!first) first = part;
    if (!std::equal(first->scale, first->scale + 2, part->scale) ||
        !std::equal(first->offset, first->offset + 2, part->offset) || first->wrap != part->wrap)
      refuse(std::string(is_picture ? "pictures" : "checkerboards") + " that lie on the surface in two ways");
    if (is_picture) files += std::max(part->files, 1);
  }
  if (files > kMostFiles) fail(object.location(), object.what() + " is made of more than 16 pictures");
  if (!picture) {
    PbrtTexture t = *checks;
    const auto other = [](const PbrtTexture& part) { return part.is_constant() ? part.value : part.other; };
    t.value = mixture(mix, mix.a.value, mix.b.value, mix.amount.value);
    t.other = mixture(mix, other(mix.a), other(mix.b), other(mix.amount));
    return t;
  }
  PbrtTexture t = *picture;
  for (int i = 0; i < 2; ++i) {
    for (const PbrtTexture* part : {&mix.a, &mix.b, &mix.amount})
      t.repeats[i] = std::max(t.repeats[i], part->repeats[i]);
    if (!checks) continue;
    if (t.wrap != "repeat") refuse("a checkerboard and pictures that do not repeat");
    // After so many of the picture the fields are the same.
    const double fields = std::fabs(checks->scale[i] / t.scale[i]);
    const auto fits = [&](int n) { return std::fabs(std::remainder(n * fields, 2.0)) < 1e-6; };
    int& repeats = mix.repeats[i];
    while (repeats <= kMostRepeats && !fits(repeats)) ++repeats;
    t.repeats[i] *= repeats;
    if (t.repeats[i] > kMostRepeats || !(repeats * fields <= kMostFields))
      refuse("pictures and a checkerboard whose fields are not in step with them");
    mix.fields[i] = std::max(1, static_cast<int>(std::lround(repeats * fields)));
    t.scale[i] /= repeats;
    t.offset[i] /= repeats;
  }
  t.files = files;
  t.value = Vec3d(1.0);
  t.invert = t.nearest = t.number = false;
  t.gamma = 0.0;
  t.gain = 1.0;
  t.file.clear();
  t.mix = std::make_shared<const PbrtMix>(std::move(mix));
  return t;
}

// Also the texture coordinates of others.
PbrtTexture PbrtMaterials::picture(const PbrtObject& object) {
  PbrtTexture t;
  const std::string mapping = object.text("mapping", "uv");
  if (mapping != "uv")
    fail(object.where("mapping"),
         "the mapping \"" + mapping + "\" is not supported; give the mesh texture coordinates");
  t.scale[0] = object.number("uscale", 1.0);
  t.scale[1] = object.number("vscale", 1.0);
  t.offset[0] = object.number("udelta", 0.0);
  t.offset[1] = object.number("vdelta", 0.0);
  if (object.type() != "imagemap") return t;
  t.kind = PbrtTexture::Kind::picture;
  const std::string file = object.text("filename", "");
  t.file = absolute_path(description_.resolve(file, object.where("filename")));
  t.gain = object.number("scale", 1.0);
  t.invert = object.flag("invert", false);
  const std::string filter = object.text("filter", "bilinear"), wrap = object.text("wrap", "repeat");
  t.nearest = filter == "point";
  if (filter != "point" && filter != "bilinear")
    report_.assume(object.where("filter"), "filter " + filter + " read as bilinear: samples of a pixel blur instead");
  t.wrap = wrap == "repeat" ? "repeat" : "clamp";
  if (wrap == "black") report_.assume(object.where("wrap"), "textures that are black outside are clamped");
  const std::string encoding = object.text("encoding", object.flag("gamma", true) ? "sRGB" : "linear");
  if (encoding == "linear") {
    t.gamma = 1.0;
  } else if (encoding != "sRGB") {
    const char *begin = encoding.data() + (encoding.starts_with("gamma ") ? 6 : 0),
               *end = encoding.data() + encoding.size();
    const auto result = read_decimal(begin, end, t.gamma);
    if (!encoding.starts_with("gamma ") || result.ec != std::errc() || result.ptr != end ||
        !(t.gamma >= 0.1 && t.gamma <= 10.0))
      fail(object.where("encoding"),
           "the encoding is sRGB, linear or \"gamma X\" with X from 0.1 to 10, not \"" + encoding + "\"");
  }
  object.ignore({"maxanisotropy", "trilinear"});
  return t;
}

std::string PbrtMaterials::build_picture(const std::string& key, BuiltPicture picture) {
  const auto [at, inserted] = pictures_.try_emplace(key, "picture" + std::to_string(pictures_.size()));
  if (inserted) description_.built->pictures.emplace(at->second, std::move(picture));
  return at->second;
}

void PbrtMaterials::add_number(Element& parent, const Location& where, const std::string& name, double value) const {
  add_element(parent, where, "float", {{"name", name}, {"value", number_text(value)}});
}

void PbrtMaterials::add(Element& parent, const Location& where, const std::string& name, const PbrtTexture& t,
                        Role role, PbrtMap map) {
  using Kind = PbrtTexture::Kind;
  const bool number = role != Role::color && role != Role::radiance, color = role == Role::color;
  const auto used = [role, map](double value) {  // of a number
    return pbrt_map(map, role == Role::share ? std::clamp(value, 0.0, 1.0) : value);
  };
  const auto constant = [&](Element& e, const std::string& key, Vec3d value) {
    if (number) return add_number(e, where, key, used(channel_mean(value)));
    add_element(e, where, "rgb", {{"name", key}, {"value", three_numbers(color ? clamped(value) : value)}});
  };
  if (t.kind == Kind::constant) return constant(parent, name, t.value);
  // pbrt's v runs up, Mitsuba's down: v' = 1 - v, and so of what is scaled and moved.
  Transform to_uv;
  const bool checks = t.kind == Kind::checkerboard;
  if (checks) {  // two fields of pbrt are the period of Mitsuba's
    to_uv = Transform::translate({0.5 * t.offset[0], 0.5 * (t.scale[1] + t.offset[1]), 0.0}) *
            Transform::scale({0.5 * t.scale[0], -0.5 * t.scale[1], 1.0});
  } else {
    to_uv = Transform::translate({t.offset[0], 1.0 - t.scale[1] - t.offset[1], 0.0}) *
            Transform::scale({t.scale[0], t.scale[1], 1.0});
  }
  std::string key =
      std::to_string(static_cast<int>(role)) + " " + std::to_string(static_cast<int>(map)) + " " + text_of(t);
  const std::string picture_key = key;
  append(key, to_uv.m);
  const auto [at, inserted] = textures_.try_emplace(key, "texture" + std::to_string(textures_.size()));
  if (inserted) {
    Element& e = add_element(*description_.root, where, "texture",
                             {{"type", checks ? "checkerboard" : "bitmap"}, {"id", at->second}});
    description_.ids.emplace(at->second, &e);
    if (checks) {
      // As a number Mitsuba exchanges the two.
      constant(e, "color0", number ? t.other : t.value);
      constant(e, "color1", number ? t.value : t.other);
    } else {
      const bool plain = role != Role::share && !t.mix && !t.number && t.value == Vec3d(1.0) && t.gain == 1.0 &&
                         !t.invert && map == PbrtMap::none && (t.gamma == 0.0 || t.gamma == 1.0);
      std::string file = t.file;
      if (!plain) {
        BuiltPicture built;
        // Of colours version 3 takes the luminance, as Mitsuba does of a picture that is left as it is.
        const auto one_number = [old = old_](Vec3d v) {
          return old ? static_cast<double>(luminance(Vec3f(v))) : channel_mean(v);
        };
        built.read = [t, role, number, color, used, one_number] {
          const MemoryScope scope;
          const Image in = linear_picture(t, number);
          ask_memory(in.pixel_count() * 3 * sizeof(float), "a texture");
          Image out(in.width, in.height,
                    number ? std::vector<std::string>{"Y"} : std::vector<std::string>{"R", "G", "B"});
          for (int y = 0; y < in.height; ++y) {
            for (int x = 0; x < in.width; ++x) {
              Vec3d v(in.rgb(x, y));
              if (color) v = clamped(v);
              if (!number) {
                out.set_rgb(x, y, Vec3f(v));
                continue;
              }
              const double value = one_number(v);
              out.at(x, y, 0) = static_cast<float>(used(role == Role::number ? std::max(value, 0.0) : value));
            }
          }
          return out;
        };
        file = build_picture(picture_key, std::move(built));
      }
      add_element(e, where, "string", {{"name", "filename"}, {"value", file}});
      add_element(e, where, "string", {{"name", "filter_type"}, {"value", t.nearest ? "nearest" : "bilinear"}});
      add_element(e, where, "string", {{"name", "wrap_mode"}, {"value", t.wrap}});
      add_element(e, where, "boolean", {{"name", "raw"}, {"value", !plain || t.gamma == 1.0 ? "true" : "false"}});
    }
    if (checks || to_uv.m != Transform().m) add_matrix(e, where, "to_uv", to_uv);
  }
  add_element(parent, where, "ref", {{"id", at->second}, {"name", name}});
}

}  // namespace octrad
