// Files of measured materials (`.bsdf` of the RGL database), as `measured` of scene files names them.
#pragma once

#include <string>
#include <vector>

#include "octrad/scene/measured_tables.h"

namespace octrad {

struct MeasuredMaterial {
  MeasuredLayout layout;
  std::vector<float> data;
};

// Reads the content of a tensor file of version 1.0 with the colours of RGB variants (names end in `_rgb.bsdf`), or
// with spectra (`_spec.bsdf`). Throws InputError with the name, and MemoryError.
MeasuredMaterial parse_measured(const std::string& name, const std::string& bytes);
MeasuredMaterial read_measured_file(const std::string& file);

}  // namespace octrad
