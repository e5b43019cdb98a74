// Spectra over wavelengths, and the linear RGB that Mitsuba 3's RGB variants make of them.
#pragma once

#include <string>
#include <vector>

#include "octrad/base/vec.h"
#include "octrad/scene/source.h"

namespace octrad {

// Values at increasing wavelengths in nanometres: linear between them, zero outside.
struct Spectrum {
  std::vector<double> wavelengths, values;
};

// What a spectrum says, which decides how it becomes a colour.
enum class SpectrumUse {
  emission,     // as it is: a spectrum of ones has luminance 1, and a colour that is not quite white
  reflectance,  // under the standard illuminant D65, so that ones are white; clamped to [0, 1]
  index,        // of refraction or absorption: the same, not clamped above
};

// Linear Rec. 709 RGB: integral with the CIE 1931 2 degree colour matching functions from 360 to 830 nm, in Mitsuba's
// 1000 steps (core/spectrum.cpp: spectrum_list_to_srgb). Negative channels become 0. `clamped`, where not null, is set
// when a channel was out of range.
Vec3f spectrum_rgb(const Spectrum& spectrum, SpectrumUse use, bool* clamped = nullptr);
// What each value of a spectrum at these wavelengths, at least two that increase, adds to its colour under D65: their
// sum, before anything is clamped, is that of spectrum_rgb().
std::vector<Vec3d> rgb_weights(const std::vector<double>& wavelengths);
// spectrum_rgb() of a spectrum of ones, which emits.
Vec3f equal_energy_rgb();

// "400:0.1, 500:0.2 ...". The mistakes of the text are at `where`.
Spectrum parse_spectrum(const std::string& text, const Location& where);
// A text file with a wavelength and a value in each line; lines that begin with # are comments.
Spectrum read_spectrum(const std::string& file);
// Wavelengths must increase; at least two.
Spectrum make_spectrum(std::vector<double> wavelengths, std::vector<double> values, const Location& where);
// With the values at its ends held for all wavelengths that are seen.
Spectrum held_at_ends(Spectrum spectrum);
// Radiance of a black body at `kelvin` by Planck's law, in W m^-2 sr^-1 nm^-1: at a wavelength in nm, and as a
// spectrum.
double blackbody_radiance(double nm, double kelvin);
Spectrum blackbody_spectrum(double kelvin);
// Linear Rec. 709 RGB of CIE XYZ.
Vec3d rgb_of_xyz(Vec3d xyz);

}  // namespace octrad
