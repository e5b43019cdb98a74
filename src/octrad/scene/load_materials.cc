#include <algorithm>
#include <cmath>
#include <exception>
#include <filesystem>
#include <utility>

#include "octrad/base/error.h"
#include "octrad/base/join.h"
#include "octrad/scene/builder.h"
#include "octrad/scene/named_materials.h"
#include "octrad/scene/plugins.h"

namespace octrad {
namespace {

#define OCTRAD_NAME(name, Model, transmits) #name,
const std::vector<std::string> kModels = {OCTRAD_BSDF_LIST(OCTRAD_NAME)};
#undef OCTRAD_NAME
const std::vector<std::string> kWrappers = {"twosided", "mask", "bumpmap", "normalmap"};

// What can be written instead of models that there are not.
std::string bsdf_advice(const std::string& type) {
  static const std::pair<const char*, const char*> ways[] = {
      {"hk", "a thin scattering layer has no counterpart; use diffuse or principledthin"},
      {"irawan", "woven cloth has no counterpart; use diffuse with a bitmap"},
      {"measured_polarized", "light is not polarised here; use measured, with an _rgb.bsdf file of the material"},
      {"pplastic", "light is not polarised here; use roughplastic"},
      {"polarizer", "light is not polarised here"},
      {"retarder", "light is not polarised here"},
      {"circular", "light is not polarised here"},
      {"itu-radio-material", "a material of radio waves; give a diffuse bsdf, or --permissive"},
      {"radio-material", "a material of radio waves; give a diffuse bsdf, or --permissive"},
  };
  for (const auto& [name, way] : ways) {
    if (type == name) return std::string("; ") + way;
  }
  static const char* const old[] = {"phong", "ward", "coating", "roughcoating", "mixturebsdf", "difftrans"};
  for (const char* name : old) {
    if (type == name)
      return "; it is one of Mitsuba 0.6, and read in files that say so: <scene version=\"0.6.0\">; or use principled";
  }
  return "";
}

// The bsdfs nested in a wrapper, at least one.
std::vector<const Element*> nested_bsdfs(Params& params, std::size_t at_most) {
  const std::vector<const Element*> found = params.nested("bsdf");
  if (found.empty()) fail(params.location(), params.what() + " needs a nested <bsdf>");
  if (found.size() > at_most) {
    fail(found[at_most]->location, params.what() + " holds " + std::to_string(found.size()) + " bsdfs; at most " +
                                       std::to_string(at_most) + " can be given");
  }
  return found;
}

// What a bsdf that cannot be used looks like.
constexpr Vec3f kMagenta{1.0f, 0.0f, 1.0f};

// The other side as a material that is this one's alone: others may refer to the same one.
Material& own_back(Scene& scene, Material& m) {
  Material back = scene.materials[static_cast<std::size_t>(m.back)];
  m.back = static_cast<int>(scene.materials.size());
  return scene.materials.emplace_back(std::move(back));
}

}  // namespace

std::vector<std::string> bsdf_types() {
  std::vector<std::string> types = kModels;
  types.insert(types.end(), kWrappers.begin(), kWrappers.end());
  return types;
}

bool SceneBuilder::transmits(const Material& m) const {
  if (m.opacity >= 0 || octrad::transmits(m.type) || m.extra[ExtraParameter::spec_trans] >= 0) return true;
  return std::any_of(std::begin(m.blended), std::end(m.blended), [this](int part) {
    return part >= 0 && transmits(scene_.materials[static_cast<std::size_t>(part)]);
  });
}

int SceneBuilder::material(const Element& element) {
  // What shows attributes is made anew for every mesh.
  const bool shared = (texture_kinds(element) & kUsesAttributes) == 0;
  const std::pair<const Element*, int> key{&element, shared ? -1 : static_cast<int>(scene_.meshes.size())};
  if (const auto found = materials_.find(key); found != materials_.end()) return found->second;
  Material m = flatten(element);
  m.id = element.get("id");
  const int index = static_cast<int>(scene_.materials.size());
  scene_.materials.push_back(std::move(m));
  materials_.emplace(key, index);
  return index;
}

Material SceneBuilder::flatten(const Element& element) {
  Material m;
  const std::size_t open = open_materials_.size();
  if (report().attempt(element.location, [&] { m = read_bsdf(element); })) return m;
  open_materials_.resize(open);
  m = {};
  m.reflectance = constant_texture(kMagenta);
  if (description_.understood) description_.understood->stand_ins.emplace(&element, kMagenta);
  return m;
}

Material SceneBuilder::read_bsdf(const Element& element) {
  if (std::find(open_materials_.begin(), open_materials_.end(), &element) != open_materials_.end()) {
    fail(element.location, "the bsdf \"" + element.get("id") + "\" contains itself through its references");
  }
  if (open_materials_.size() >= 64) fail(element.location, "bsdfs are nested more than 64 deep");
  open_materials_.push_back(&element);
  Params params(description_, element, scene_.warnings);
  Material m;
  if (params.type() == "twosided") {
    const auto parts = nested_bsdfs(params, 2);
    if (params.get_bool("allow_transmission", false))
      report().assume(params.where("allow_transmission"), "allow_transmission of twosided is not used");
    m = flatten(*parts[0]);
    if (transmits(m))
      fail(
          parts[0]->location,
          "twosided cannot hold a bsdf that lets light through (such as dielectric, hair, mask); put the mask around twosided");
    m.two_sided = true;
    m.back = -1;  // one that is two-sided itself shows its front alone
    m.bump_mirrored = m.bump >= 0;
    if (parts.size() == 2) {
      m.back = material(*parts[1]);
      if (transmits(scene_.materials[static_cast<std::size_t>(m.back)])) {
        fail(parts[1]->location,
             "twosided cannot hold a bsdf that lets light through (such as dielectric, hair, mask)");
      }
      // As of one bsdf on both sides.
      if (scene_.materials[static_cast<std::size_t>(m.back)].bump >= 0) own_back(scene_, m).bump_mirrored = true;
    }
  } else if (params.type() == "mask") {
    const int opacity = texture_or(params, "opacity", TextureRole::opacity, 0.5f);
    const auto parts = nested_bsdfs(params, 1);
    m = flatten(*parts[0]);
    if (m.opacity >= 0) {
      // What a mask in a mask keeps is the product.
      const int product = product_texture(opacity, m.opacity);
      if (product < 0)
        fail(element.location,
             "a mask inside a mask, both of textures, is not supported; multiply the two pictures into one, and give "
             "that to a single mask");
      m.opacity = product;
    } else {
      // An opaque mask is none: upgrade.cc makes such.
      const Texture& t = scene_.textures[static_cast<std::size_t>(opacity)];
      m.opacity = t.kind == Texture::Kind::constant && t.color0.x >= 1.0f ? -1 : opacity;
    }
    if (m.back >= 0) own_back(scene_, m).opacity = m.opacity;
  } else if (params.type() == "bumpmap") {
    const auto parts = nested_bsdfs(params, 1);
    Material map;
    map.bump_scale = params.get_float("scale", 1.0f);
    map.bump_flips = params.get_bool("flip_invalid_normals", true);
    map.bump_shadows = params.get_bool("use_shadowing_function", true);
    const auto textures = params.nested("texture");
    if (textures.size() != 1)
      fail(element.location, "bumpmap needs exactly one <texture>, not " + std::to_string(textures.size()));
    m = flatten(*parts[0]);
    map.bump = texture_object(*textures[0], TextureRole::height);
    if (scene_.textures[static_cast<std::size_t>(map.bump)].kind != Texture::Kind::bitmap) {
      fail(textures[0]->location, "a bumpmap needs a texture with a gradient: bitmap (a checkerboard has none)");
    }
    map_normals(m, map, element.location);
  } else if (params.type() == "normalmap") {
    const auto parts = nested_bsdfs(params, 1);
    Material map;
    map.normal_map = true;
    map.bump_flips = params.get_bool("flip_invalid_normals", true);
    map.bump_shadows = params.get_bool("use_shadowing_function", true);
    map.bump = texture(params, "normalmap", TextureRole::normal);
    if (map.bump < 0)
      fail(element.location, std::string("normalmap needs a <texture name=\"normalmap\">") +
                                 (params.given("filename") ? "; the filename belongs into a bitmap there" : ""));
    m = flatten(*parts[0]);
    map_normals(m, map, element.location);
  } else {
    m = scattering_model(params);
  }
  params.finish();
  open_materials_.pop_back();
  return m;
}

// Puts a bump or normal map around `m`.
void SceneBuilder::map_normals(Material& m, const Material& map, const Location& where) {
  const auto apply = [&](Material& to) {
    if (to.bump >= 0) fail(where, "a bumpmap or normalmap inside another is not supported");
    to.bump = map.bump;
    to.bump_scale = map.bump_scale;
    to.normal_map = map.normal_map;
    to.bump_flips = map.bump_flips;
    to.bump_shadows = map.bump_shadows;
  };
  apply(m);
  if (m.back < 0) return;
  // Other materials may refer to the same back: apply the map to a copy.
  Material back = scene_.materials[static_cast<std::size_t>(m.back)];
  apply(back);
  m.back = static_cast<int>(scene_.materials.size());
  scene_.materials.push_back(std::move(back));
}

Material SceneBuilder::scattering_model(Params& params) {
  const std::string& type = params.type();
  const auto found = std::find(kModels.begin(), kModels.end(), type);
  if (found == kModels.end()) {
    params.fail_type(bsdf_types(), bsdf_advice(type));
  }
  Material m;
  m.type = static_cast<BsdfType>(found - kModels.begin());
  switch (m.type) {
#define OCTRAD_CASE(name, Model, transmits) \
  case BsdfType::name: read_##name(params, m); break;
    OCTRAD_BSDF_LIST(OCTRAD_CASE)
#undef OCTRAD_CASE
  }
  return m;
}

void SceneBuilder::read_diffuse(Params& params, Material& m) {
  m.reflectance = texture_or(params, "reflectance", TextureRole::reflectance, 0.5f);
}

void SceneBuilder::read_roughdiffuse(Params& params, Material& m) {
  read_diffuse(params, m);
  const int alpha = texture(params, "alpha", TextureRole::roughness);
  m.alpha_u = m.alpha_v = alpha >= 0 ? alpha : constant_texture(Vec3f(0.2f));
  params.ignore({"use_fast_approx"});  // the model itself is used
}

void SceneBuilder::read_plastic(Params& params, Material& m) {
  m.reflectance = texture_or(params, "diffuse_reflectance", TextureRole::reflectance, 0.5f);
  m.nonlinear = params.get_bool("nonlinear", false);
  m.specular_reflectance = texture(params, "specular_reflectance", TextureRole::reflectance);
  m.int_ior = index_of_refraction(params, "int_ior", "polypropylene");
  m.ext_ior = index_of_refraction(params, "ext_ior", "air");
  if (m.int_ior <= m.ext_ior) fail(params.where("int_ior"), params.what() + " needs int_ior greater than ext_ior");
}

void SceneBuilder::read_roughplastic(Params& params, Material& m) {
  read_plastic(params, m);
  microfacets(params, m);
  const auto& children = params.element().children;
  const auto varies = std::find_if(children.begin(), children.end(), [](const std::unique_ptr<Element>& child) {
    return child->get("name") == "alpha" && (child->tag == "texture" || child->tag == "ref");
  });
  if (varies != children.end())
    fail((*varies)->location, "roughplastic has one alpha all over, as in Mitsuba 3: give a number, not a texture");
  float alpha = params.float_in("alpha", 0.1f, 0.0f, 10.0f);
  if (params.given("alpha_u") && params.given("alpha_v") && !params.given("alpha")) {
    alpha = params.float_in("alpha_u", 0.1f, 0.0f, 10.0f);
    if (params.float_in("alpha_v", 0.1f, 0.0f, 10.0f) != alpha)
      fail(params.where("alpha_v"), "roughplastic is isotropic: alpha_u and alpha_v must be the same");
  }
  m.alpha_u = m.alpha_v = constant_texture(Vec3f(alpha));
}

void SceneBuilder::read_conductor(Params& params, Material& m) {
  m.specular_reflectance = texture(params, "specular_reflectance", TextureRole::reflectance);
  conductor_index(params, m);
}

void SceneBuilder::read_roughconductor(Params& params, Material& m) {
  read_conductor(params, m);
  anisotropic_microfacets(params, m);
}

void SceneBuilder::read_dielectric(Params& params, Material& m) {
  m.specular_reflectance = texture(params, "specular_reflectance", TextureRole::reflectance);
  m.specular_transmittance = texture(params, "specular_transmittance", TextureRole::reflectance);
  m.int_ior = index_of_refraction(params, "int_ior", "bk7");
  m.ext_ior = index_of_refraction(params, "ext_ior", "air");
}

void SceneBuilder::read_thindielectric(Params& params, Material& m) { read_dielectric(params, m); }

void SceneBuilder::read_roughdielectric(Params& params, Material& m) {
  read_dielectric(params, m);
  if (m.int_ior == m.ext_ior) {
    fail(
        params.where("int_ior"),
        "roughdielectric needs an int_ior that differs from ext_ior; a boundary without a change of the index is bsdf \"null\"");
  }
  anisotropic_microfacets(params, m);
}

void SceneBuilder::read_null(Params&, Material&) {}

void SceneBuilder::read_blendbsdf(Params& params, Material& m) {
  m.extra[ExtraParameter::weight] = texture(params, "weight", TextureRole::fraction);
  if (m.extra[ExtraParameter::weight] < 0)
    fail(params.location(), "blendbsdf needs a weight: how much of the second bsdf, from 0 to 1");
  const auto parts = nested_bsdfs(params, 2);
  if (parts.size() != 2) fail(params.location(), "blendbsdf needs two nested bsdfs");
  for (int i = 0; i < 2; ++i) {
    m.blended[i] = material(*parts[static_cast<std::size_t>(i)]);
    const int back = scene_.materials[static_cast<std::size_t>(m.blended[i])].back;
    for (const int side : {m.blended[i], back}) {
      if (side < 0) continue;
      const Material& part = scene_.materials[static_cast<std::size_t>(side)];
      if (part.bump >= 0 && (!part.normal_map || part.blended[0] >= 0)) {
        fail(parts[static_cast<std::size_t>(i)]->location,
             std::string("a ") + (part.normal_map ? "normalmap around a blendbsdf" : "bumpmap") +
                 " inside a blendbsdf is not supported; put it around the outer one");
      }
    }
  }
  // Two-sided parts make a two-sided blend; with backs of their own, or beside one-sided ones, they turn by themselves.
  m.two_sided = std::all_of(std::begin(m.blended), std::end(m.blended), [this](int i) {
    const Material& part = scene_.materials[static_cast<std::size_t>(i)];
    return part.two_sided && part.back < 0 && part.bump < 0;
  });
  const int count = std::max(blended_count(m, false), blended_count(m, true));
  if (count > kMostBlended) {
    fail(params.location(), "a blendbsdf mixes at most " + std::to_string(kMostBlended) +
                                " bsdfs, those of the blends in it included; this one " + std::to_string(count));
  }
}

int SceneBuilder::blended_count(const Material& m, bool behind) const {
  if (m.blended[0] < 0) return 1;
  int count = 0;
  for (const int i : m.blended) {  // as BlendParts takes them: a part turns once
    const Material* part = &scene_.materials[static_cast<std::size_t>(i)];
    const bool turns = behind && part->two_sided;
    if (turns && part->back >= 0) part = &scene_.materials[static_cast<std::size_t>(part->back)];
    count += blended_count(*part, behind && !turns);
  }
  return count;
}

void SceneBuilder::read_extra(Params& params, Material& m, int parameter, const std::string& name, TextureRole role,
                              float fallback) {
  m.extra[parameter] = fallback == 0.0f ? texture(params, name, role) : texture_or(params, name, role, fallback);
}

// What both principled models have.
void SceneBuilder::read_principled_base(Params& params, Material& m) {
  using P = ExtraParameter;
  m.reflectance = texture_or(params, "base_color", TextureRole::reflectance, 0.5f);
  read_extra(params, m, P::roughness, "roughness", TextureRole::roughness, 0.5f);
  for (const auto& [parameter, name] :
       {std::pair(P::anisotropic, "anisotropic"), std::pair(P::spec_trans, "spec_trans"),
        std::pair(P::spec_tint, "spec_tint"), std::pair(P::sheen, "sheen"), std::pair(P::sheen_tint, "sheen_tint"),
        std::pair(P::flatness, "flatness")}) {
    read_extra(params, m, parameter, name, TextureRole::fraction, 0.0f);
  }
  const auto rate = [&](int parameter, const char* name) {
    m.extra[parameter] = constant_texture(Vec3f(params.float_in(name, 1.0f, 0.0f, 1e6f)));
  };
  rate(P::diffuse_reflectance_sampling_rate, "diffuse_reflectance_sampling_rate");
  if (m.type == BsdfType::principled) {
    rate(P::main_specular_sampling_rate, "main_specular_sampling_rate");
    rate(P::clearcoat_sampling_rate, "clearcoat_sampling_rate");
  } else {
    rate(P::specular_reflectance_sampling_rate, "specular_reflectance_sampling_rate");
    rate(P::specular_transmittance_sampling_rate, "specular_transmittance_sampling_rate");
    rate(P::diffuse_transmittance_sampling_rate, "diffuse_transmittance_sampling_rate");
  }
  // A constant 0 is as good as none: the back of such an object is black.
  int& spec_trans = m.extra[P::spec_trans];
  if (spec_trans >= 0) {
    const Texture& t = scene_.textures[static_cast<std::size_t>(spec_trans)];
    if (t.kind == Texture::Kind::constant && t.color0.x == 0.0f) spec_trans = -1;
  }
}

void SceneBuilder::read_principled(Params& params, Material& m) {
  using P = ExtraParameter;
  read_principled_base(params, m);
  read_extra(params, m, P::metallic, "metallic", TextureRole::fraction, 0.0f);
  read_extra(params, m, P::clearcoat, "clearcoat", TextureRole::fraction, 0.0f);
  read_extra(params, m, P::clearcoat_gloss, "clearcoat_gloss", TextureRole::fraction, 0.0f);
  const bool transmissive = m.extra[P::spec_trans] >= 0;
  constexpr float kAbsent = -1.0f;
  const bool given = params.given("eta");
  float specular = params.float_in("specular", given ? kAbsent : 0.5f, given ? kAbsent : 0.0f, 1.0f);
  if (given && specular != kAbsent) fail(params.where("specular"), "principled takes eta or specular, not both");
  m.ext_ior = 1.0f;
  m.int_ior = params.float_in("eta", 1.5f, 1e-3f, 100.0f);
  if (given) {
    if (transmissive && m.int_ior == 1.0f) m.int_ior = 1.001f;  // as Mitsuba, and below
  } else {
    if (transmissive && specular == 0.0f) specular = 1e-3f;
    m.int_ior = 2.0f / (1.0f - std::sqrt(0.08f * specular)) - 1.0f;
  }
}

void SceneBuilder::read_principledthin(Params& params, Material& m) {
  read_principled_base(params, m);
  read_extra(params, m, ExtraParameter::diff_trans, "diff_trans", TextureRole::two_sides, 0.0f);
  read_extra(params, m, ExtraParameter::eta, "eta", TextureRole::index, 1.5f);
}

void SceneBuilder::read_hair(Params& params, Material& m) {
  const auto extra = [&](int parameter, float value) { m.extra[parameter] = constant_texture(Vec3f(value)); };
  extra(ExtraParameter::roughness, params.float_in("longitudinal_roughness", 0.3f, 0.0f, 1.0f));
  extra(ExtraParameter::azimuthal_roughness, params.float_in("azimuthal_roughness", 0.3f, 0.0f, 1.0f));
  extra(ExtraParameter::scale_tilt, params.float_in("scale_tilt", 2.0f, -90.0f, 90.0f));
  m.int_ior = index_of_refraction(params, "int_ior", "amber");
  m.ext_ior = index_of_refraction(params, "ext_ior", "air");
  if (m.int_ior == m.ext_ior) fail(params.where("int_ior"), "hair needs an int_ior that differs from ext_ior");
  const bool pigments = params.given("eumelanin") || params.given("pheomelanin");
  if (pigments && params.given("sigma_a"))
    fail(params.where("sigma_a"), "hair takes sigma_a, or eumelanin and pheomelanin, not both");
  // Absorption of a radius, by concentrations of pigments (d'Eon et al. 2011, "An Energy-Conserving Hair Reflectance
  // Model").
  const float eumelanin = params.float_in("eumelanin", 1.3f, 0.0f, 1e6f);
  const float pheomelanin = params.float_in("pheomelanin", 0.2f, 0.0f, 1e6f);
  const float scale = params.float_in("scale", 1.0f, 0.0f, 1e6f);
  constexpr Vec3f kNone(-1.0f);
  const Vec3f given = constant_color(params, "sigma_a", TextureRole::absorption, kNone);
  const Vec3f absorption = given.x >= 0.0f
                               ? given * scale
                               : Vec3f(0.419f, 0.697f, 1.37f) * eumelanin + Vec3f(0.187f, 0.4f, 1.05f) * pheomelanin;
  m.specular_transmittance =
      constant_texture({std::exp(-absorption.x), std::exp(-absorption.y), std::exp(-absorption.z)});
}

void SceneBuilder::read_measured(Params& params, Material& m) {
  const std::string file = params.required_string("filename");
  const std::string path = description_.resolve(file, params.where("filename"));
  std::error_code code;
  const std::string identity = std::filesystem::weakly_canonical(path, code).string();
  const auto [known, added] = measured_files_.emplace(identity, MeasuredFile());
  MeasuredFile& found = known->second;
  if (added) {
    try {
      scene_.measured.push_back(read_measured_file(path));
      found.index = static_cast<int>(scene_.measured.size()) - 1;
    } catch (...) {
      found.mistake = std::current_exception();
    }
  }
  if (found.mistake) std::rethrow_exception(found.mistake);
  m.measured = found.index;
}

// The distribution of microfacets, and alpha, or alpha_u and alpha_v.
void SceneBuilder::anisotropic_microfacets(Params& params, Material& m) {
  microfacets(params, m);
  const int alpha = texture(params, "alpha", TextureRole::roughness);
  m.alpha_u = texture(params, "alpha_u", TextureRole::roughness);
  m.alpha_v = texture(params, "alpha_v", TextureRole::roughness);
  if ((m.alpha_u >= 0) != (m.alpha_v >= 0))
    fail(params.location(), params.type() + " needs both alpha_u and alpha_v, or alpha alone");
  if (alpha >= 0 && m.alpha_u >= 0)
    fail(params.where("alpha"), params.type() + " takes alpha or alpha_u and alpha_v, not both");
  if (m.alpha_u < 0) m.alpha_u = m.alpha_v = alpha >= 0 ? alpha : constant_texture(Vec3f(0.1f));
}

void SceneBuilder::microfacets(Params& params, Material& m) {
  m.distribution = params.choice("distribution", "beckmann", {"beckmann", "ggx"}) == "ggx"
                       ? MicrofacetDistribution::ggx
                       : MicrofacetDistribution::beckmann;
  m.sample_visible = params.get_bool("sample_visible", true);
}

void SceneBuilder::conductor_index(Params& params, Material& m) {
  const Location where = params.where("material");
  const std::string name = params.get_string("material", "");
  const Vec3f none(-1.0f);
  const Vec3f eta = constant_color(params, "eta", TextureRole::index, none);
  const Vec3f k = constant_color(params, "k", TextureRole::index, none);
  if (!name.empty() && name != "none" && (eta.x >= 0.0f || k.x >= 0.0f))
    fail(where, params.what() + " takes either material or eta and k, not both");
  const auto known = named_conductor(name.empty() ? "none" : name);
  if (!known)
    fail(where, "unknown conductor \"" + name + "\"" + did_you_mean(name, conductor_names()) +
                    "; supported: " + join(conductor_names()));
  m.eta = eta.x >= 0.0f ? eta : known->eta;
  m.k = k.x >= 0.0f ? k : known->k;
}

Vec3f SceneBuilder::constant_color(Params& params, const std::string& name, TextureRole role, Vec3f fallback) {
  const Element* parameter = params.find(name);
  if (!parameter) return fallback;
  const auto value = constant_value(follow_reference(description_, *parameter), role);
  if (!value)
    fail(parameter->location,
         "parameter \"" + name + "\" of " + params.what() + " must be a constant: <rgb>, <float> or <spectrum>");
  return *value;
}

float SceneBuilder::index_of_refraction(Params& params, const std::string& name, const std::string& fallback) {
  const Location where = params.where(name);
  const Element* parameter = params.find(name);
  if (!parameter) return *named_ior(fallback);
  if (parameter->tag == "string") {
    const std::string& word = parameter->get("value");
    const auto ior = named_ior(word);
    if (!ior)
      fail(where, "unknown medium \"" + word + "\" for " + name + did_you_mean(word, ior_names()) +
                      "; supported: a <float>, or " + join(ior_names()));
    return *ior;
  }
  if (parameter->tag != "float" && parameter->tag != "integer") {
    fail(where, "parameter \"" + name + "\" of " + params.what() + " must be <float> or <string>, not <" +
                    parameter->tag + ">");
  }
  const auto numbers = parse_numbers(parameter->get("value"));
  if (!numbers || numbers->size() != 1 || !((*numbers)[0] > 0.0 && (*numbers)[0] < 100.0)) {
    fail(where, "\"" + parameter->get("value") + "\" is not an index of refraction (a number above 0)");
  }
  return static_cast<float>((*numbers)[0]);
}

}  // namespace octrad
