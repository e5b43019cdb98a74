#include "octrad/scene/spectrum.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "octrad/base/input_file.h"
#include "octrad/base/memory_limit.h"
#include "octrad/scene/cie_tables.h"
#include "octrad/scene/params.h"
#include "octrad/scene/plugins.h"

namespace octrad {
namespace {

constexpr double kFirst = 360.0, kLast = 830.0;  // nanometres

// Linear interpolation in a table of every 5 nm.
double table_at(const float* table, double wavelength) {
  const double t = (wavelength - kFirst) / 5.0;
  const int i = std::clamp(static_cast<int>(t), 0, kCieSamples - 2);
  const double w = t - i;
  return (1.0 - w) * static_cast<double>(table[i]) + w * static_cast<double>(table[i + 1]);
}

// Which two samples a wavelength lies between: the first, and how much of the second. nullopt outside.
std::optional<std::pair<std::size_t, double>> place_in(const std::vector<double>& wavelengths, double wavelength) {
  if (wavelength < wavelengths.front() || wavelength > wavelengths.back()) return std::nullopt;
  const auto above = std::upper_bound(wavelengths.begin(), wavelengths.end(), wavelength);
  const auto i = static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(
      above - wavelengths.begin() - 1, 0, static_cast<std::ptrdiff_t>(wavelengths.size()) - 2));
  return std::pair(i, (wavelength - wavelengths[i]) / (wavelengths[i + 1] - wavelengths[i]));
}

constexpr int kSteps = 1000;
constexpr double kStep = (kLast - kFirst) / kSteps * kCieNormalization;

// step(wavelength, X, Y and Z there, what lights there) at each step of an integral.
template <typename Step>
void integrate(bool d65, Step step) {
  for (int i = 0; i < kSteps; ++i) {
    const double wavelength = kFirst + i * (kLast - kFirst) / (kSteps - 1);
    step(wavelength, Vec3d(table_at(kCieX, wavelength), table_at(kCieY, wavelength), table_at(kCieZ, wavelength)),
         d65 ? table_at(kD65, wavelength) * kD65Normalization : 1.0);
  }
}

Vec3d rgb_of(const Spectrum& s, bool d65) {
  Vec3d sum(0.0);
  integrate(d65, [&](double wavelength, Vec3d xyz, double light) {
    const auto at = place_in(s.wavelengths, wavelength);
    if (at) sum += xyz * (((1.0 - at->second) * s.values[at->first] + at->second * s.values[at->first + 1]) * light);
  });
  return rgb_of_xyz(sum * kStep);
}

}  // namespace

// The digits that Mitsuba has.
Vec3d rgb_of_xyz(Vec3d xyz) {
  return {3.240479 * xyz.x - 1.537150 * xyz.y - 0.498535 * xyz.z,
          -0.969256 * xyz.x + 1.875991 * xyz.y + 0.041556 * xyz.z,
          0.055648 * xyz.x - 0.204043 * xyz.y + 1.057311 * xyz.z};
}

std::vector<std::string> spectrum_types() {
  return {"uniform", "d65", "srgb", "rawconstant", "regular", "irregular", "blackbody"};
}

Vec3f spectrum_rgb(const Spectrum& spectrum, SpectrumUse use, bool* clamped) {
  const Vec3d rgb = rgb_of(spectrum, use != SpectrumUse::emission);
  Vec3f out;
  for (int c = 0; c < 3; ++c) {
    double v = std::max(rgb[c], 0.0);
    if (use == SpectrumUse::reflectance) v = std::min(v, 1.0);
    if (clamped != nullptr && v != rgb[c]) *clamped = true;
    out[c] = static_cast<float>(v);
  }
  return out;
}

std::vector<Vec3d> rgb_weights(const std::vector<double>& wavelengths) {
  std::vector<Vec3d> weights(wavelengths.size(), Vec3d(0.0));
  integrate(true, [&](double wavelength, Vec3d xyz, double light) {
    const auto at = place_in(wavelengths, wavelength);
    if (!at) return;
    weights[at->first] += xyz * ((1.0 - at->second) * light);
    weights[at->first + 1] += xyz * (at->second * light);
  });
  for (Vec3d& w : weights) w = rgb_of_xyz(w * kStep);
  return weights;
}

// XYZ (1, 1, 1).
Vec3f equal_energy_rgb() { return {1.204793f, 0.948290f, 0.908917f}; }

Spectrum make_spectrum(std::vector<double> wavelengths, std::vector<double> values, const Location& where) {
  if (wavelengths.size() != values.size())
    fail(where, "a spectrum needs as many values as wavelengths, not " + std::to_string(values.size()) + " and " +
                    std::to_string(wavelengths.size()));
  if (wavelengths.size() < 2) fail(where, "a spectrum needs at least two wavelengths");
  for (std::size_t i = 1; i < wavelengths.size(); ++i) {
    if (!(wavelengths[i] > wavelengths[i - 1])) fail(where, "the wavelengths of a spectrum must increase");
  }
  return {std::move(wavelengths), std::move(values)};
}

Spectrum held_at_ends(Spectrum s) {
  if (s.wavelengths.front() > kFirst) {
    s.wavelengths.insert(s.wavelengths.begin(), kFirst);
    s.values.insert(s.values.begin(), s.values.front());
  }
  if (s.wavelengths.back() < kLast) {
    s.wavelengths.push_back(kLast);
    s.values.push_back(s.values.back());
  }
  return s;
}

Spectrum parse_spectrum(const std::string& text, const Location& where) {
  std::string pairs = text;
  std::size_t colons = 0;
  for (char& c : pairs) {
    if (c != ':') continue;
    c = ' ';
    ++colons;
  }
  const auto numbers = parse_numbers(pairs);
  if (!numbers || numbers->size() != 2 * colons)
    fail(where,
         "\"" + text + "\" is no spectrum: a number, or pairs \"wavelength:value\" with commas or spaces between");
  std::vector<double> wavelengths, values;
  for (std::size_t i = 0; i < numbers->size(); i += 2) {
    wavelengths.push_back((*numbers)[i]);
    values.push_back((*numbers)[i + 1]);
  }
  return make_spectrum(std::move(wavelengths), std::move(values), where);
}

Spectrum read_spectrum(const std::string& file) {
  const MemoryScope scope;
  const std::string text = read_file(file);
  ask_memory(text.size() * sizeof(double), file);  // a line of two numbers has at least four bytes
  const auto source = std::make_shared<const SourceFile>(file, text);
  std::vector<double> wavelengths, values;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const std::string line = text.substr(begin, end - begin);
    const std::size_t first = line.find_first_not_of(" \t\r");
    if (first != std::string::npos && line[first] != '#') {
      const auto numbers = parse_numbers(line);  // further columns are skipped, as in Mitsuba
      if (!numbers || numbers->size() < 2) fail({source, begin}, "expected a wavelength and a value");
      wavelengths.push_back((*numbers)[0]);
      values.push_back((*numbers)[1]);
    }
    begin = end + 1;
  }
  return make_spectrum(std::move(wavelengths), std::move(values), {source, 0});
}

double blackbody_radiance(double nm, double kelvin) {
  // CODATA 2014, as Mitsuba: speed of light, Planck's and Boltzmann's constants.
  constexpr double c = 2.99792458e8, h = 6.62607004e-34, k = 1.38064852e-23;
  const double lambda = nm * 1e-9;
  return 1e-9 * 2.0 * h * c * c / (std::pow(lambda, 5.0) * std::expm1(h * c / (k * lambda * kelvin)));
}

Spectrum blackbody_spectrum(double kelvin) {
  Spectrum s;
  for (double nm = kFirst; nm <= kLast; nm += 1.0) {
    s.wavelengths.push_back(nm);
    s.values.push_back(blackbody_radiance(nm, kelvin));
  }
  return s;
}

}  // namespace octrad
