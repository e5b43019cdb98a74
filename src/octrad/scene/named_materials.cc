#include "octrad/scene/named_materials.h"

#include <utility>

#include "octrad/base/lower_case.h"

namespace octrad {
namespace {

// Sodium D line; gases at 0 C and 1 atm, liquids at 20 C, as listed in the manual of Mitsuba 3 (dielectric).
const std::pair<const char*, float> kIors[] = {
    {"vacuum", 1.0f},      {"helium", 1.000036f},        {"hydrogen", 1.000132f},
    {"air", 1.000277f},    {"carbon dioxide", 1.00045f}, {"water", 1.333f},
    {"acetone", 1.36f},    {"ethanol", 1.361f},          {"carbon tetrachloride", 1.461f},
    {"glycerol", 1.4729f}, {"benzene", 1.501f},          {"silicone oil", 1.52045f},
    {"bromine", 1.661f},   {"water ice", 1.31f},         {"fused quartz", 1.458f},
    {"pyrex", 1.47f},      {"acrylic glass", 1.49f},     {"polypropylene", 1.49f},
    {"bk7", 1.5046f},      {"sodium chloride", 1.544f},  {"amber", 1.55f},
    {"pet", 1.575f},       {"diamond", 2.419f},
};

struct NamedConductor {
  const char* name;
  Vec3f eta, k;
};

// Measured spectra (Palik's handbook, SOPRA) averaged to linear RGB. The averages are those that Mitsuba 3.9.1's RGB
// variants report for their named materials, read back from it to six digits, so that pictures agree.
const NamedConductor kConductors[] = {
    {"none", {0.0f, 0.0f, 0.0f}, {1.0f, 1.0f, 1.0f}},
    {"Ag", {0.155276f, 0.116728f, 0.138388f}, {4.828354f, 3.122222f, 2.146901f}},
    {"Al", {1.657501f, 0.880405f, 0.521244f}, {9.223811f, 6.269502f, 4.837004f}},
    {"AlAs", {3.605296f, 3.232938f, 2.216319f}, {0.000679f, 0.0f, 0.007513f}},
    {"AlSb", {0.0f, 4.139375f, 4.669254f}, {0.0f, 0.094009f, 1.30057f}},
    {"Au", {0.143036f, 0.375307f, 1.442045f}, {3.982997f, 2.385556f, 1.603359f}},
    {"Be", {4.185012f, 3.185029f, 2.784061f}, {3.835466f, 3.010122f, 2.868994f}},
    {"Cr", {4.369668f, 2.916505f, 1.654905f}, {5.206547f, 4.231306f, 3.754699f}},
    {"CsI", {2.1449f, 1.702319f, 1.662427f}, {0.0f, 0.0f, 0.0f}},
    {"Cu", {0.201005f, 0.92375f, 1.102215f}, {3.913262f, 2.453045f, 2.14209f}},
    {"Cu2O", {3.551773f, 2.94987f, 2.751875f}, {0.114207f, 0.193897f, 0.606134f}},
    {"CuO", {3.247541f, 2.447805f, 2.21022f}, {0.52109f, 0.570031f, 0.722179f}},
    {"Cu_palik", {0.213229f, 0.919715f, 1.102411f}, {3.921873f, 2.457332f, 2.136584f}},
    {"Hg", {2.398939f, 1.440028f, 0.90957f}, {6.327587f, 4.371925f, 3.421764f}},
    {"HgTe", {4.77904f, 3.231196f, 2.659901f}, {1.631613f, 1.58081f, 1.729287f}},
    {"Ir", {3.0863f, 2.082191f, 1.617915f}, {5.592153f, 4.067088f, 3.267312f}},
    {"K", {0.064043f, 0.04641f, 0.038185f}, {2.1042f, 1.34894f, 0.913126f}},
    {"Li", {0.265791f, 0.195618f, 0.220949f}, {3.540155f, 2.311123f, 1.668607f}},
    {"MgO", {2.089584f, 1.650723f, 1.594879f}, {0.0f, 0.0f, 0.0f}},
    {"Mo", {4.483974f, 3.525131f, 2.77631f}, {4.111437f, 3.420827f, 3.150607f}},
    {"Na_palik", {0.060269f, 0.056141f, 0.061988f}, {3.179273f, 2.11249f, 1.579041f}},
    {"Nb", {3.420074f, 2.790093f, 2.395629f}, {3.441395f, 2.737666f, 2.579746f}},
    {"Ni_palik", {2.367305f, 1.663373f, 1.467078f}, {4.498812f, 3.050153f, 2.345439f}},
    {"Rh", {2.585793f, 1.860216f, 1.554263f}, {6.78226f, 4.702987f, 3.976073f}},
    {"Se", {4.058311f, 2.842935f, 2.820853f}, {0.75405f, 0.638444f, 0.521808f}},
    {"Se-e", {5.722849f, 4.165736f, 4.081338f}, {0.871136f, 1.105157f, 1.56532f}},
    {"SiC", {3.172342f, 2.525972f, 2.479371f}, {1e-06f, 0.0f, 1e-05f}},
    {"SnTe", {4.52425f, 1.981645f, 1.281591f}, {0.0f, 0.0f, 0.0f}},
    {"Ta", {2.062721f, 2.392939f, 2.627929f}, {2.40836f, 1.741486f, 1.947028f}},
    {"Te", {7.390234f, 4.482105f, 2.637106f}, {3.256022f, 3.527059f, 3.292054f}},
    {"Te-e", {7.508907f, 4.296429f, 2.369988f}, {5.583929f, 4.947205f, 3.997592f}},
    {"ThF4", {1.830714f, 1.442229f, 1.387648f}, {0.0f, 0.0f, 0.0f}},
    {"TiC", {3.700528f, 2.837422f, 2.582287f}, {3.265635f, 2.351589f, 2.172791f}},
    {"TiN", {1.64845f, 1.150516f, 1.379823f}, {3.368328f, 1.943498f, 1.102068f}},
    {"TiO2", {3.45661f, 2.801736f, 2.905175f}, {0.000105f, 0.0f, 0.000653f}},
    {"TiO2-e", {3.106565f, 2.513168f, 2.582444f}, {3e-05f, 0.0f, 0.000183f}},
    {"VC", {3.657566f, 2.752736f, 2.532672f}, {3.068301f, 2.198687f, 1.963193f}},
    {"VN", {2.865602f, 2.119189f, 1.940091f}, {3.032243f, 2.056116f, 1.616306f}},
    {"V_palik", {4.277582f, 3.512949f, 2.761071f}, {3.491301f, 2.889455f, 3.111522f}},
    {"W", {4.370817f, 3.300246f, 2.998407f}, {3.500641f, 2.604874f, 2.273233f}},
    {"a-C", {2.944046f, 2.227136f, 1.968162f}, {0.887465f, 0.799299f, 0.81529f}},
    {"d-C", {2.70872f, 2.318826f, 2.228898f}, {0.0f, 0.0f, 0.0f}},
};

}  // namespace

std::optional<float> named_ior(const std::string& name) {
  const std::string wanted = lower_case(name);
  for (const auto& [key, value] : kIors) {
    if (wanted == key) return value;
  }
  return std::nullopt;
}

std::vector<std::string> ior_names() {
  std::vector<std::string> names;
  for (const auto& [key, value] : kIors) names.emplace_back(key);
  return names;
}

std::optional<ConductorIor> named_conductor(const std::string& name) {
  // A few materials are listed from two sources; where both agree, one entry serves "X" and "X_palik".
  const std::string suffix = "_palik";
  const bool palik =
      name.size() > suffix.size() && name.compare(name.size() - suffix.size(), suffix.size(), suffix) == 0;
  const std::string other = palik ? name.substr(0, name.size() - suffix.size()) : name + suffix;
  for (const std::string& wanted : {name, other}) {
    for (const NamedConductor& entry : kConductors) {
      if (wanted == entry.name) return ConductorIor{entry.eta, entry.k};
    }
  }
  return std::nullopt;
}

std::vector<std::string> conductor_names() {
  std::vector<std::string> names;
  for (const NamedConductor& entry : kConductors) names.emplace_back(entry.name);
  return names;
}

}  // namespace octrad
