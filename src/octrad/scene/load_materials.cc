#include <algorithm>

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
const std::vector<std::string> kWrappers = {"twosided", "mask", "bumpmap"};

// What can be written instead of models that there are not.
std::string way_out(const std::string& type) {
  static const std::pair<const char*, const char*> ways[] = {
      {"hk", "a thin scattering layer has no counterpart; use diffuse or principledthin"},
      {"irawan", "woven cloth has no counterpart; use diffuse with a bitmap"},
      {"hair", "use diffuse or roughconductor"},
      {"measured", "fit a principled bsdf to the measurement"},
      {"measured_polarized", "light is not polarised here; fit a principled bsdf to the measurement"},
      {"pplastic", "light is not polarised here; use roughplastic"},
      {"polarizer", "light is not polarised here"},
      {"retarder", "light is not polarised here"},
      {"circular", "light is not polarised here"},
  };
  for (const auto& [name, way] : ways) {
    if (type == name) return std::string("; ") + way;
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

bool transmits(const Material& m) { return m.opacity >= 0 || transmits(m.type); }

}  // namespace

std::vector<std::string> bsdf_types() {
  std::vector<std::string> types = kModels;
  types.insert(types.end(), kWrappers.begin(), kWrappers.end());
  return types;
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
    m = flatten(*parts[0]);
    if (transmits(m))
      fail(
          parts[0]->location,
          "twosided cannot hold a bsdf that lets light through (dielectric, thindielectric, mask); put the mask around twosided");
    m.two_sided = true;
    if (parts.size() == 2) {
      m.back = material(*parts[1]);
      if (transmits(scene_.materials[static_cast<std::size_t>(m.back)])) {
        fail(parts[1]->location,
             "twosided cannot hold a bsdf that lets light through (dielectric, thindielectric, mask)");
      }
    }
  } else if (params.type() == "mask") {
    const int opacity = texture_or(params, "opacity", TextureRole::opacity, 0.5f);
    const auto parts = nested_bsdfs(params, 1);
    m = flatten(*parts[0]);
    if (m.opacity >= 0)
      fail(element.location, "a mask inside a mask is not supported; multiply the opacities into one");
    m.opacity = opacity;
  } else if (params.type() == "bumpmap") {
    const auto parts = nested_bsdfs(params, 1);
    const float scale = params.get_float("scale", 1.0f);
    const auto textures = params.nested("texture");
    if (textures.size() != 1)
      fail(element.location, "bumpmap needs exactly one <texture>, not " + std::to_string(textures.size()));
    m = flatten(*parts[0]);
    if (m.bump >= 0) fail(element.location, "a bumpmap inside a bumpmap is not supported");
    m.bump = texture_object(*textures[0], TextureRole::height);
    if (scene_.textures[static_cast<std::size_t>(m.bump)].kind != Texture::Kind::bitmap) {
      fail(textures[0]->location, "a bumpmap needs a texture with a gradient: bitmap (a checkerboard has none)");
    }
    m.bump_scale = scale;
    if (m.back >= 0) {
      // Other materials may refer to the same back: apply the bump map to a copy.
      Material back = scene_.materials[static_cast<std::size_t>(m.back)];
      if (back.bump >= 0) fail(element.location, "a bumpmap inside a bumpmap is not supported");
      back.bump = m.bump;
      back.bump_scale = scale;
      m.back = static_cast<int>(scene_.materials.size());
      scene_.materials.push_back(std::move(back));
    }
  } else {
    m = scattering_model(params);
  }
  params.finish();
  open_materials_.pop_back();
  return m;
}

Material SceneBuilder::scattering_model(Params& params) {
  const std::string& type = params.type();
  const auto found = std::find(kModels.begin(), kModels.end(), type);
  if (found == kModels.end()) {
    const std::vector<std::string> known = bsdf_types();
    fail(params.location(), "bsdf \"" + type + "\" is not supported" + did_you_mean(type, known) + way_out(type) +
                                "; supported: " + join(known));
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
  m.alpha_u = m.alpha_v = constant_texture(Vec3f(params.float_in("alpha", 0.1f, 0.0f, 10.0f)));
}

void SceneBuilder::read_conductor(Params& params, Material& m) {
  m.specular_reflectance = texture(params, "specular_reflectance", TextureRole::reflectance);
  conductor_index(params, m);
}

void SceneBuilder::read_roughconductor(Params& params, Material& m) {
  read_conductor(params, m);
  microfacets(params, m);
  const int alpha = texture(params, "alpha", TextureRole::roughness);
  m.alpha_u = texture(params, "alpha_u", TextureRole::roughness);
  m.alpha_v = texture(params, "alpha_v", TextureRole::roughness);
  if ((m.alpha_u >= 0) != (m.alpha_v >= 0))
    fail(params.location(), "roughconductor needs both alpha_u and alpha_v, or alpha alone");
  if (alpha >= 0 && m.alpha_u >= 0)
    fail(params.where("alpha"), "roughconductor takes alpha or alpha_u and alpha_v, not both");
  if (m.alpha_u < 0) m.alpha_u = m.alpha_v = alpha >= 0 ? alpha : constant_texture(Vec3f(0.1f));
}

void SceneBuilder::read_dielectric(Params& params, Material& m) {
  m.specular_reflectance = texture(params, "specular_reflectance", TextureRole::reflectance);
  m.specular_transmittance = texture(params, "specular_transmittance", TextureRole::reflectance);
  m.int_ior = index_of_refraction(params, "int_ior", "bk7");
  m.ext_ior = index_of_refraction(params, "ext_ior", "air");
}

void SceneBuilder::read_thindielectric(Params& params, Material& m) { read_dielectric(params, m); }

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
  const Vec3f eta = constant_color(params, "eta", none), k = constant_color(params, "k", none);
  if (!name.empty() && (eta.x >= 0.0f || k.x >= 0.0f))
    fail(where, params.what() + " takes either material or eta and k, not both");
  const auto known = named_conductor(name.empty() ? "none" : name);
  if (!known)
    fail(where, "unknown conductor \"" + name + "\"" + did_you_mean(name, conductor_names()) +
                    "; supported: " + join(conductor_names()));
  m.eta = eta.x >= 0.0f ? eta : known->eta;
  m.k = k.x >= 0.0f ? k : known->k;
}

Vec3f SceneBuilder::constant_color(Params& params, const std::string& name, Vec3f fallback) {
  const Element* parameter = params.find(name);
  if (!parameter) return fallback;
  const auto value = constant_value(*parameter, TextureRole::index);
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
