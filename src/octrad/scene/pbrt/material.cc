// Materials of pbrt. Names and defaults are those of "pbrt-v4 Input File Format" and "pbrt-v3 Input File Format";
// materials that only version 3 has become those that pbrt's own upgrade makes of them. All have the microfacets of
// Trowbridge and Reitz (GGX).
#include "octrad/scene/pbrt/material.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "octrad/base/error.h"
#include "octrad/base/join.h"
#include "octrad/base/number_text.h"
#include "octrad/scene/named_materials.h"

namespace octrad {
namespace {

constexpr int kMostMixed = 8;  // materials inside of one another

const std::vector<std::string> kKnown = {
    "diffuse", "coateddiffuse", "conductor", "coatedconductor", "dielectric",  "thindielectric", "diffusetransmission",
    "hair",    "measured",      "mix",       "interface",       "matte",       "plastic",        "substrate",
    "uber",    "metal",         "mirror",    "glass",           "translucent", "disney"};

bool is_none(const std::string& type) { return type.empty() || type == "none" || type == "interface"; }

}  // namespace

PbrtMaterials::Object PbrtMaterials::named(const std::string& name, const Location& where, std::size_t serial) const {
  const auto found = named_.find(name);
  const Object* definition = found == named_.end() ? nullptr : defined(found->second, serial);
  if (!definition)
    fail(where, "there is no material with the name \"" + name + "\"" + did_you_mean(name, keys_near(named_, name)));
  return *definition;
}

PbrtMaterials::Object PbrtMaterials::named_for_shapes(const std::string& name, const Location& where) {
  if (old_ || named_.count(name)) return named(name, where, serial_);
  Object& promise = promises_[name];
  if (!promise) {
    promise = std::make_shared<const PbrtObject>("NamedMaterial", name, where);
    promised_.emplace(promise.get(), name);
  }
  return promise;
}

PbrtMaterials::Object PbrtMaterials::resolved(const Object& material) const {
  const auto promised = promised_.find(material.get());
  return promised == promised_.end() ? material : named(promised->second, material->location(), serial_);
}

std::string PbrtMaterials::bsdf(const Object& material, const PbrtObject& shape) {
  static const Object plain = std::make_shared<const PbrtObject>("Material", "diffuse", Location());
  Wanted wanted;
  wanted.material = material ? material : plain;
  if (const PbrtParameter* p = shape.find("alpha"); p && p->type == "texture") {
    wanted.alpha_texture = *p;
    // In version 3 a name is the same texture until it is defined again.
    const std::string name = p->texts.empty() ? "" : p->texts[0];
    const auto found = objects_.find({true, name});
    const Object* texture = old_ && found != objects_.end() ? defined(found->second, p->serial) : nullptr;
    wanted.alpha_key =
        "texture " + std::to_string(reinterpret_cast<std::uintptr_t>(texture ? texture->get() : nullptr)) + name;
  } else {
    report_.attempt(shape.where("alpha"), [&] { wanted.alpha = shape.number("alpha", 1.0); });
    if (wanted.alpha < 1.0) wanted.alpha_key = number_text(wanted.alpha);
  }
  const auto [at, inserted] = bsdfs_.try_emplace({wanted.material.get(), wanted.alpha_key}, "");
  if (!inserted) return at->second;
  at->second = wanted.id = "material" + std::to_string(wanted_.size());
  wanted.where = wanted.material->location().file ? wanted.material->location() : shape.location();
  wanted_.push_back(wanted);
  return wanted.id;
}

void PbrtMaterials::add_bsdfs() {
  std::vector<std::unique_ptr<Element>>& all = description_.root->children;
  const auto first = static_cast<std::ptrdiff_t>(all.size());
  std::map<std::pair<const PbrtObject*, std::string>, std::string> added;  // ids of what the promises stand for
  for (const Wanted& wanted : wanted_) {
    const auto before = static_cast<std::ptrdiff_t>(all.size());
    const std::string& id = wanted.id;
    const bool usable = report_.attempt(wanted.where, [&] {
      const Object m = resolved(wanted.material);
      const auto [known, fresh] = added.try_emplace({m.get(), wanted.alpha_key}, id);
      if (!fresh) {  // by its name before it was defined, and after
        description_.ids[id] = description_.ids.at(known->second);
        return;
      }
      PbrtTexture alpha;
      alpha.value = Vec3d(wanted.alpha);
      if (const auto& p = wanted.alpha_texture) {
        report_.attempt(p->where, [&] {
          if (p->texts.size() != 1) fail(p->where, "the parameter \"alpha\" must name one texture");
          alpha = named_texture(p->texts[0], true, *p);
        });
      }
      add_bsdf(id, m, alpha, m->location().file ? m->location() : wanted.where);
    });
    if (usable) continue;
    // What is there of it goes; what looks like nothing else takes its place.
    all.erase(std::remove_if(all.begin() + before, all.end(), [&](const auto& e) { return e->get("id") == id; }),
              all.end());
    Element& stand_in = add_element(*description_.root, wanted.where, "bsdf", {{"type", "diffuse"}, {"id", id}});
    add_element(stand_in, wanted.where, "rgb", {{"name", "reflectance"}, {"value", "1, 0, 1"}});
    description_.ids[id] = &stand_in;
  }
  std::rotate(all.begin(), all.begin() + first, all.end());  // before the shapes that refer to them
}

Element& PbrtMaterials::nest(Element& parent, const Location& where, const std::string& type, Attributes labels) {
  labels.insert(labels.begin(), {"type", type});
  Element& e = add_element(parent, where, "bsdf", std::move(labels));
  if (const std::string* id = e.find("id")) description_.ids.emplace(*id, &e);
  return e;
}

int PbrtMaterials::leaves(const PbrtObject& m, int depth) const {
  if (m.type() != "mix") return 1;
  if (depth >= kMostMixed) fail(m.location(), "materials are mixed too deep, or one with itself");
  const auto [a, b] = parts(m);
  return leaves(*a, depth + 1) + leaves(*b, depth + 1);
}

// Opaque surfaces have two sides in pbrt.
void PbrtMaterials::add_bsdf(const std::string& id, const Object& material, const PbrtTexture& alpha,
                             const Location& where) {
  const PbrtObject& m = *material;
  if (leaves(m, 0) > kMostBlended)
    fail(where, "a mix of more than " + std::to_string(kMostBlended) + " materials is not supported");
  Element* parent = description_.root.get();
  Attributes labels = {{"id", id}};
  const auto wrap = [&](const char* type) {
    parent = &nest(*parent, where, type, labels);
    labels.clear();
  };
  const auto cut = [&](const PbrtTexture& opacity, PbrtMap map) {
    if (opacity.is_constant() && pbrt_map(map, channel_mean(opacity.value)) >= 1.0) return;
    wrap("mask");
    add(*parent, where, "opacity", opacity, Role::share, map);
  };
  cut(alpha, old_ ? PbrtMap::old_cut : PbrtMap::none);
  if (m.type() == "uber" && m.has("opacity")) {
    const PbrtTexture own = texture(m, "opacity", false, Vec3d(1.0));
    if (own.is_constant() || alpha.is_constant()) cut(own, PbrtMap::none);
    else
      report_.assume(m.where("opacity"), "of two textures that cut holes, alpha and opacity, the second is left out");
  }
  if (const std::string file = m.text("normalmap", ""); !file.empty()) {
    wrap("normalmap");
    PbrtTexture map;
    map.kind = PbrtTexture::Kind::picture;
    map.gamma = 1.0;
    map.file = absolute_path(description_.resolve(file, m.where("normalmap")));
    add(*parent, m.where("normalmap"), "normalmap", map, Role::color);
  }
  for (const char* name : {"displacement", "bumpmap"}) {
    if (!m.has(name)) continue;
    PbrtTexture height;
    try {
      height = texture(m, name, true, Vec3d(0.0));
    } catch (const InputError& error) {
      if (!has_texture(m, name, true)) throw;  // a name that is not known, or a parameter of another kind
      report_.assume(m.where(name), std::string("a displacement is left out: ") + error.what());
      continue;
    }
    if (height.is_constant()) continue;
    if (height.kind != PbrtTexture::Kind::picture) {
      report_.assume(m.where(name), "a displacement that is no picture is left out");
      continue;
    }
    wrap("bumpmap");
    const double scale = height.value.x;
    height.value = Vec3d(1.0);
    add(*parent, m.where(name), "arbitrary", height, Role::height);
    add_number(*parent, m.where(name), "scale", scale);
  }
  if (is_opaque(m)) wrap("twosided");  // within the maps: the whole mapped normal is turned over on the back
  parts_turn_ = !is_opaque(m);
  add_model(*parent, m, labels);
  m.note_unused(report_);
}

std::pair<PbrtMaterials::Object, PbrtMaterials::Object> PbrtMaterials::parts(const PbrtObject& mix) const {
  if (const PbrtParameter* p = mix.find("materials", {"string"})) {
    if (p->texts.size() != 2) fail(p->where, "a mix needs the names of two materials");
    return {named(p->texts[0], p->where, p->serial), named(p->texts[1], p->where, p->serial)};
  }
  const PbrtParameter *a = mix.find("namedmaterial1", {"string"}), *b = mix.find("namedmaterial2", {"string"});
  if (!a || !b || a->texts.size() != 1 || b->texts.size() != 1)
    fail(mix.location(), "a mix needs the names of two materials");
  return {named(a->texts[0], a->where, a->serial), named(b->texts[0], b->where, b->serial)};
}

// Of disney.
bool PbrtMaterials::transmits(const PbrtObject& m) {
  if (m.flag("thin", false)) return true;
  const PbrtParameter* p = m.find("spectrans");
  return p && (p->type == "texture" || m.number("spectrans", 0.0) > 0.0);
}

bool PbrtMaterials::is_opaque(const PbrtObject& m) const {
  const std::string& type = m.type();
  if (type == "mix") {
    const auto [a, b] = parts(m);
    return is_opaque(*a) && is_opaque(*b);
  }
  return !(is_none(type) || type == "dielectric" || type == "glass" || type == "thindielectric" || type == "hair" ||
           type == "diffusetransmission" || type == "translucent" || (type == "disney" && transmits(m)));
}

void PbrtMaterials::add_model(Element& parent, const PbrtObject& m, const Attributes& labels) {
  const std::string& type = m.type();
  if (is_none(type)) {
    nest(parent, m.location(), "null", labels);
  } else if (type == "diffuse" || type == "matte") {
    const double sigma = type == "matte" ? constant_number(m, "sigma", 0.0) : 0.0;
    Element& e = nest(parent, m.location(), sigma > 0.0 ? "roughdiffuse" : "diffuse", labels);
    add_color(e, "reflectance", m, type == "matte" ? "Kd" : "reflectance", 0.5);
    // The roughness of Mitsuba's model is the root of 2 times the deviation of slopes, that of pbrt their angle.
    if (sigma > 0.0)
      add_number(e, m.location(), "alpha", std::min(std::numbers::sqrt2 * sigma * std::numbers::pi / 180.0, 1.0));
  } else if (type == "coateddiffuse" || type == "plastic" || type == "substrate" || type == "uber") {
    add_coat(parent, m, labels);
  } else if (type == "conductor" || type == "metal" || type == "mirror") {
    add_conductor(parent, m, labels, "");
  } else if (type == "coatedconductor") {
    report_.assume(m.location(), "a coatedconductor has no coat");
    m.ignore({"interface.roughness", "interface.uroughness", "interface.vroughness", "interface.eta", "thickness", "g",
              "albedo", "maxdepth", "nsamples"});
    add_conductor(parent, m, labels, "conductor.");
  } else if (type == "dielectric" || type == "glass") {
    add_dielectric(parent, m, labels);
  } else if (type == "thindielectric") {
    Element& e = nest(parent, m.location(), "thindielectric", labels);
    add_number(e, m.location(), "int_ior", eta(m, 1.5));
    add_number(e, m.location(), "ext_ior", 1.0);
  } else if (type == "diffusetransmission" || type == "translucent") {
    add_translucent(parent, m, labels);
  } else if (type == "hair") {
    add_hair(parent, m, labels);
  } else if (type == "measured") {
    Element& e = nest(parent, m.location(), "measured", labels);
    const std::string file = m.text("filename", "");
    add_element(e, m.where("filename"), "string",
                {{"name", "filename"}, {"value", absolute_path(description_.resolve(file, m.where("filename")))}});
  } else if (type == "mix") {
    add_mix(parent, m, labels);
  } else if (type == "disney") {
    add_disney(parent, m, labels);
  } else {
    std::string advice;
    if (type == "subsurface" || type == "kdsubsurface") advice = "; coateddiffuse looks like it where it is thick";
    if (type == "fourier") advice = "; take a measured one";
    fail(m.location(),
         m.what() + " is not supported" + advice + did_you_mean(type, kKnown) + "; supported: " + join(kKnown));
  }
}

void PbrtMaterials::add_color(Element& bsdf, const std::string& name, const PbrtObject& m, std::string_view parameter,
                              double fallback) {
  add(bsdf, m.where(parameter), name, texture(m, parameter, false, Vec3d(fallback)), Role::color);
}

void PbrtMaterials::add_value(Element& bsdf, const std::string& name, const PbrtObject& m, std::string_view parameter,
                              double fallback) {
  add(bsdf, m.where(parameter), name, texture(m, parameter, true, Vec3d(fallback)), Role::number);
}

double PbrtMaterials::eta(const PbrtObject& m, double fallback) const {
  const char* name = m.has("index") ? "index" : "eta";
  const PbrtParameter* p = m.find(name);
  if (p && p->type == "texture") {
    report_.assume(p->where, "a texture as index of refraction is read as " + number_text(fallback));
    return fallback;
  }
  const Vec3d value = color(m, name, SpectrumUse::index).value_or(Vec3d(fallback));
  if (value.x != value.y || value.x != value.z || (p && p->type == "spectrum" && !p->texts.empty()))
    report_.assume(m.where(name), "glass does not disperse: its index of refraction is the mean over colours");
  const double index = channel_mean(value);
  if (!(index > 0.1 && index < 100.0)) fail(m.where(name), "the index of refraction is out of range");
  return index;
}

PbrtMaterials::Roughness PbrtMaterials::roughness(const PbrtObject& m, const std::string& prefix, double fallback) {
  Roughness r;
  PbrtTexture both;
  both.value = Vec3d(fallback);
  if (m.type() != "glass") both = texture(m, prefix + "roughness", true, Vec3d(fallback));  // glass has two alone
  r.u = m.has(prefix + "uroughness") ? texture(m, prefix + "uroughness", true, Vec3d(fallback)) : both;
  r.v = m.has(prefix + "vroughness") ? texture(m, prefix + "vroughness", true, Vec3d(fallback)) : both;
  r.remap = m.flag("remaproughness", true);
  const auto smooth = [&](const PbrtTexture& t) {
    return t.is_constant() && (old_ ? t.value.x <= 0.0 && (m.type() == "glass" || m.type() == "mirror")
                                    : pbrt_map(alpha_map(r), t.value.x) < 1e-3);
  };
  r.smooth = smooth(r.u) && smooth(r.v);
  return r;
}

PbrtMap PbrtMaterials::alpha_map(const Roughness& r) const {
  return !r.remap ? PbrtMap::none : old_ ? PbrtMap::old_alpha : PbrtMap::root;
}

void PbrtMaterials::add_alpha(Element& bsdf, const PbrtObject& m, const Roughness& r) {
  add_element(bsdf, m.location(), "string", {{"name", "distribution"}, {"value", "ggx"}});
  if (r.u == r.v) return add(bsdf, m.location(), "alpha", r.u, Role::number, alpha_map(r));
  add(bsdf, m.location(), "alpha_u", r.u, Role::number, alpha_map(r));
  add(bsdf, m.location(), "alpha_v", r.v, Role::number, alpha_map(r));
}

// A diffuse base under a dielectric coat.
void PbrtMaterials::add_coat(Element& parent, const PbrtObject& m, const Attributes& labels) {
  const bool v4 = m.type() == "coateddiffuse";
  const char* base = v4 ? "reflectance" : "Kd";
  const double base_default = m.type() == "plastic" || m.type() == "uber" ? 0.25 : 0.5;
  const Roughness r = roughness(m, "", v4 ? 0.0 : 0.1);
  const double index = eta(m, 1.5);
  if (!v4) {
    report_.assume(m.location(), m.what() + " read as coateddiffuse, as pbrt's own upgrade does");
    for (const char* name : {"Kr", "Kt"}) {
      const PbrtParameter* p = m.find(name);
      if (p &&
          !(p->type != "texture" && channel_mean(color(m, name, SpectrumUse::reflectance).value_or(Vec3d(0.0))) <= 0.0))
        report_.assume(p->where, "what " + m.what() + " reflects and transmits like glass (Kr, Kt) is left out");
    }
  }
  const PbrtTexture coat = v4 ? PbrtTexture() : texture(m, "Ks", false, Vec3d(m.type() == "substrate" ? 0.5 : 0.25));
  const bool bare = !v4 && coat.is_constant() && channel_mean(coat.value) <= 0.0;
  m.ignore({"g", "nsamples"});  // of a coat that scatters
  if (const auto albedo = color(m, "albedo", SpectrumUse::reflectance); albedo && channel_mean(*albedo) > 0.0)
    report_.assume(m.where("albedo"), "the coat of a coateddiffuse is clear (albedo)");
  if (!(index > 1.0) || bare) {
    Element& e = nest(parent, m.location(), "diffuse", labels);
    return add_color(e, "reflectance", m, base, base_default);
  }
  if (!r.u.is_constant() || !r.v.is_constant()) {
    // The roughness of roughplastic is one number, that of principled may be a picture.
    report_.assume(m.location(), "a coateddiffuse whose roughness is a texture is read as principled");
    Element& e = nest(parent, m.location(), "principled", labels);
    add_color(e, "base_color", m, base, base_default);
    const PbrtMap map = !r.remap ? PbrtMap::root : old_ ? PbrtMap::old_alpha_root : PbrtMap::fourth_root;
    add(e, m.location(), "roughness", r.u.is_constant() ? r.v : r.u, Role::number, map);
    return add_number(e, m.location(), "eta", std::max(index, 1.001));
  }
  Element& e = nest(parent, m.location(), r.smooth ? "plastic" : "roughplastic", labels);
  add_color(e, "diffuse_reflectance", m, base, base_default);
  add_number(e, m.location(), "int_ior", index);
  add_number(e, m.location(), "ext_ior", 1.0);
  if (m.type() == "plastic" || m.type() == "uber") add(e, m.where("Ks"), "specular_reflectance", coat, Role::color);
  add_element(e, m.location(), "boolean", {{"name", "nonlinear"}, {"value", "true"}});
  if (r.smooth) return;
  const double alpha = 0.5 * (pbrt_map(alpha_map(r), r.u.value.x) + pbrt_map(alpha_map(r), r.v.value.x));
  if (!(r.u == r.v)) report_.assume(m.location(), "a coat is as rough in one direction as in the other");
  add_element(e, m.location(), "string", {{"name", "distribution"}, {"value", "ggx"}});
  add_number(e, m.location(), "alpha", alpha);
}

void PbrtMaterials::add_conductor(Element& parent, const PbrtObject& m, const Attributes& labels,
                                  const std::string& prefix) {
  const bool mirror = m.type() == "mirror";
  const Roughness r = roughness(m, prefix, m.type() == "metal" ? 0.01 : 0.0);
  Element& e = nest(parent, m.location(), r.smooth ? "conductor" : "roughconductor", labels);
  if (!r.smooth) add_alpha(e, m, r);
  const std::string reflectance = mirror ? "Kr" : "reflectance";
  if (mirror || m.has(reflectance)) {
    const PbrtTexture t = texture(m, reflectance, false, Vec3d(0.9));
    if (mirror || !t.is_constant()) {
      if (!mirror)
        report_.assume(m.location(), "a conductor whose reflectance is a texture reflects that from all angles");
      add_element(e, m.location(), "string", {{"name", "material"}, {"value", "none"}});
      return add(e, m.where(reflectance), "specular_reflectance", t, Role::color);
    }
    // That reflects so much straight on: eta = 1, k = 2 sqrt(r / (1 - r)).
    Vec3d k;
    for (int c = 0; c < 3; ++c) {
      const double f = std::clamp(t.value[c], 0.0, 0.9999);
      k[c] = 2.0 * std::sqrt(f / (1.0 - f));
    }
    add_element(e, m.location(), "rgb", {{"name", "eta"}, {"value", "1, 1, 1"}});
    add_element(e, m.location(), "rgb", {{"name", "k"}, {"value", three_numbers(k)}});
    return;
  }
  const ConductorIor copper = *named_conductor("Cu");
  const std::string name = prefix + "eta", k_name = prefix + "k";
  const PbrtParameter *p = m.find(name), *q = m.find(k_name);
  // One of Mitsuba's metals by name: the written file says so too.
  const auto metal = [](const PbrtParameter* of, const std::string& end) {
    const std::string text = of && of->texts.size() == 1 ? of->texts[0] : "";
    return text.starts_with("metal-") && text.ends_with(end) ? text.substr(6, text.size() - 6 - end.size())
                                                             : std::string();
  };
  const std::string named = !p && !q ? "Cu" : metal(p, "-eta");
  if (!named.empty() && (!q || metal(q, "-k") == named) && named_conductor(named)) {
    add_element(e, m.where(name), "string", {{"name", "material"}, {"value", named}});
    return;
  }
  const Vec3d eta = color(m, name, SpectrumUse::index).value_or(Vec3d(copper.eta)),
              k = color(m, k_name, SpectrumUse::index).value_or(Vec3d(copper.k));
  add_element(e, m.where(name), "rgb", {{"name", "eta"}, {"value", three_numbers(eta)}});
  add_element(e, m.where(k_name), "rgb", {{"name", "k"}, {"value", three_numbers(k)}});
}

void PbrtMaterials::add_dielectric(Element& parent, const PbrtObject& m, const Attributes& labels) {
  const Roughness r = roughness(m, "", 0.0);
  const double index = eta(m, 1.5);
  if (std::fabs(index - 1.0) < 1e-4) {
    nest(parent, m.location(), "null", labels);
    return;
  }
  Element& e = nest(parent, m.location(), r.smooth ? "dielectric" : "roughdielectric", labels);
  add_number(e, m.location(), "int_ior", index);
  add_number(e, m.location(), "ext_ior", 1.0);
  if (!r.smooth) add_alpha(e, m, r);
  if (m.type() != "glass") return;
  if (m.has("Kr")) add_color(e, "specular_reflectance", m, "Kr", 1.0);
  if (m.has("Kt")) add_color(e, "specular_transmittance", m, "Kt", 1.0);
}

// What principledthin reflects and transmits diffusely is one colour in two shares.
void PbrtMaterials::add_translucent(Element& parent, const PbrtObject& m, const Attributes& labels) {
  const bool v4 = m.type() == "diffusetransmission";
  const PbrtTexture r = texture(m, v4 ? "reflectance" : "Kd", false, Vec3d(0.25)),
                    t = texture(m, v4 ? "transmittance" : "transmit", false, Vec3d(v4 ? 0.25 : 0.5));
  PbrtTexture base = r;
  Vec3d reflected(1.0), transmitted(1.0);  // what is done with the base colour
  if (!v4) {
    // Kd is spread over both by two colours.
    const PbrtTexture share = texture(m, "reflect", false, Vec3d(0.5));
    reflected = share.is_constant() ? share.value : Vec3d(0.5);
    transmitted = t.is_constant() ? t.value : Vec3d(0.5);
  } else if (r.is_constant() && t.is_constant()) {
    reflected = r.value;
    transmitted = t.value;
    base.value = Vec3d(1.0);
  } else if (r.is_constant()) {
    base = t;
  }
  base.value = base.value * (reflected + transmitted) * m.number("scale", 1.0, 0.0);
  report_.assume(m.location(),
                 m.what() + " read as principledthin, which reflects and transmits one colour in two shares");
  Element& e = nest(parent, m.location(), "principledthin", labels);
  const double sum = channel_mean(reflected + transmitted);
  add(e, m.location(), "base_color", base, Role::color);
  add_number(e, m.location(), "diff_trans",
             std::clamp(sum > 0.0 ? 2.0 * channel_mean(transmitted) / sum : 1.0, 0.0, 2.0));
  add_number(e, m.location(), "roughness", 1.0);
}

void PbrtMaterials::add_hair(Element& parent, const PbrtObject& m, const Attributes& labels) {
  Element& e = nest(parent, m.location(), "hair", labels);
  const double beta_n = constant_number(m, "beta_n", 0.3);
  const char* name = m.has("reflectance") ? "reflectance" : "color";
  const auto absorption = [&](Vec3d sigma) {
    add_element(e, m.location(), "rgb", {{"name", "sigma_a"}, {"value", three_numbers(sigma)}});
  };
  if (const auto given = color(m, "sigma_a", SpectrumUse::index)) {
    absorption(*given);
  } else if (m.has(name)) {
    const PbrtTexture t = texture(m, name, false, Vec3d(0.5));
    if (!t.is_constant()) report_.assume(m.where(name), "the colour of hair is one: 0.5 instead of a texture");
    // Chiang et al. 2016, equation 9.
    const double n = beta_n, power = 5.969 + n * (-0.215 + n * (2.532 + n * (-10.73 + n * (5.574 + n * 0.245))));
    Vec3d sigma;
    for (int c = 0; c < 3; ++c) {
      const double l = std::log(std::clamp(t.is_constant() ? t.value[c] : 0.5, 1e-4, 1.0)) / power;
      sigma[c] = l * l;
    }
    absorption(sigma);
  } else {
    const bool any = m.has("eumelanin") || m.has("pheomelanin");
    add_number(e, m.location(), "eumelanin", constant_number(m, "eumelanin", any ? 0.0 : 1.3));
    add_number(e, m.location(), "pheomelanin", constant_number(m, "pheomelanin", 0.0));
  }
  add_number(e, m.location(), "longitudinal_roughness", std::clamp(constant_number(m, "beta_m", 0.3), 0.0, 1.0));
  add_number(e, m.location(), "azimuthal_roughness", std::clamp(beta_n, 0.0, 1.0));
  add_number(e, m.location(), "scale_tilt", constant_number(m, "alpha", 2.0));
  add_number(e, m.location(), "int_ior", eta(m, 1.55));
  add_number(e, m.location(), "ext_ior", 1.0);
}

void PbrtMaterials::add_disney(Element& parent, const PbrtObject& m, const Attributes& labels) {
  const bool thin = m.flag("thin", false);
  Element& e = nest(parent, m.location(), thin ? "principledthin" : "principled", labels);
  add_color(e, "base_color", m, "color", 0.5);
  add_value(e, "roughness", m, "roughness", 0.5);
  add_number(e, m.location(), "eta", std::max(eta(m, 1.5), 1.001));
  add_value(e, "spec_tint", m, "speculartint", 0.0);
  add_value(e, "anisotropic", m, "anisotropic", 0.0);
  add_value(e, "sheen", m, "sheen", 0.0);
  add_value(e, "sheen_tint", m, "sheentint", 0.5);
  add_value(e, "spec_trans", m, "spectrans", 0.0);
  if (thin) {
    add_value(e, "diff_trans", m, "difftrans", 1.0);
    add_value(e, "flatness", m, "flatness", 0.0);
    return;
  }
  add_value(e, "metallic", m, "metallic", 0.0);
  add_value(e, "clearcoat", m, "clearcoat", 0.0);
  add_value(e, "clearcoat_gloss", m, "clearcoatgloss", 1.0);
}

void PbrtMaterials::add_mix(Element& parent, const PbrtObject& m, const Attributes& labels) {
  const bool v4 = m.has("materials");
  const auto [a, b] = parts(m);
  Element& e = nest(parent, m.location(), "blendbsdf", labels);
  // The share of the second; in version 3 the amount is that of the first.
  add(e, m.where("amount"), "weight", texture(m, "amount", v4, Vec3d(0.5)), Role::share);
  add_part(e, v4 ? *a : *b);
  add_part(e, v4 ? *b : *a);
}

void PbrtMaterials::add_part(Element& mix, const PbrtObject& m) {
  for (const char* name : {"displacement", "bumpmap", "normalmap", "opacity"}) {
    if (m.has(name))
      report_.assume(m.where(name), "the parameter \"" + std::string(name) + "\" of a material in a mix is left out");
  }
  const bool turns = parts_turn_ && m.type() != "mix" && is_opaque(m);
  add_model(turns ? nest(mix, m.location(), "twosided", {}) : mix, m, {});
  m.note_unused(report_);
}

Vec3d PbrtMaterials::light_color(const Object& object) {
  if (const auto known = lights_.find(object); known != lights_.end()) return known->second;
  const PbrtObject& light = *object;
  if (light.type() != "diffuse" && light.type() != "area")
    fail(light.location(), light.what() + " is not supported; supported: diffuse");
  light.ignore({"samples", "nsamples", "filename", "power", "twosided"});
  const Vec3d l = strength(light, "L");
  light.note_unused(report_);
  return lights_[object] = l;
}

void PbrtMaterials::add_emitter(Element& shape, const Object& object, double area) {
  const PbrtObject& light = *object;
  const Location where = light.location();
  Vec3d l = light_color(object);
  const bool two_sided = light.flag("twosided", false);
  if (light.has("power")) {
    if (light.has("filename"))
      fail(light.where("power"), "the power of a light with a picture is not supported; give its scale");
    if (!(area > 0.0)) fail(light.where("power"), "the power of a light without an area");
    // Of a radiance whose luminance is 1.
    l = l * (light.number("power", 0.0, 0.0) / (std::numbers::pi * area * (two_sided ? 2.0 : 1.0)));
  }
  const auto add_light = [&]() -> Element& { return add_element(shape, where, "emitter", {{"type", "area"}}); };
  if (!light.has("filename")) {
    add_element(add_light(), light.where("L"), "rgb", {{"name", "radiance"}, {"value", three_numbers(l)}});
    return;
  }
  PbrtTexture t;
  t.kind = PbrtTexture::Kind::picture;
  t.file = absolute_path(description_.resolve(light.text("filename", ""), light.where("filename")));
  t.value = l;
  t.wrap = "clamp";
  add(add_light(), where, "radiance", t, Role::radiance);
}

}  // namespace octrad
