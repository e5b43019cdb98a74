// Constants of scene files as linear RGB: numbers, colours, spectra.
#include <algorithm>

#include "octrad/base/join.h"
#include "octrad/base/number_text.h"
#include "octrad/scene/builder.h"
#include "octrad/scene/plugins.h"
#include "octrad/scene/spectrum.h"
#include "octrad/scene/texture_roles.h"

namespace octrad {
namespace {

SpectrumUse use_of(TextureRole role) {
  switch (role) {
    case TextureRole::radiance: return SpectrumUse::emission;
    case TextureRole::index:
    case TextureRole::absorption: return SpectrumUse::index;
    default: return SpectrumUse::reflectance;
  }
}

std::vector<double> number_list(Params& params, const std::string& name) {
  const Location where = params.where(name);
  const auto numbers = parse_numbers(params.required_string(name));
  if (!numbers) fail(where, "\"" + name + "\" of " + params.what() + " is no list of finite numbers");
  return *numbers;
}

// Wavelengths from one end to the other, in nanometres.
std::pair<double, double> wavelength_range(Params& params) {
  const std::string range = params.get_string("range", "");
  if (!range.empty()) {
    const auto ends = parse_numbers(range);
    if (!ends || ends->size() != 2)
      fail(params.where("range"), "\"" + range + "\" is no range of wavelengths: two numbers");
    return {(*ends)[0], (*ends)[1]};
  }
  // Mitsuba 2 said lambda_min and lambda_max.
  const double low = static_cast<double>(params.get_float("lambda_min", 360.0f));
  const double high = static_cast<double>(params.get_float("lambda_max", 830.0f));
  return {static_cast<double>(params.get_float("wavelength_min", static_cast<float>(low))),
          static_cast<double>(params.get_float("wavelength_max", static_cast<float>(high)))};
}

Spectrum regular_spectrum(Params& params) {
  const auto [low, high] = wavelength_range(params);
  std::vector<double> values = number_list(params, "values"), wavelengths;
  for (std::size_t i = 0; i < values.size(); ++i)
    wavelengths.push_back(low + (high - low) * static_cast<double>(i) /
                                    static_cast<double>(std::max<std::size_t>(values.size() - 1, 1)));
  return make_spectrum(std::move(wavelengths), std::move(values), params.location());
}

bool is_spectrum(const Element& element) {
  static const std::vector<std::string> types = spectrum_types();
  const std::string* type = element.find("type");
  if (element.tag == "spectrum") return true;
  return element.tag == "texture" && type && std::find(types.begin(), types.end(), *type) != types.end();
}

Vec3f one_number(const Element& element) {
  const auto numbers = parse_numbers(element.get("value"));
  if (!numbers || numbers->size() != 1)
    fail(element.location, "<" + element.tag + ">: \"" + element.get("value") + "\" is not one number");
  return Vec3f(static_cast<float>((*numbers)[0]));
}

}  // namespace

Vec3f SceneBuilder::rgb_of(const Spectrum& spectrum, TextureRole role, const Location& where) {
  bool clamped = false;
  const Vec3f value = spectrum_rgb(spectrum, use_of(role), &clamped);
  if (clamped) report().assume(where, "a spectrum whose colour RGB cannot hold was clamped, as in Mitsuba");
  return value;
}

// What stands in <spectrum>; those with a type may also be written as textures.
Vec3f SceneBuilder::spectrum_value(const Element& element, TextureRole role) {
  if (!element.find("type")) {
    check_attributes(element, {"name", "value", "filename"});
    if (const std::string* file = element.find("filename")) {
      if (element.find("value")) fail(element.location, "<spectrum> takes either a value or a filename");
      const std::pair key{description_.resolve(*file, element.location), use_of(role)};
      const auto known = spectrum_files_.find(key);
      if (known != spectrum_files_.end()) return known->second;
      return spectrum_files_[key] = rgb_of(read_spectrum(key.first), role, element.location);
    }
    const std::string& text = element.get("value");
    if (text.find(':') != std::string::npos)
      return rgb_of(parse_spectrum(text, element.location), role, element.location);
    return one_number(element) * (role == TextureRole::radiance ? equal_energy_rgb() : Vec3f(1.0f));
  }
  Params params(description_, element, scene_.warnings);
  const std::string& type = params.type();
  Vec3f value(0.0f);
  if (type == "uniform") {
    value = Vec3f(params.get_float("value", 1.0f));
    params.ignore({"wavelength_min", "wavelength_max"});
  } else if (type == "d65") {  // the white of linear sRGB
    const Element* color = params.find("color");
    value = (color ? parse_rgb(*color) : Vec3f(1.0f)) * params.get_float("scale", 1.0f);
  } else if (type == "srgb") {
    const Element* color = params.find("color");
    if (!color) fail(element.location, params.what() + " needs the parameter <rgb name=\"color\" value=\"...\"/>");
    value = parse_rgb(*color);
    params.ignore({"unbounded"});
  } else if (type == "rawconstant") {
    const Element* given = params.find("value");
    if (!given) fail(element.location, params.what() + " needs the parameter \"value\"");
    value = given->tag == "float" ? one_number(*given) : Vec3f(parse_vector(*given, Vec3d(0.0), {"name"}));
  } else if (type == "regular") {
    value = rgb_of(regular_spectrum(params), role, element.location);
  } else if (type == "irregular") {
    std::vector<double> wavelengths = number_list(params, "wavelengths");
    value = rgb_of(make_spectrum(std::move(wavelengths), number_list(params, "values"), element.location), role,
                   element.location);
  } else if (type == "blackbody") {
    if (role != TextureRole::radiance) fail(element.location, "a blackbody spectrum is one of emitters only");
    const float kelvin = params.float_in("temperature", 5000.0f, 1.0f, 1e6f);
    const Spectrum s = blackbody_spectrum(static_cast<double>(kelvin));
    value = rgb_of(s, role, element.location) * params.get_float("scale", 1.0f);
  } else {
    params.fail_type(spectrum_types(), "", "; or give its values: <spectrum value=\"400:..., 500:...\"/>");
  }
  params.finish();
  return value;
}

std::optional<Vec3f> SceneBuilder::constant_value(const Element& element, TextureRole role) {
  std::optional<Vec3f> value;
  if (element.tag == "rgb") {
    value = parse_rgb(element);
  } else if (element.tag == "float" || element.tag == "integer") {
    value = one_number(element);
  } else if (is_spectrum(element)) {
    const std::pair key{&element, use_of(role)};
    const auto known = spectra_.find(key);
    value = known != spectra_.end() ? known->second : spectra_[key] = spectrum_value(element, role);
  }
  if (!value) return std::nullopt;
  const Range range = range_of(role);
  if (element.old && role == TextureRole::reflectance && value->x >= 0.0f && value->y >= 0.0f && value->z >= 0.0f &&
      (value->x > 1.0f || value->y > 1.0f || value->z > 1.0f)) {
    report().assume(element.location, "a reflectance above 1 is read as 1 (Mitsuba 0.6 scaled it down)");
    *value = {std::min(value->x, 1.0f), std::min(value->y, 1.0f), std::min(value->z, 1.0f)};
  }
  constexpr float kRounding = 1e-3f;  // of what exporters computed
  for (int c = 0; c < 3 && range.high <= 1.0f; ++c) {
    if (range.holds((*value)[c], kRounding)) (*value)[c] = std::clamp((*value)[c], range.low, range.high);
  }
  if (!range.holds(value->x) || !range.holds(value->y) || !range.holds(value->z)) {
    const std::string* text = element.find("value");
    fail(element.location,
         range.text + std::string(", not ") +
             (text ? *text : number_text(value->x) + ", " + number_text(value->y) + ", " + number_text(value->z)));
  }
  if (description_.understood &&
      description_.understood->constants.try_emplace(&element, *value).first->second != *value)
    fail(
        element.location,
        "the spectrum is used as a light and as a colour of surfaces, which become two RGB colours: write it once for each");
  return value;
}

}  // namespace octrad
