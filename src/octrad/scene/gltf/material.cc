// Materials of glTF in the terms of Mitsuba's principled bsdf. Both have the microfacet distribution GGX with alpha the
// square of the roughness, and a diffuse base under a dielectric coat or a metal; Mitsuba's diffuse lobe and coat are
// Disney's (Burley 2012). What differs is noted.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "octrad/base/number_text.h"
#include "octrad/image/tonemap_math.h"
#include "octrad/scene/gltf/reader.h"

namespace octrad {
namespace {

// Factors of a colour, which glTF keeps to [0, 1], but some files do not.
std::vector<double> color_factors(const GltfObject& owner, const std::string& key, std::vector<double> fallback) {
  return owner.numbers(key, std::move(fallback), 0.0, 1e12);
}

// Without any light the surface shows its base colour.
bool is_unlit(const GltfObject& m) { return m.extension("KHR_materials_unlit").exists(); }

// Absent where the surface is unlit, too.
GltfObject specular_glossiness(const GltfObject& m) {
  return is_unlit(m) ? GltfObject() : m.extension("KHR_materials_pbrSpecularGlossiness");
}

// By the extension, where a material has it: pbrMetallicRoughness is then for readers without.
std::vector<double> base_factors(const GltfObject& m) {
  const GltfObject gloss = specular_glossiness(m);
  return gloss.exists() ? color_factors(gloss, "diffuseFactor", {1, 1, 1, 1})
                        : color_factors(m.object("pbrMetallicRoughness"), "baseColorFactor", {1, 1, 1, 1});
}

GltfObject base_texture(const GltfObject& m) {
  const GltfObject gloss = specular_glossiness(m);
  return gloss.exists() ? gloss.object("diffuseTexture") : m.object("pbrMetallicRoughness").object("baseColorTexture");
}

Vec3d specular_factors(const GltfObject& gloss) {
  const std::vector<double> c = color_factors(gloss, "specularFactor", {1, 1, 1});
  return {std::min(c[0], 1.0), std::min(c[1], 1.0), std::min(c[2], 1.0)};
}

// A number from 0 to 1; others, which writers of files make, are the nearest of these (note_shares()).
double share(const GltfObject& object, const char* key, double fallback) {
  return std::clamp(object.number(key, fallback), 0.0, 1.0);
}

double glossiness_of(const GltfObject& gloss) { return share(gloss, "glossinessFactor", 1.0); }

double largest_of(Vec3d v) { return std::max({v.x, v.y, v.z}); }

std::vector<double> emissive_factors(const GltfObject& m) { return color_factors(m, "emissiveFactor", {0, 0, 0}); }

double emissive_strength(const GltfObject& m) {
  return m.extension("KHR_materials_emissive_strength").number("emissiveStrength", 1.0, 0.0, 1e12);
}

double transmission_of(const GltfObject& m) {
  return share(m.extension("KHR_materials_transmission"), "transmissionFactor", 0.0);
}

double diffuse_transmission_of(const GltfObject& m) {
  return share(m.extension("KHR_materials_diffuse_transmission"), "diffuseTransmissionFactor", 0.0);
}

bool lets_light_pass(const GltfObject& m) { return transmission_of(m) > 0.0 || diffuse_transmission_of(m) > 0.0; }

double thickness_of(const GltfObject& m) {
  return m.extension("KHR_materials_volume").number("thicknessFactor", 0.0, 0.0);
}

// What is left of light that meets a surface, of which a part passes through the thickness that the material says there
// is, by Beer's law. Thickness is in the mesh's own lengths, and the distance after which a colour is left in those of
// the scene, where these are `scale` times as long.
Vec3d left_by_absorption(const GltfObject& m, double scale) {
  const GltfObject volume = m.extension("KHR_materials_volume");
  const double thickness = thickness_of(m) * scale;
  // Without it infinite; some writers say 0 for that.
  const double distance = volume.number("attenuationDistance", 0.0, 0.0, std::numeric_limits<double>::max());
  const std::vector<double> color = volume.numbers("attenuationColor", {1, 1, 1}, 0.0, 1.0);
  if (!(transmission_of(m) > 0.0 && thickness > 0.0 && distance > 0.0)) return Vec3d(1.0);
  // Only what passes is absorbed, and metals let nothing pass.
  const GltfObject pbr = m.object("pbrMetallicRoughness");
  const double metallic = pbr.object("metallicRoughnessTexture").exists() ? 0.0 : share(pbr, "metallicFactor", 1.0);
  const double share = transmission_of(m) * (1.0 - metallic);
  Vec3d left;
  for (int i = 0; i < 3; ++i)
    left[i] = 1.0 - share + share * std::pow(color[static_cast<std::size_t>(i)], thickness / distance);
  return left;
}

constexpr double kLeastEta = 1.001;  // of principled

double highest(const std::vector<double>& values) { return *std::max_element(values.begin(), values.end()); }

bool exceeds_one(const std::vector<double>& factors) { return highest(factors) > 1.0 + 1e-4; }  // not by rounding

}  // namespace

GltfObject GltfMaterials::material(int index) const {
  return index >= 0 ? file_->item("materials", index) : file_->root().object("(default material)");
}

// Without textures whose factor is 0: they change nothing.
std::vector<GltfObject> GltfMaterials::texture_infos(const GltfObject& m) const {
  const GltfObject pbr = m.object("pbrMetallicRoughness"), gloss = specular_glossiness(m);
  std::vector<GltfObject> all = {base_texture(m)};
  if (is_unlit(m)) {
    if (!all[0].exists()) all.clear();
    return all;
  }
  all.push_back(m.object("normalTexture"));
  if (gloss.exists()) {
    if (largest_of(specular_factors(gloss)) > 0.0 || glossiness_of(gloss) > 0.0)
      all.push_back(gloss.object("specularGlossinessTexture"));
  } else if (pbr.number("metallicFactor", 1.0) != 0.0 || pbr.number("roughnessFactor", 1.0) != 0.0) {
    all.push_back(pbr.object("metallicRoughnessTexture"));
  }
  if (highest(emissive_factors(m)) > 0.0) all.push_back(m.object("emissiveTexture"));
  for (const std::string name : {"transmission", "clearcoat"}) {
    const GltfObject extension = m.extension("KHR_materials_" + name);
    if (extension.number(name + "Factor", 0.0) != 0.0) all.push_back(extension.object(name + "Texture"));
  }
  std::erase_if(all, [](const GltfObject& info) { return !info.exists(); });
  return all;
}

int GltfMaterials::uv_set(int index, const GltfObject& attributes) const {
  const auto accessor = [&](int set) { return attributes.index("TEXCOORD_" + std::to_string(set), "accessors"); };
  int set = -1;
  const GltfObject m = material(index);
  for (const GltfObject& info : texture_infos(m)) {
    const int own =
        info.extension("KHR_texture_transform").integer("texCoord", info.integer("texCoord", 0, 0, 99), 0, 99);
    if (set >= 0 && own != set && (accessor(own) < 0 || accessor(own) != accessor(set))) {
      report_.refuse(m.location(), "textures over two sets of texture coordinates (" + std::to_string(set) + " and " +
                                       std::to_string(own) +
                                       ") on one material are not supported; bake them to one set");
      break;
    }
    set = own;
  }
  return std::max(set, 0);
}

bool GltfMaterials::has_normal_map(int index) const {
  return material(index).object("normalTexture").exists() && !is_unlit(material(index));
}

bool GltfMaterials::has_textures(int index) const { return !texture_infos(material(index)).empty(); }

bool GltfMaterials::shows_colors(int index, bool uvs) const {
  const GltfObject gloss = specular_glossiness(material(index));
  if (gloss.exists() && largest_of(specular_factors(gloss)) > kGltfDielectric) return false;  // two colours make one
  return !uvs || !has_textures(index);
}

Vec3f GltfMaterials::base_color(const GltfSurface& s) const {
  const std::vector<double> c = base_factors(material(s.material));
  // Both models of glass tint by their base colour what goes in and out again, or through a thin pane.
  return Vec3f(Vec3d(std::min(c[0], 1.0), std::min(c[1], 1.0), std::min(c[2], 1.0)) *
               left_by_absorption(material(s.material), static_cast<double>(s.scale))) *
         Vec3f(s.tint[0], s.tint[1], s.tint[2]);
}

bool GltfMaterials::absorbs(int index) const { return left_by_absorption(material(index), 1.0) != Vec3d(1.0); }

bool GltfMaterials::emits(int index) const {
  const GltfObject m = material(index);
  const std::vector<double> c = is_unlit(m) ? base_factors(m) : emissive_factors(m);
  return std::max({c[0], c[1], c[2]}) > 0.0;
}

bool GltfMaterials::is_lamp(int index) const {
  const GltfObject m = material(index);
  if (is_unlit(m)) return false;
  const std::vector<double> c = emissive_factors(m);
  const double brightest = highest(c) * emissive_strength(m);
  constexpr double kDim = 0.5;  // a signal lamp of a device
  return m.object("emissiveTexture").exists() ? brightest > 1.0 + 1e-4 : brightest >= kDim;
}

// Each side in a mesh of its own would take the alpha of a half-transparent surface twice; and models with a glowing
// part have no inside that is seen.
bool GltfMaterials::emits_from_both_sides(int index) const {
  const GltfObject m = material(index);
  return m.flag("doubleSided") && m.text("alphaMode", "OPAQUE") != "BLEND" && emits(index) &&
         (is_unlit(m) || (is_lamp(index) && !lets_light_pass(m)));
}

GltfMaterials::Coverage GltfMaterials::coverage(const GltfObject& m, const GltfSurface& s) const {
  Coverage coverage;
  const std::string mode = m.text("alphaMode", "OPAQUE");
  if (mode != "OPAQUE" && mode != "MASK" && mode != "BLEND")
    m.fail("alphaMode must be OPAQUE, MASK or BLEND, not \"" + mode + "\"");
  if (mode == "OPAQUE") return coverage;
  if (s.colors) report_.assume(m.location(), "alphaMode takes no alpha from the colours of vertices");
  coverage.factor = std::min(base_factors(m)[3], 1.0) * static_cast<double>(s.tint[3]);
  coverage.plain = coverage.factor;
  if (mode == "BLEND") return coverage;
  coverage.cutoff = m.number("alphaCutoff", 0.5, 0.0);
  coverage.plain = coverage.factor >= coverage.cutoff ? 1.0 : 0.0;
  return coverage;
}

void GltfMaterials::add_emitter(Element& shape, const GltfSurface& s) {
  const GltfObject m = material(s.material);
  if (m.flag("doubleSided") && !emits_from_both_sides(s.material))
    report_.assume(m.location(), "a light on both sides shines from its front only");
  Element& emitter = add_element(shape, m.location(), "emitter", {{"type", "area"}});
  if (is_unlit(m)) return add_unlit(emitter, m, s);
  const std::vector<double> c = emissive_factors(m);
  const Vec3d radiance = Vec3d(c[0], c[1], c[2]) * emissive_strength(m);
  if (exceeds_one(c)) report_.assume(m.location(), "an emissiveFactor above 1, which glTF does not allow, is kept");
  if (m.text("alphaMode", "OPAQUE") != "OPAQUE")
    report_.assume(m.location(), "a light shines where its surface is cut out or transparent, too");
  const GltfObject info = m.object("emissiveTexture");
  Recipe recipe;
  recipe.factor = radiance;
  if (textured(info, s) && add_texture(emitter, "radiance", info, recipe)) return;
  add_element(emitter, m.location(), "rgb", {{"name", "radiance"}, {"value", three_numbers(radiance)}});
}

// Emission is seen where a surface is cut out, too, so that it must be none there.
void GltfMaterials::add_unlit(Element& emitter, const GltfObject& m, const GltfSurface& s) {
  report_.assume(
      m.location(),
      "KHR_materials_unlit: the surface emits its base colour and reflects nothing, so that it lights others");
  const Coverage covered = coverage(m, s);
  const GltfObject info = base_texture(m);
  Recipe recipe;
  recipe.factor = Vec3d(base_color(s));
  if (m.text("alphaMode", "OPAQUE") != "OPAQUE") {
    recipe.alpha = covered.factor;
    recipe.cutoff = covered.cutoff;
  }
  if (s.colors) return add_attribute(emitter, "radiance", m, covered.plain);
  if (textured(info, s) && add_texture(emitter, "radiance", info, recipe)) return;
  add_element(emitter, m.location(), "rgb",
              {{"name", "radiance"}, {"value", three_numbers(recipe.factor * covered.plain)}});
}

std::string GltfMaterials::bsdf(const GltfSurface& s) {
  const auto [at, inserted] = bsdfs_.try_emplace(s);
  if (!inserted) return at->second;
  const GltfObject m = material(s.material);
  std::string id = s.material >= 0 ? "material" + std::to_string(s.material) : "material";
  id += std::string(s.uvs ? "" : "-plain") + (s.colors ? "-colors" : "") + (s.mirrored ? "-mirrored" : "");
  if (s.tint != GltfSurface().tint || s.scale != 1.0f) id += "-" + std::to_string(bsdfs_.size());
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
  if (noted_.insert(s.material).second) {
    note_shares(m);
    note_extensions(m);
  }
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

  const GltfObject base = base_texture(m);
  const std::vector<double> factors = base_factors(m);
  if (exceeds_one(factors)) report_.assume(where, "a baseColorFactor above 1, which glTF does not allow, is read as 1");
  const Coverage covered = coverage(m, s);
  const bool cut = m.text("alphaMode", "OPAQUE") != "OPAQUE" && textured(base, s);
  if (cut || covered.plain < 1.0) {
    Recipe alpha;
    alpha.what = Recipe::What::alpha;
    alpha.factor = Vec3d(covered.factor);
    alpha.cutoff = covered.cutoff;
    nest("mask");
    has_masks_ = true;
    if (!cut || !add_texture(*parent, "opacity", base, alpha)) add_value(*parent, "opacity", m, covered.plain);
  }
  if (is_unlit(m)) {
    nest("diffuse");
    add_element(*parent, where, "rgb", {{"name", "reflectance"}, {"value", "0"}});
    return;
  }
  const bool transmits = lets_light_pass(m);
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
  // Within the map: the whole mapped normal is turned over on the back.
  if (m.flag("doubleSided") && !transmits) nest("twosided");
  const bool thick = transmission_of(m) > 0.0 && thickness_of(m) > 0.0;
  nest(transmits && !thick ? "principledthin" : "principled");
  add_model(*parent, m, s);
}

void GltfMaterials::add_base_color(Element& bsdf, const GltfObject& m, const GltfSurface& s) {
  const GltfObject base = base_texture(m);
  Recipe recipe;
  recipe.factor = Vec3d(base_color(s));
  if (s.colors) {
    add_attribute(bsdf, "base_color", m, 1.0);
  } else if (!textured(base, s) || !add_texture(bsdf, "base_color", base, recipe)) {
    add_element(bsdf, m.location(), "rgb", {{"name", "base_color"}, {"value", three_numbers(recipe.factor)}});
  }
}

void GltfMaterials::add_metallic_roughness(Element& bsdf, const GltfObject& m, const GltfSurface& s) {
  const GltfObject pbr = m.object("pbrMetallicRoughness"), mr = pbr.object("metallicRoughnessTexture");
  const double metallic = share(pbr, "metallicFactor", 1.0);
  add_base_color(bsdf, m, s);
  if (!add_anisotropy(bsdf, m, textured(mr, s)))
    add_scalar(bsdf, "roughness", m, s, share(pbr, "roughnessFactor", 1.0), mr, 1);
  if (bsdf.get("type") != "principledthin") add_scalar(bsdf, "metallic", m, s, metallic, mr, 2);
  else if (metallic > 0.0) report_.assume(m.location(), "a thin surface that light passes is not metallic");
  add_ior(bsdf, m);
}

// KHR_materials_anisotropy: alpha is that of the roughness across the tangent, and nearer to 1 along it. Of constants
// alone, and along u; false where there is none. principled divides and multiplies alpha by sqrt(1 - .9 anisotropic).
bool GltfMaterials::add_anisotropy(Element& bsdf, const GltfObject& m, bool rough_picture) {
  const GltfObject extension = m.extension("KHR_materials_anisotropy");
  const double strength = share(extension, "anisotropyStrength", 0.0);
  if (!(strength > 0.0)) return false;
  const double turn = std::remainder(extension.number("anisotropyRotation", 0.0), std::numbers::pi);
  const bool thin = bsdf.get("type") == "principledthin";
  if (rough_picture || thin || std::fabs(turn) > 1e-3 || extension.object("anisotropyTexture").exists()) {
    report_.assume(m.location(), "KHR_materials_anisotropy with a texture, a rotation or transmission is left out");
    return false;
  }
  const double rough = share(m.object("pbrMetallicRoughness"), "roughnessFactor", 1.0);
  const double across = std::max(rough * rough, 1e-4), along = across + (1.0 - across) * strength * strength;
  add_value(bsdf, "roughness", m, std::pow(along * across, 0.25));
  add_value(bsdf, "anisotropic", m, std::min((1.0 - across / along) / 0.9, 1.0));
  return true;
}

void GltfMaterials::add_specular_glossiness(Element& bsdf, const GltfObject& m, const GltfSurface& s) {
  const Location where = m.location();
  const bool thin = bsdf.get("type") == "principledthin";
  if (m.extension("KHR_materials_anisotropy").exists())
    report_.assume(where, "KHR_materials_anisotropy is left out beside KHR_materials_pbrSpecularGlossiness");
  const GltfObject gloss = specular_glossiness(m);
  const GltfObject diffuse_texture = base_texture(m), specular_texture = gloss.object("specularGlossinessTexture");
  GltfSpecularPictures surface;
  surface.diffuse = Vec3d(base_color(s));
  surface.specular = specular_factors(gloss);
  bool diffuse_varies = textured(diffuse_texture, s) && largest_of(surface.diffuse) > 0.0;
  bool specular_varies = textured(specular_texture, s) && largest_of(surface.specular) > 0.0;
  report_.assume(
      where,
      "KHR_materials_pbrSpecularGlossiness read as metallic-roughness: metallic as far as its specular colour "
      "is brighter than what a dielectric reflects, 0.04");
  if (diffuse_varies && specular_varies && !placing(diffuse_texture).lies_like(placing(specular_texture))) {
    report_.assume(where, "specular colours that lie on the surface otherwise than diffuse ones are read as 0.04");
    specular_varies = false;
    surface.specular = Vec3d(kGltfDielectric);
  }

  const double glossiness = glossiness_of(gloss);
  Recipe rough;
  rough.what = Recipe::What::glossiness;
  rough.factor = Vec3d(glossiness);
  if (!(glossiness > 0.0) || !textured(specular_texture, s) || !add_texture(bsdf, "roughness", specular_texture, rough))
    add_value(bsdf, "roughness", m, 1.0 - glossiness);

  const double f0 = largest_of(surface.specular);
  if (!specular_varies && f0 <= kGltfDielectric) {  // what is reflected is colourless, nearly or at all
    add_base_color(bsdf, m, s);
    if (!thin) add_value(bsdf, "metallic", m, 0.0);
    add_value(bsdf, "eta", m, std::max((1.0 + std::sqrt(f0)) / (1.0 - std::sqrt(f0)), kLeastEta));
    return;
  }
  add_value(bsdf, "eta", m, 1.5);
  const GltfMetal constant = metal_of_specular(surface.diffuse, surface.specular);
  const auto add_picture = [&](const char* name, bool metallic) {
    const GltfObject& info = diffuse_varies ? diffuse_texture : specular_texture;
    const int diffuse = diffuse_varies ? image_of(diffuse_texture) : -1,
              specular = specular_varies ? image_of(specular_texture) : -1;
    if ((diffuse < 0) == diffuse_varies || (specular < 0) == specular_varies) return false;
    const Placing place = placing(info);
    surface.repeats = place.wrap == "repeat";
    std::string file;
    const bool done = report_.attempt(where, [&] { file = metal_picture(diffuse, specular, surface, metallic); });
    if (done) add_bitmap(bsdf, name, info, place, file, true);
    return done;
  };
  const bool varies = diffuse_varies || specular_varies;
  if (!varies || !add_picture("base_color", false))
    add_element(bsdf, where, "rgb", {{"name", "base_color"}, {"value", three_numbers(constant.base)}});
  if (!thin && (!varies || !add_picture("metallic", true))) add_value(bsdf, "metallic", m, constant.metallic);
}

void GltfMaterials::add_model(Element& bsdf, const GltfObject& m, const GltfSurface& s) {
  const bool thin = bsdf.get("type") == "principledthin";
  if (specular_glossiness(m).exists()) add_specular_glossiness(bsdf, m, s);
  else add_metallic_roughness(bsdf, m, s);

  const GltfObject transmission = m.extension("KHR_materials_transmission");
  const double through = transmission_of(m);
  if (through > 0.0) add_scalar(bsdf, "spec_trans", m, s, through, transmission.object("transmissionTexture"), 0);
  const double diffuse = diffuse_transmission_of(m);
  if (diffuse > 0.0 && !thin)
    report_.assume(m.location(), "KHR_materials_diffuse_transmission is left out of glass with a thickness");
  if (diffuse > 0.0 && thin) {
    // Of principledthin 2 is all.
    report_.assume(m.location(),
                   "KHR_materials_diffuse_transmission read as that of principledthin, in the base colour, without its "
                   "textures");
    add_value(bsdf, "diff_trans", m, 2.0 * diffuse);
  }
  if (absorbs(s.material)) {
    report_.assume(
        m.location(),
        "KHR_materials_volume: what glass absorbs over its thicknessFactor is a factor of its colour, and not "
        "absorbed along the way of light");
  }

  const GltfObject coat = m.extension("KHR_materials_clearcoat");
  const double clearcoat = share(coat, "clearcoatFactor", 0.0);
  if (clearcoat > 0.0 && thin) report_.assume(m.location(), "KHR_materials_clearcoat is left out of thin glass");
  if (clearcoat > 0.0 && !thin) {
    report_.assume(m.location(), "KHR_materials_clearcoat read as the clearcoat of principled, which is weaker");
    add_scalar(bsdf, "clearcoat", m, s, clearcoat, coat.object("clearcoatTexture"), 0);
    // Disney's clearcoat has alpha from 0.1 down to 0.001 as its gloss goes up.
    const double rough = share(coat, "clearcoatRoughnessFactor", 0.0);
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
  const double factor = share(specular, "specularFactor", 1.0);
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
  add_value(bsdf, "eta", m, std::max(eta, kLeastEta));
}

// Numbers that share() reads as others.
void GltfMaterials::note_shares(const GltfObject& m) {
  const GltfObject pbr = m.object("pbrMetallicRoughness"), gloss = specular_glossiness(m),
                   coat = m.extension("KHR_materials_clearcoat"),
                   transmission = m.extension("KHR_materials_transmission"),
                   specular = m.extension("KHR_materials_specular"),
                   anisotropy = m.extension("KHR_materials_anisotropy"),
                   diffuse = m.extension("KHR_materials_diffuse_transmission");
  const std::pair<const GltfObject&, const char*> numbers[] = {
      {pbr, "metallicFactor"},      {pbr, "roughnessFactor"},           {gloss, "glossinessFactor"},
      {coat, "clearcoatFactor"},    {coat, "clearcoatRoughnessFactor"}, {transmission, "transmissionFactor"},
      {specular, "specularFactor"}, {anisotropy, "anisotropyStrength"}, {diffuse, "diffuseTransmissionFactor"}};
  for (const auto& [object, key] : numbers) {
    const double given = object.number(key, 0.0);
    if (given < 0.0 || given > 1.0)
      report_.assume(m.location(), std::string("a ") + key + " of " + number_text(given) + " is read as " +
                                       (given < 0.0 ? "0" : "1") + ": glTF has it from 0 to 1");
  }
}

void GltfMaterials::note_extensions(const GltfObject& m) {
  static const std::set<std::string> kRead = {
      "KHR_materials_ior",        "KHR_materials_transmission",          "KHR_materials_clearcoat",
      "KHR_materials_specular",   "KHR_materials_emissive_strength",     "KHR_materials_volume",
      "KHR_materials_sheen",      "KHR_materials_pbrSpecularGlossiness", "KHR_materials_unlit",
      "KHR_materials_anisotropy", "KHR_materials_diffuse_transmission"};
  for (const std::string& name : m.object("extensions").keys()) {
    if (kRead.count(name) == 0) report_.assume(m.location(), "the material's extension " + name + " is left out");
  }
  for (const auto& [extension, key] : {std::pair{"KHR_materials_specular", "specularTexture"},
                                       {"KHR_materials_specular", "specularColorTexture"},
                                       {"KHR_materials_sheen", "sheenColorTexture"},
                                       {"KHR_materials_sheen", "sheenRoughnessFactor"},
                                       {"KHR_materials_sheen", "sheenRoughnessTexture"},
                                       {"KHR_materials_volume", "thicknessTexture"},
                                       {"KHR_materials_clearcoat", "clearcoatRoughnessTexture"},
                                       {"KHR_materials_clearcoat", "clearcoatNormalTexture"}}) {
    if (m.extension(extension).has(key))
      report_.assume(m.location(), std::string(extension) + ": " + key + " is left out");
  }
}

void GltfMaterials::add_attribute(Element& parent, const std::string& name, const GltfObject& where, double scale) {
  Element& texture = add_element(parent, where.location(), "texture", {{"type", "mesh_attribute"}, {"name", name}});
  add_element(texture, where.location(), "string", {{"name", "name"}, {"value", "vertex_color"}});
  if (scale != 1.0) add_value(texture, "scale", where, scale);
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

}  // namespace octrad
