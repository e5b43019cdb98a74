// Materials of glTF in the terms of Mitsuba's principled bsdf. Both have the microfacet distribution GGX with alpha the
// square of the roughness, and a diffuse base under a dielectric coat or a metal; Mitsuba's diffuse lobe and coat are
// Disney's (Burley 2012). What differs is noted.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "octrad/base/input_file.h"
#include "octrad/base/lower_case.h"
#include "octrad/base/memory_limit.h"
#include "octrad/base/number_text.h"
#include "octrad/image/io.h"
#include "octrad/image/tonemap_math.h"
#include "octrad/scene/gltf_reader.h"
#include "octrad/scene/picture_values.h"

namespace octrad {
namespace {

// Factors of a colour, which glTF keeps to [0, 1], but some files do not.
std::vector<double> color_factors(const GltfObject& owner, const std::string& key, std::vector<double> fallback) {
  return owner.numbers(key, std::move(fallback), 0.0, 1e12);
}

std::vector<double> base_factors(const GltfObject& m) {
  return color_factors(m.object("pbrMetallicRoughness"), "baseColorFactor", {1, 1, 1, 1});
}

std::vector<double> emissive_factors(const GltfObject& m) { return color_factors(m, "emissiveFactor", {0, 0, 0}); }

double emissive_strength(const GltfObject& m) {
  return m.extension("KHR_materials_emissive_strength").number("emissiveStrength", 1.0, 0.0, 1e12);
}

double highest(const std::vector<double>& values) { return *std::max_element(values.begin(), values.end()); }

bool exceeds_one(const std::vector<double>& factors) { return highest(factors) > 1.0 + 1e-4; }  // not by rounding

}  // namespace

GltfObject GltfMaterials::material(int index) const {
  return index >= 0 ? file_->item("materials", index) : file_->root().object("(default material)");
}

// Without textures whose factor is 0: they change nothing.
std::vector<GltfObject> GltfMaterials::texture_infos(const GltfObject& m) const {
  const GltfObject pbr = m.object("pbrMetallicRoughness");
  std::vector<GltfObject> all = {pbr.object("baseColorTexture"), m.object("normalTexture")};
  if (pbr.number("metallicFactor", 1.0) != 0.0 || pbr.number("roughnessFactor", 1.0) != 0.0)
    all.push_back(pbr.object("metallicRoughnessTexture"));
  if (highest(emissive_factors(m)) > 0.0) all.push_back(m.object("emissiveTexture"));
  for (const std::string name : {"transmission", "clearcoat"}) {
    const GltfObject extension = m.extension("KHR_materials_" + name);
    if (extension.number(name + "Factor", 0.0) != 0.0) all.push_back(extension.object(name + "Texture"));
  }
  std::erase_if(all, [](const GltfObject& info) { return !info.exists(); });
  return all;
}

int GltfMaterials::uv_set(int index) const {
  int set = -1;
  const GltfObject m = material(index);
  for (const GltfObject& info : texture_infos(m)) {
    const int own =
        info.extension("KHR_texture_transform").integer("texCoord", info.integer("texCoord", 0, 0, 99), 0, 99);
    if (set >= 0 && own != set) {
      report_.refuse(m.location(), "textures over two sets of texture coordinates (" + std::to_string(set) + " and " +
                                       std::to_string(own) +
                                       ") on one material are not supported; bake them to one set");
      break;
    }
    set = own;
  }
  return std::max(set, 0);
}

bool GltfMaterials::has_normal_map(int index) const { return material(index).object("normalTexture").exists(); }

bool GltfMaterials::has_textures(int index) const { return !texture_infos(material(index)).empty(); }

bool GltfMaterials::shows_colors(int index, bool uvs) const { return !uvs || !has_textures(index); }

Vec3f GltfMaterials::base_color(int index) const {
  const std::vector<double> c = base_factors(material(index));
  return Vec3f(Vec3d(std::min(c[0], 1.0), std::min(c[1], 1.0), std::min(c[2], 1.0)));
}

bool GltfMaterials::emits(int index) const { return highest(emissive_factors(material(index))) > 0.0; }

bool GltfMaterials::is_lamp(int index) const {
  const GltfObject m = material(index);
  const std::vector<double> c = emissive_factors(m);
  const double brightest = highest(c) * emissive_strength(m);
  return brightest > 0.0 && (brightest > 1.0 + 1e-4 || !m.object("emissiveTexture").exists());
}

void GltfMaterials::add_emitter(Element& shape, const GltfSurface& s) {
  const GltfObject m = material(s.material);
  const std::vector<double> c = emissive_factors(m);
  const Vec3d radiance = Vec3d(c[0], c[1], c[2]) * emissive_strength(m);
  if (exceeds_one(c)) report_.assume(m.location(), "an emissiveFactor above 1, which glTF does not allow, is kept");
  if (m.flag("doubleSided")) report_.assume(m.location(), "a light on both sides shines from its front only");
  if (m.text("alphaMode", "OPAQUE") != "OPAQUE")
    report_.assume(m.location(), "a light shines where its surface is cut out or transparent, too");
  Element& emitter = add_element(shape, m.location(), "emitter", {{"type", "area"}});
  const GltfObject info = m.object("emissiveTexture");
  Recipe recipe;
  recipe.factor = radiance;
  if (textured(info, s) && add_texture(emitter, "radiance", info, recipe)) return;
  add_element(emitter, m.location(), "rgb", {{"name", "radiance"}, {"value", three_numbers(radiance)}});
}

std::string GltfMaterials::bsdf(const GltfSurface& s) {
  const auto [at, inserted] = bsdfs_.try_emplace(s);
  if (!inserted) return at->second;
  const GltfObject m = material(s.material);
  std::string id = s.material >= 0 ? "material" + std::to_string(s.material) : "material";
  id += std::string(s.uvs ? "" : "-plain") + (s.colors ? "-colors" : "") + (s.mirrored ? "-mirrored" : "");
  at->second = id;
  std::vector<std::unique_ptr<Element>>& all = description_.root->children;
  const auto before = static_cast<std::ptrdiff_t>(all.size());
  if (report_.attempt(m.location(), [&] { add_bsdf(id, m, s); })) return id;
  // What is there of it goes; what looks like nothing else takes its place.
  all.erase(std::remove_if(all.begin() + before, all.end(), [&](const auto& e) { return e->get("id") == id; }),
            all.end());
  Element& stand_in = add_element(*description_.root, m.location(), "bsdf", {{"type", "diffuse"}, {"id", id}});
  add_element(stand_in, m.location(), "rgb", {{"name", "reflectance"}, {"value", "1, 0, 1"}});
  description_.ids[id] = &stand_in;
  return id;
}

void GltfMaterials::add_bsdf(const std::string& id, const GltfObject& m, const GltfSurface& s) {
  if (noted_.insert(s.material).second) note_extensions(m);
  const Location where = m.location();
  Element* parent = description_.root.get();
  Attributes first = {{"id", id}};
  const auto nest = [&](const std::string& type) {
    Attributes attributes = {{"type", type}};
    attributes.insert(attributes.end(), first.begin(), first.end());
    parent = &add_element(*parent, where, "bsdf", attributes);
    if (!first.empty()) description_.ids.emplace(id, parent);
    first.clear();
  };

  const GltfObject pbr = m.object("pbrMetallicRoughness"), base = pbr.object("baseColorTexture");
  const std::vector<double> factors = base_factors(m);
  if (exceeds_one(factors)) report_.assume(where, "a baseColorFactor above 1, which glTF does not allow, is read as 1");
  const std::string mode = m.text("alphaMode", "OPAQUE");
  if (mode != "OPAQUE" && mode != "MASK" && mode != "BLEND")
    m.fail("alphaMode must be OPAQUE, MASK or BLEND, not \"" + mode + "\"");
  if (mode != "OPAQUE") {
    if (s.colors) report_.assume(where, "alphaMode takes no alpha from the colours of vertices");
    const double factor = std::min(factors[3], 1.0);
    Recipe alpha;
    alpha.what = Recipe::What::alpha;
    alpha.factor = Vec3d(factor);
    const double cutoff = m.number("alphaCutoff", 0.5, 0.0);
    if (mode == "MASK") alpha.cutoff = cutoff;
    const double plain = mode == "MASK" ? (factor >= cutoff ? 1.0 : 0.0) : factor;
    if (textured(base, s) || plain < 1.0) {
      nest("mask");
      has_masks_ = true;
      if (!textured(base, s) || !add_texture(*parent, "opacity", base, alpha)) add_value(*parent, "opacity", m, plain);
    }
  }
  const bool transmits = m.extension("KHR_materials_transmission").number("transmissionFactor", 0.0, 0.0, 1.0) > 0.0;
  if (m.flag("doubleSided") && !transmits) nest("twosided");
  if (const GltfObject normal = m.object("normalTexture"); textured(normal, s)) {
    Recipe recipe;
    recipe.what = Recipe::What::normal;
    recipe.factor = Vec3d(normal.number("scale", 1.0));
    recipe.mirrored = s.mirrored;
    nest("normalmap");
    if (!add_texture(*parent, "normalmap", normal, recipe)) {
      add_element(*parent, where, "rgb", {{"name", "normalmap"}, {"value", "0.5, 0.5, 1"}});
    }
  }
  const bool thin = transmits && !(m.extension("KHR_materials_volume").number("thicknessFactor", 0.0, 0.0) > 0.0);
  nest(thin ? "principledthin" : "principled");
  add_model(*parent, m, s);
}

void GltfMaterials::add_model(Element& bsdf, const GltfObject& m, const GltfSurface& s) {
  const bool thin = bsdf.get("type") == "principledthin";
  const GltfObject pbr = m.object("pbrMetallicRoughness");
  const GltfObject base = pbr.object("baseColorTexture"), mr = pbr.object("metallicRoughnessTexture");
  const Vec3f color = base_color(s.material);
  Recipe recipe;
  recipe.factor = Vec3d(color);
  if (s.colors) {
    Element& texture = add_element(bsdf, m.location(), "texture", {{"type", "mesh_attribute"}, {"name", "base_color"}});
    add_element(texture, m.location(), "string", {{"name", "name"}, {"value", "vertex_color"}});
  } else if (!textured(base, s) || !add_texture(bsdf, "base_color", base, recipe)) {
    add_element(bsdf, m.location(), "rgb", {{"name", "base_color"}, {"value", three_numbers(Vec3d(color))}});
  }
  const double metallic = pbr.number("metallicFactor", 1.0, 0.0, 1.0);
  add_scalar(bsdf, "roughness", m, s, pbr.number("roughnessFactor", 1.0, 0.0, 1.0), mr, 1);
  if (!thin) add_scalar(bsdf, "metallic", m, s, metallic, mr, 2);
  else if (metallic > 0.0) report_.assume(m.location(), "thin glass of glTF is not metallic");
  add_ior(bsdf, m);

  const GltfObject transmission = m.extension("KHR_materials_transmission");
  const double through = transmission.number("transmissionFactor", 0.0, 0.0, 1.0);
  if (through > 0.0) add_scalar(bsdf, "spec_trans", m, s, through, transmission.object("transmissionTexture"), 0);
  const std::vector<double> attenuation =
      m.extension("KHR_materials_volume").numbers("attenuationColor", {1, 1, 1}, 0.0, 1.0);
  if (attenuation != std::vector<double>{1, 1, 1})
    report_.assume(m.location(), "KHR_materials_volume: glass absorbs nothing on the way (attenuationColor)");

  const GltfObject coat = m.extension("KHR_materials_clearcoat");
  const double clearcoat = coat.number("clearcoatFactor", 0.0, 0.0, 1.0);
  if (clearcoat > 0.0 && thin) report_.assume(m.location(), "KHR_materials_clearcoat is left out of thin glass");
  if (clearcoat > 0.0 && !thin) {
    report_.assume(m.location(), "KHR_materials_clearcoat read as the clearcoat of principled, which is weaker");
    add_scalar(bsdf, "clearcoat", m, s, clearcoat, coat.object("clearcoatTexture"), 0);
    // Disney's clearcoat has alpha from 0.1 down to 0.001 as its gloss goes up.
    const double rough = coat.number("clearcoatRoughnessFactor", 0.0, 0.0, 1.0);
    add_value(bsdf, "clearcoat_gloss", m, std::clamp((0.1 - rough * rough) / 0.099, 0.0, 1.0));
  }
  const GltfObject sheen = m.extension("KHR_materials_sheen");
  const std::vector<double> tint = sheen.numbers("sheenColorFactor", {0, 0, 0}, 0.0, 1.0);
  if (const double strength = std::max({tint[0], tint[1], tint[2]}); strength > 0.0) {
    report_.assume(m.location(), "KHR_materials_sheen read as the sheen of principled");
    add_value(bsdf, "sheen", m, strength);
    add_value(bsdf, "sheen_tint", m, tint[0] == tint[1] && tint[1] == tint[2] ? 0.0 : 1.0);
  }
}

// The reflectance seen straight on, F0 = ((eta - 1) / (eta + 1))^2, scaled by KHR_materials_specular.
void GltfMaterials::add_ior(Element& bsdf, const GltfObject& m) {
  double eta = m.extension("KHR_materials_ior").number("ior", 1.5, 0.0, 1e9);
  const bool all = eta == 0.0;  // stands for a coat that reflects everything
  if (eta < 1.0) eta = 1.5;
  const GltfObject specular = m.extension("KHR_materials_specular");
  const double factor = specular.number("specularFactor", 1.0, 0.0, 1.0);
  const std::vector<double> color = specular.numbers("specularColorFactor", {1, 1, 1}, 0.0, 1e6);
  const double scale = luminance(Vec3f(Vec3d(color[0], color[1], color[2])));
  const bool scaled = factor != 1.0 || scale != 1.0;
  constexpr double kMostEta = 100.0;  // of principled
  if (scaled || all || eta > kMostEta) {
    report_.assume(m.location(), std::string(scaled ? "KHR_materials_specular" : "KHR_materials_ior") +
                                     " read as another index of refraction");
    const double root = all ? 1.0 : (eta - 1.0) / (eta + 1.0),
                 f0 = std::min(std::min(root * root * scale, 1.0) * factor, 0.9);
    eta = (1.0 + std::sqrt(f0)) / (1.0 - std::sqrt(f0));
  }
  add_value(bsdf, "eta", m, std::max(eta, 1.001));
}

void GltfMaterials::note_extensions(const GltfObject& m) {
  static const std::set<std::string> kRead = {
      "KHR_materials_ior",      "KHR_materials_transmission",      "KHR_materials_clearcoat",
      "KHR_materials_specular", "KHR_materials_emissive_strength", "KHR_materials_volume",
      "KHR_materials_sheen"};
  for (const std::string& name : m.object("extensions").keys()) {
    if (kRead.count(name) == 0) report_.assume(m.location(), "the material's extension " + name + " is left out");
  }
  for (const auto& [extension, key] : {std::pair{"KHR_materials_specular", "specularTexture"},
                                       {"KHR_materials_specular", "specularColorTexture"},
                                       {"KHR_materials_sheen", "sheenColorTexture"},
                                       {"KHR_materials_sheen", "sheenRoughnessFactor"},
                                       {"KHR_materials_sheen", "sheenRoughnessTexture"},
                                       {"KHR_materials_clearcoat", "clearcoatRoughnessTexture"},
                                       {"KHR_materials_clearcoat", "clearcoatNormalTexture"}}) {
    if (m.extension(extension).has(key))
      report_.assume(m.location(), std::string(extension) + ": " + key + " is left out");
  }
}

void GltfMaterials::add_value(Element& parent, const std::string& name, const GltfObject& where, double value) {
  add_element(parent, where.location(), "float", {{"name", name}, {"value", number_text(value)}});
}

void GltfMaterials::add_scalar(Element& parent, const std::string& name, const GltfObject& owner, const GltfSurface& s,
                               double factor, const GltfObject& info, int channel) {
  Recipe recipe;
  recipe.what = Recipe::What::channel;
  recipe.channel = channel;
  recipe.factor = Vec3d(factor);
  if (factor > 0.0 && textured(info, s) && add_texture(parent, name, info, recipe)) return;
  add_value(parent, name, owner, factor);
}

bool GltfMaterials::add_texture(Element& parent, const std::string& name, const GltfObject& info,
                                const Recipe& recipe) {
  const int index = info.index("index", "textures");
  if (index < 0) info.fail("needs the index of a texture");
  const GltfObject texture = file_->item("textures", index);
  int source = texture.extension("EXT_texture_webp").index("source", "images");
  if (source < 0) source = texture.index("source", "images");
  if (source < 0) {
    std::string way = "has no source";
    for (const std::string& extension : texture.object("extensions").keys())
      if (extension != "EXT_texture_webp") way = extension + " is not supported; save its picture as PNG or JPEG";
    report_.refuse(texture.location(), way);
    return false;
  }
  std::string file;
  bool encoded = false;
  const GltfObject image = file_->item("images", source);
  if (!report_.attempt(image.location(), [&] { file = picture(image, recipe, encoded); })) return false;

  const int sampler_index = texture.index("sampler", "samplers");
  const GltfObject sampler = sampler_index >= 0 ? file_->item("samplers", sampler_index) : texture.object("sampler");
  enum { kNearest = 9728, kClamp = 33071, kMirror = 33648, kRepeat = 10497 };
  int wrap[2] = {kRepeat, kRepeat};
  if (sampler_index >= 0) {
    wrap[0] = sampler.integer("wrapS", kRepeat, kRepeat, kMirror);
    wrap[1] = sampler.integer("wrapT", kRepeat, kRepeat, kMirror);
    if (wrap[0] != wrap[1])
      report_.assume(sampler.location(), "textures that wrap in two ways are wrapped as wrapS says");
  }
  const bool nearest = sampler_index >= 0 && sampler.integer("magFilter", 0, 0, 9999) == kNearest;
  // As KHR_texture_transform: scaled, turned, moved; v runs down, so that a turn is the other way round.
  const GltfObject t = info.extension("KHR_texture_transform");
  const std::vector<double> offset = t.numbers("offset", {0, 0}), scale = t.numbers("scale", {1, 1});
  const double angle = t.number("rotation", 0.0), c = std::cos(angle), s = std::sin(angle);
  Transform to_uv;
  to_uv.m = {
      c * scale[0], s * scale[1], 0, offset[0], -s * scale[0], c * scale[1], 0, offset[1], 0, 0, 1, 0, 0, 0, 0, 1};
  if (recipe.what == Recipe::What::normal && (angle != 0.0 || scale[0] < 0.0 || scale[1] < 0.0))
    report_.assume(info.location(), "KHR_texture_transform moves a normal map, but does not turn or mirror its slopes");
  const std::string wrap_mode = wrap[0] == kClamp ? "clamp" : wrap[0] == kMirror ? "mirror" : "repeat";
  const bool raw = !(encoded && recipe.what == Recipe::What::color);

  std::string key = file + (nearest ? "n" : "b") + wrap_mode + (raw ? "r" : "s");
  if (t.exists()) {
    for (const double v : to_uv.m) key.append(" ").append(number_text(v));
  }
  const auto [at, inserted] = textures_.try_emplace(key, "texture" + std::to_string(textures_.size()));
  if (inserted) {
    const Location where = texture.location();
    // Before what refers to it, for readers who go from the top.
    Element& e = add_element(*description_.root, where, "texture", {{"type", "bitmap"}, {"id", at->second}});
    description_.ids.emplace(at->second, &e);
    add_element(e, image.location(), "string", {{"name", "filename"}, {"value", file}});
    add_element(e, where, "string", {{"name", "filter_type"}, {"value", nearest ? "nearest" : "bilinear"}});
    add_element(e, where, "string", {{"name", "wrap_mode"}, {"value", wrap_mode}});
    add_element(e, where, "boolean", {{"name", "raw"}, {"value", raw ? "true" : "false"}});
    if (t.exists()) add_matrix(e, where, "to_uv", to_uv);
  }
  add_element(parent, info.location(), "ref", {{"id", at->second}, {"name", name}});
  return true;
}

// The name of a file, or of a picture that is made of one. `encoded`: its values are what the file says, to be decoded.
std::string GltfMaterials::picture(const GltfObject& image, const Recipe& recipe, bool& encoded) {
  using What = Recipe::What;
  const std::string* uri = &image.long_text("uri");  // of the file that `bytes` below keeps
  const int view = image.index("bufferView", "bufferViews");
  if (uri->empty() == (view < 0)) image.fail("needs a uri or a bufferView, and not both");
  const bool outside = !uri->empty() && !GltfFile::is_data(*uri);
  const std::string file = outside ? file_->resolve(*uri, image) : "";
  const bool unit = recipe.factor.x == 1.0 && recipe.factor.y == 1.0 && recipe.factor.z == 1.0;
  encoded = unit && !recipe.mirrored && (recipe.what == What::color || recipe.what == What::normal);
  // It is looked for once more. Of WebP, which Mitsuba does not read, `convert` makes a PNG.
  if (encoded && outside && ending_of(file) != ".webp") return std::filesystem::absolute(file).string();

  std::string key = image.path();
  if (!encoded) {
    key.append(" ").append(std::to_string(static_cast<int>(recipe.what)));
    key.append(" ").append(std::to_string(recipe.channel));
    key.append(" ").append(three_numbers(recipe.factor));
    key.append(" ").append(number_text(recipe.cutoff)).append(recipe.mirrored ? " mirrored" : "");
  }
  const auto [at, inserted] = pictures_.try_emplace(key, "picture" + std::to_string(pictures_.size()));
  if (!inserted) return at->second;
  BuiltPicture& built = description_.built->pictures[at->second];
  // The file is kept as long as something reads from it.
  const auto bytes = [uri, view, outside, file, image, keep = file_] {
    return outside ? read_file(file) : uri->empty() ? std::string(keep->view(view)) : GltfFile::decode(*uri, image);
  };
  const std::string place = image.location().text();
  if (encoded) {
    built.read = [place, bytes] { return parse_image(place, bytes()); };
    built.encoded = bytes;
    return at->second;
  }
  built.read = [place, bytes, recipe] {
    const MemoryScope scope;
    const Image in = parse_image(place, bytes());
    const std::vector<int> from = color_channels(in);
    const bool colors = recipe.what == What::color || recipe.what == What::normal;
    ask_memory(in.pixel_count() * (colors ? 3 : 1) * sizeof(float), place);
    Image out(in.width, in.height, colors ? std::vector<std::string>{"R", "G", "B"} : std::vector<std::string>{"Y"});
    const std::size_t stride = in.channels.size();
    for (std::size_t i = 0; i < in.pixel_count(); ++i) {
      const float* pixel = in.data.data() + i * stride;
      const auto value = [&](int c) { return pixel[from[static_cast<std::size_t>(c)]]; };
      switch (recipe.what) {
        case What::color:
          for (int c = 0; c < 3; ++c)
            out.data[3 * i + static_cast<std::size_t>(c)] =
                static_cast<float>(linear_value(in, value(c)) * recipe.factor[c]);
          break;
        case What::channel:
          out.data[i] = static_cast<float>(static_cast<double>(value(recipe.channel)) * recipe.factor.x);
          break;
        case What::alpha: {
          const double alpha = (from[3] >= 0 ? static_cast<double>(value(3)) : 1.0) * recipe.factor.x;
          out.data[i] = recipe.cutoff < 0.0 ? static_cast<float>(alpha) : alpha >= recipe.cutoff ? 1.0f : 0.0f;
          break;
        }
        case What::normal: {
          Vec3d n;
          for (int c = 0; c < 3; ++c) n[c] = 2.0 * static_cast<double>(value(c)) - 1.0;
          n.x *= recipe.factor.x;
          n.y *= recipe.factor.y * (recipe.mirrored ? -1.0 : 1.0);
          const double l = length(n);
          for (int c = 0; c < 3; ++c)
            out.data[3 * i + static_cast<std::size_t>(c)] = static_cast<float>(l > 0.0 ? 0.5 + 0.5 * n[c] / l : 0.5);
          break;
        }
      }
    }
    return out;
  };
  return at->second;
}

}  // namespace octrad
