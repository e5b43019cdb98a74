// A measured material that nobody measured, for tests and checks of devices.
#pragma once

#include <string>

namespace octrad::testing {

// Content of a file: microfacets of GGX with a reflectance that changes over the table. `part` 0: isotropic, of alpha
// .5; 1, 2, 4: alphas .25 and .6, with directions of the whole circle, half or a quarter of it; 8: isotropic with two
// directions of the viewer's phi, and reflectances that are not multiplied by what microfacets give.
// tests/cli/measured_file.py makes the same. `spectra`: with spectra at 400, 500, 600 and 700 nm instead of colours,
// .2, .4, .8 and .6 times the luminance.
std::string measured_sample_file(int part, bool spectra = false);

}  // namespace octrad::testing
