// A measured material that nobody measured, for tests and checks of devices.
#pragma once

#include <string>

namespace octrad::testing {

// Content of a file: microfacets of GGX with a reflectance that changes over the table. `part` 0: isotropic, of alpha
// .5; 1, 2, 4: alphas .25 and .6, with directions of the whole circle, half or a quarter of it.
// tests/cli/measured_file.py makes the same.
std::string sample_measured(int part);

}  // namespace octrad::testing
