#include "octrad/scene/upgrade.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <set>

#include "octrad/base/lower_case.h"
#include "octrad/base/number_text.h"
#include "octrad/image/tonemap_math.h"
#include "octrad/scene/make_element.h"
#include "octrad/scene/material_types.h"
#include "octrad/scene/params.h"

namespace octrad {
namespace {

bool is_upper(char c) { return c >= 'A' && c <= 'Z'; }
bool is_lower(char c) { return c >= 'a' && c <= 'z'; }

std::unique_ptr<Element> object(const std::string& tag, const std::string& type, const Element& near) {
  auto e = std::make_unique<Element>();
  e->tag = tag;
  e->location = near.location;
  e->attributes.emplace_back("type", type);
  return e;
}

void drop_attribute(Element& element, const std::string& attribute) {
  auto& list = element.attributes;
  list.erase(std::remove_if(list.begin(), list.end(), [&](const auto& a) { return a.first == attribute; }), list.end());
}

bool child_with_tag(const Element& element, const std::string& tag) {
  return std::any_of(element.children.begin(), element.children.end(), [&](const auto& c) { return c->tag == tag; });
}

// Takes a child out of the element; null where there is none.
std::unique_ptr<Element> take(Element& element, const std::string& name) {
  for (auto it = element.children.begin(); it != element.children.end(); ++it) {
    if ((*it)->get("name") != name) continue;
    std::unique_ptr<Element> found = std::move(*it);
    element.children.erase(it);
    return found;
  }
  return nullptr;
}

double number_or(const Element* element, double fallback) {
  if (!element) return fallback;
  const auto numbers = parse_numbers(element->get("value"));
  return numbers && numbers->size() == 1 ? (*numbers)[0] : fallback;
}

// Elements that are no objects.

void upgrade_srgb(Element& e) {
  e.tag = "rgb";
  const std::string& text = e.get("value");
  std::string linear;
  if (const auto color = parse_hex_color(text)) {
    for (const double v : {color->x, color->y, color->z}) linear += (linear.empty() ? "" : ", ") + number_text(v);
  } else {
    const auto numbers = parse_numbers(text);
    if (!numbers || (numbers->size() != 1 && numbers->size() != 3)) return;  // a mistake that is found later
    for (const double v : *numbers) linear += (linear.empty() ? "" : ", ") + number_text(decode_srgb(v));
  }
  e.set("value", linear);
}

void upgrade_blackbody(Element& e) {
  e.tag = "spectrum";
  std::string temperature = e.get("temperature");
  if (!temperature.empty() && (temperature.back() == 'K' || temperature.back() == 'k')) temperature.pop_back();
  e.children.push_back(make_property("float", "temperature", temperature, e));
  if (const std::string* scale = e.find("scale")) e.children.push_back(make_property("float", "scale", *scale, e));
  drop_attribute(e, "temperature");
  drop_attribute(e, "scale");
  e.set("type", "blackbody");
}

void upgrade_spectrum(Element& e, SceneReport& report) {
  if (e.get("value").find(':') != std::string::npos) return;
  const auto numbers = parse_numbers(e.get("value"));
  if (!numbers || numbers->size() != 3) return;
  report.assume(e.location, "<spectrum> of three numbers read as linear RGB");
  e.tag = "rgb";
}

// Textures.

void upgrade_uv(Element& e) {
  const std::unique_ptr<Element> parts[4] = {take(e, "uoffset"), take(e, "voffset"), take(e, "uscale"),
                                             take(e, "vscale")},
                                 both = take(e, "uvscale");
  if (!parts[0] && !parts[1] && !parts[2] && !parts[3] && !both) return;
  const auto operation = [&](const char* tag, const Element* x, const Element* y, const char* fallback) {
    auto o = std::make_unique<Element>();
    o->tag = tag;
    o->location = e.location;
    o->attributes = {{"x", x ? x->get("value") : fallback}, {"y", y ? y->get("value") : fallback}};
    return o;
  };
  auto transform = std::make_unique<Element>();
  transform->tag = "transform";
  transform->location = e.location;
  transform->attributes.emplace_back("name", "to_uv");
  transform->children.push_back(operation("translate", parts[0].get(), parts[1].get(), "0"));
  const std::string fallback = both ? both->get("value") : "1";
  transform->children.push_back(operation("scale", parts[2].get(), parts[3].get(), fallback.c_str()));
  e.children.push_back(std::move(transform));
}

void upgrade_bitmap(Element& e, SceneReport& report) {
  if (Element* filter = e.child("filter_type")) {
    const std::string kind = filter->get("value");
    if (kind == "trilinear" || kind == "ewa") {
      report.assume(filter->location, "filter_type \"" + kind + "\" read as bilinear, as Mitsuba 3.9 has no mip maps");
      filter->set("value", "bilinear");
    }
  }
  const std::unique_ptr<Element> u = take(e, "wrap_mode_u"), v = take(e, "wrap_mode_v");
  if ((u || v) && !e.child("wrap_mode")) {
    if (u && v && u->get("value") != v->get("value"))
      report.assume(v->location, "wrap_mode_u read for both directions, as Mitsuba 3 has one");
    e.children.push_back(make_property("string", "wrap_mode", (u ? u : v)->get("value"), e));
  }
  if (Element* wrap = e.child("wrap_mode")) {
    const std::string kind = wrap->get("value");
    if (kind == "zero" || kind == "one") {
      report.assume(wrap->location, "wrap_mode \"" + kind + "\" read as clamp");
      wrap->set("value", "clamp");
    }
  }
  if (const std::unique_ptr<Element> gamma = take(e, "gamma")) {
    const double g = number_or(gamma.get(), -1.0);
    if (g == 1.0) {
      if (!e.child("raw")) e.children.push_back(make_property("boolean", "raw", "true", e));
    } else if (g > 0.0 && g != 2.2) {
      report.assume(gamma->location, "gamma " + gamma->get("value") + " of a bitmap read as sRGB");
    }
  }
  if (const Element* channel = e.child("channel")) {
    report.refuse(channel->location,
                  "\"channel\" of a bitmap: Mitsuba 3 has none, and alpha is not used; save the channel \"" +
                      channel->get("value") + "\" as a picture of its own");
    take(e, "channel");
  }
  for (const char* name : {"max_anisotropy", "cache"}) take(e, name);
}

// Films.

void upgrade_film(Element& e, SceneReport& report) {
  const std::string type = e.get("type");
  if (type == "ldrfilm" || type == "tiledhdrfilm" || type == "mfilm") {
    report.assume(e.location, "film \"" + type + "\" read as hdrfilm");
    e.set("type", "hdrfilm");
  }
  for (const char* name : {"gamma", "exposure", "tonemap_method", "key", "burn", "attach_log", "variable", "digits"})
    take(e, name);
}

// Shapes and emitters.

void upgrade_shape(Element& e, SceneReport& report) {
  for (const char* name : {"collapse", "load_materials"}) take(e, name);
  if (const std::unique_ptr<Element> srgb = take(e, "srgb"); srgb && srgb->get("value") == "false")
    report.assume(srgb->location, "srgb false is not used: colours of vertices are read as sRGB");
  if (e.get("type") == "obj" && !child_with_tag(e, "bsdf") && !child_with_tag(e, "ref") &&
      !child_with_tag(e, "emitter"))
    report.assume(e.location, "an obj without a bsdf is grey, as in Mitsuba 3: materials of .mtl files are not read");
  if (const std::unique_ptr<Element> angle = take(e, "max_smooth_angle"))
    report.assume(angle->location, "max_smooth_angle is not used, as in Mitsuba 3: normals are those of the file");
}

// Scattering models.

// Mean of a constant's channels, -1 for textures.
double mean_of(const Element& e) {
  if (e.tag != "rgb" && e.tag != "float" && e.tag != "spectrum") return -1.0;
  const auto numbers = parse_numbers(e.get("value"));
  if (!numbers || (numbers->size() != 1 && numbers->size() != 3)) return -1.0;
  double sum = 0.0;
  for (const double v : *numbers) sum += v;
  return sum / static_cast<double>(numbers->size());
}

// The constant divided by `by` (channels at most 1).
void divide(Element& e, double by) {
  const auto numbers = parse_numbers(e.get("value"));
  std::string text;
  for (const double v : *numbers) text += (text.empty() ? "" : ", ") + number_text(std::min(1.0, v / by));
  e.set("value", text);
}

// Diffuse and glossy reflectance that add up (phong, ward) as a blend of a diffuse surface and a rough mirror: each is
// divided by its share. A textured reflectance keeps its values, and its lobe is weakened by its share.
void upgrade_glossy(Element& e, const std::string& type, const std::vector<std::pair<std::string, std::string>>& alphas,
                    SceneReport& report) {
  std::unique_ptr<Element> diffuse = take(e, "diffuse_reflectance"), specular = take(e, "specular_reflectance");
  if (!diffuse) diffuse = make_property("float", "", "0.5", e);
  if (!specular) specular = make_property("float", "", "0.2", e);
  const double kd = mean_of(*diffuse), ks = mean_of(*specular);
  double share = ks >= 0.0 ? (kd >= 0.0 && kd + ks > 0.0 ? ks / (kd + ks) : ks) : 0.5;
  share = std::clamp(share, 0.0, 1.0);
  report.assume(e.location, "bsdf \"" + type +
                                "\" read as a blend of diffuse and roughconductor (beckmann) of the same reflectances" +
                                (kd < 0.0 ? ", the textured one weakened by the other's share" : ""));
  if (kd >= 0.0 && share < 1.0) divide(*diffuse, 1.0 - share);
  if (ks >= 0.0 && share > 0.0) divide(*specular, share);
  auto base = object("bsdf", "diffuse", e);
  diffuse->set("name", "reflectance");
  base->children.push_back(std::move(diffuse));
  auto gloss = object("bsdf", "roughconductor", e);
  specular->set("name", "specular_reflectance");
  gloss->children.push_back(make_property("string", "material", "none", e));
  gloss->children.push_back(make_property("string", "distribution", "beckmann", e));
  gloss->children.push_back(std::move(specular));
  for (const auto& [name, value] : alphas) {
    std::unique_ptr<Element> given = take(e, name);
    gloss->children.push_back(given ? std::move(given) : make_property("float", name, value, e));
  }
  e.set("type", "blendbsdf");
  e.children.clear();
  e.children.push_back(make_property("float", "weight", number_text(share), e));
  e.children.push_back(std::move(base));
  e.children.push_back(std::move(gloss));
}

// The lobe cos^n about the mirror direction is about as wide as a Blinn lobe of 4 n about the half vector, and that as
// Beckmann with alpha = sqrt(2 / (4 n + 2)) (Walter et al. 2007, "Microfacet Models for Refraction through Rough
// Surfaces").
void upgrade_phong(Element& e, SceneReport& report) {
  const std::unique_ptr<Element> exponent = take(e, "exponent");
  if (exponent && exponent->find("value") == nullptr)
    report.assume(exponent->location, "phong: a texture as exponent read as 30 everywhere");
  const double n = std::max(0.0, number_or(exponent.get(), 30.0));
  upgrade_glossy(e, "phong", {{"alpha", number_text(std::sqrt(2.0 / (4.0 * n + 2.0)))}}, report);
}

void upgrade_ward(Element& e, SceneReport& report) {
  take(e, "variant");
  const std::unique_ptr<Element> both = take(e, "alpha");
  const std::string alpha = both ? both->get("value") : "0.1";
  upgrade_glossy(e, "ward", {{"alpha_u", alpha}, {"alpha_v", alpha}}, report);
}

// Makes a bsdf stand for the one in it: takes its place, or is an opaque mask around it where it is a reference or has
// a name of its own.
void stand_for(Element& e, std::unique_ptr<Element> nested) {
  if (nested->tag == "bsdf" && !nested->find("id")) {
    e.set("type", nested->get("type"));
    std::vector<std::unique_ptr<Element>> inside = std::move(nested->children);
    e.children = std::move(inside);
    return;
  }
  e.children.clear();
  e.children.push_back(std::move(nested));
  e.children.push_back(make_property("float", "opacity", "1", e));
  e.set("type", "mask");
}

void upgrade_distribution(Element& e, SceneReport& report) {
  Element* distribution = e.child("distribution");
  if (!distribution) return;
  const std::string kind = distribution->get("value");
  if (kind == "phong" || kind == "as") {
    report.assume(distribution->location, "distribution \"" + kind + "\" read as beckmann");
    distribution->set("value", "beckmann");
  }
}

// A coat over a diffuse surface is plastic; over others Mitsuba 3 has none.
void upgrade_coating(Element& e, SceneReport& report) {
  const bool rough = e.get("type") == "roughcoating";
  Element* nested = nullptr;
  for (const auto& c : e.children) {
    if (c->tag == "bsdf" || c->tag == "ref") nested = c.get();
  }
  if (!nested) return;  // found missing when the object is read
  if (nested->tag == "bsdf" && nested->get("type") == "diffuse") {
    report.assume(e.location, std::string("a coat over diffuse read as ") + (rough ? "roughplastic" : "plastic"));
    for (const char* name : {"thickness", "sigma_a"}) take(e, name);
    std::unique_ptr<Element> reflectance = take(*nested, "reflectance");
    e.children.erase(
        std::find_if(e.children.begin(), e.children.end(), [&](const auto& c) { return c.get() == nested; }));
    if (reflectance) {
      reflectance->set("name", "diffuse_reflectance");
      e.children.push_back(std::move(reflectance));
    }
    if (!e.child("int_ior")) e.children.push_back(make_property("string", "int_ior", "bk7", e));
    e.set("type", rough ? "roughplastic" : "plastic");
    if (rough) upgrade_distribution(e, report);
    return;
  }
  report.assume(e.location, "the coat of bsdf \"" + e.get("type") + "\" left out: what is under it is read alone");
  for (auto& c : e.children) {
    if (c.get() == nested) return stand_for(e, std::move(c));
  }
}

void upgrade_mixture(Element& e, SceneReport& report) {
  const std::unique_ptr<Element> weights = take(e, "weights");
  const auto numbers = weights ? parse_numbers(weights->get("value")) : std::nullopt;
  const auto is_part = [](const std::unique_ptr<Element>& c) { return c->tag == "bsdf" || c->tag == "ref"; };
  const auto count = static_cast<std::size_t>(std::count_if(e.children.begin(), e.children.end(), is_part));
  // Nothing is moved before all is known to fit: where mistakes are listed, the element is read all the same.
  if (!numbers || numbers->size() != count || count == 0)
    return report.refuse(e.location, "bsdf \"mixturebsdf\" needs as many weights as it holds bsdfs");
  if (count > static_cast<std::size_t>(kMostBlended))  // they are nested in each other below
    return report.refuse(e.location, "bsdf \"mixturebsdf\" holds " + std::to_string(count) + " bsdfs; at most " +
                                         std::to_string(kMostBlended) + " are supported");
  std::vector<std::unique_ptr<Element>> parts;
  for (auto& c : e.children) {
    if (is_part(c)) parts.push_back(std::move(c));
  }
  double rest = 1.0;
  for (const double w : *numbers) rest -= w;
  std::vector<double> shares = *numbers;
  if (rest > 1e-6) {  // what no part reflects is absorbed
    auto black = object("bsdf", "diffuse", e);
    black->children.push_back(make_property("float", "reflectance", "0", e));
    parts.push_back(std::move(black));
    shares.push_back(rest);
  }
  report.assume(e.location, "bsdf \"mixturebsdf\" read as blendbsdf");
  std::unique_ptr<Element> sum = std::move(parts.back());
  double below = shares.back();
  for (std::size_t i = parts.size() - 1; i-- > 0;) {
    auto blend = object("bsdf", "blendbsdf", e);
    const double whole = below + shares[i];
    blend->children.push_back(make_property("float", "weight", number_text(whole > 0.0 ? below / whole : 0.0), e));
    blend->children.push_back(std::move(parts[i]));
    blend->children.push_back(std::move(sum));
    below = whole;
    sum = std::move(blend);
  }
  if (sum->tag == "ref" || parts.size() == 1) {  // one bsdf alone
    stand_for(e, std::move(sum));
    return;
  }
  e.set("type", "blendbsdf");
  e.children = std::move(sum->children);
}

void upgrade_difftrans(Element& e, SceneReport& report) {
  report.assume(e.location, "bsdf \"difftrans\" read as principledthin that only transmits diffusely");
  if (Element* transmittance = e.child("transmittance")) {
    transmittance->set("name", "base_color");
  } else {
    e.children.push_back(make_property("float", "base_color", "0.5", e));
  }
  e.children.push_back(make_property("float", "diff_trans", "2", e));
  e.children.push_back(make_property("float", "roughness", "1", e));
  e.set("type", "principledthin");
}

void upgrade_conductor(Element& e, SceneReport& report) {
  if (!e.child("material") && !e.child("eta") && !e.child("k"))
    report.assume(e.location, "a conductor without a material reflects everything, as in Mitsuba 3 (0.6 took copper)");
  if (const std::unique_ptr<Element> outside = take(e, "ext_eta")) {
    const std::string& text = outside->get("value");
    const double eta = number_or(outside.get(), text == "air" || text == "vacuum" ? 1.0 : -1.0);
    if (std::fabs(eta - 1.0) > 1e-3)
      report.assume(outside->location, "ext_eta " + text + " of a conductor read as 1, as Mitsuba 3 knows no other");
  }
}

// The texture of a bump map may be wrapped in one that scales it.
void upgrade_bumpmap(Element& e) {
  for (auto& c : e.children) {
    if (c->tag != "texture" || c->get("type") != "scale") continue;
    std::unique_ptr<Element> scale = take(*c, "scale");
    for (auto& inner : c->children) {
      if (inner->tag != "texture" && inner->tag != "ref") continue;
      std::unique_ptr<Element> texture = std::move(inner);
      c = std::move(texture);
      break;
    }
    if (scale) e.children.push_back(std::move(scale));
    return;
  }
}

// Mitsuba 0.6 found the texture of a normal map by its tag.
void upgrade_normalmap(Element& e) {
  for (auto& c : e.children) {
    if (c->tag != "texture" || !c->get("name").empty()) continue;
    c->set("name", "normalmap");
    return;
  }
}

// Words of a list, which Mitsuba 0.6 took in any case.
bool is_choice(const std::string& parameter) {
  static const std::set<std::string> names = {"filter_type", "wrap_mode",       "wrap_mode_u", "wrap_mode_v",
                                              "variant",     "distribution",    "fov_axis",    "pixel_format",
                                              "file_format", "component_format"};
  return names.count(parameter) > 0;
}

void upgrade_object(Element& e, SceneReport& report) {
  for (const auto& c : e.children) {
    for (auto& [attribute, value] : c->attributes) {
      if (attribute == "name") value = snake_case(value);
    }
    if (c->tag == "string" && is_choice(c->get("name"))) c->set("value", lower_case(c->get("value")));
  }
  const std::string type = e.get("type");
  if (e.tag == "texture") {
    upgrade_uv(e);
    if (type == "bitmap") upgrade_bitmap(e, report);
    if (type == "vertexcolors") {
      report.assume(e.location, "texture \"vertexcolors\" read as mesh_attribute \"vertex_color\", of colours in sRGB");
      e.children.clear();
      e.children.push_back(make_property("string", "name", "vertex_color", e));
      e.set("type", "mesh_attribute");
    }
  }
  if (e.tag == "film") upgrade_film(e, report);
  if (e.tag == "shape") upgrade_shape(e, report);
  if (e.tag == "emitter" && type == "envmap") {
    for (const char* name : {"gamma", "cache"}) take(e, name);
  }
  if (e.tag != "bsdf") return;
  using Rule = std::function<void(Element&, SceneReport&)>;
  static const std::map<std::string, Rule> rules = {
      {"diffuse",
       [](Element& d, SceneReport&) {
         if (Element* reflectance = d.child("diffuse_reflectance")) reflectance->set("name", "reflectance");
       }},
      {"phong", upgrade_phong},
      {"ward", upgrade_ward},
      {"coating", upgrade_coating},
      {"roughcoating", upgrade_coating},
      {"mixturebsdf", upgrade_mixture},
      {"mixture", upgrade_mixture},
      {"difftrans", upgrade_difftrans},
      {"conductor", upgrade_conductor},
      {"roughconductor",
       [](Element& c, SceneReport& r) {
         upgrade_conductor(c, r);
         upgrade_distribution(c, r);
       }},
      {"roughdielectric", upgrade_distribution},
      {"roughplastic", upgrade_distribution},
      {"blendbsdf",
       [](Element& b, SceneReport&) {
         if (!b.child("weight"))
           b.children.push_back(make_property("float", "weight", "0.5", b));  // as before version 3
       }},
      {"bumpmap", [](Element& b, SceneReport&) { upgrade_bumpmap(b); }},
      {"normalmap", [](Element& n, SceneReport&) { upgrade_normalmap(n); }},
  };
  if (const auto rule = rules.find(type); rule != rules.end()) rule->second(e, report);
}

}  // namespace

std::string snake_case(const std::string& name) {
  std::string out;
  for (std::size_t i = 0; i < name.size(); ++i) {
    if (i > 0 && is_lower(name[i - 1]) && is_upper(name[i])) {
      out += '_';
      for (; i < name.size() && is_upper(name[i]); ++i) out += static_cast<char>(name[i] - 'A' + 'a');
      --i;
    } else {
      out += name[i];
    }
  }
  return out;
}

void upgrade_element(Element& element, SceneReport& report) {
  if (element.tag == "rgb" || element.tag == "srgb" || element.tag == "spectrum") drop_attribute(element, "intent");
  if (element.tag == "srgb") return upgrade_srgb(element);
  if (element.tag == "blackbody") return upgrade_blackbody(element);
  if (element.tag == "spectrum") return upgrade_spectrum(element, report);
  if (element.find("type") || element.tag == "scene") upgrade_object(element, report);
}

void downgrade_element(Element& element, SceneReport& report) {
  if (element.tag == "rfilter" && element.get("type") == "box") {  // Mitsuba 2
    const Element* radius = element.child("radius");
    if (radius && number_or(radius, 0.0) == 0.5) take(element, "radius");
  }
  if (element.tag == "emitter" && element.get("type") == "smootharea") {
    report.assume(element.location, "emitter \"smootharea\" read as area: its edges do not fade");
    take(element, "blur_size");
    element.set("type", "area");
  }
  if (element.tag == "texture" && element.get("type") == "bitmap") {
    if (const Element* c = element.child("max_anisotropy"); c && c->tag == "integer") take(element, "max_anisotropy");
    Element* filter = element.child("filter_type");
    if (!filter) return;
    const std::string kind = filter->get("value");
    if (kind != "trilinear" && kind != "anisotropic") return;
    report.assume(filter->location, "filter_type \"" + kind + "\" read as bilinear: samples of a pixel blur instead");
    filter->set("value", "bilinear");
  } else if (element.tag == "sensor") {
    if (const Element* c = element.child("cone_scale"); c && c->tag == "float") take(element, "cone_scale");
    const Element* c = element.child("jitter");
    if (!c || c->tag != "boolean" || (c->get("value") != "true" && c->get("value") != "false")) return;
    const std::unique_ptr<Element> jitter = take(element, "jitter");
    if (jitter->get("value") == "false")
      report.assume(jitter->location, "jitter false: samples are spread over a pixel all the same");
  }
}

}  // namespace octrad
