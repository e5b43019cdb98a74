// Processor model, cores and vector extensions.
#pragma once

#include <string>
#include <vector>

namespace octrad {

struct CpuInfo {
  std::string model;                  // as the system names it
  int logical_cores = 0;              // that this process may run on
  std::vector<std::string> features;  // vector extensions present, oldest first: "sse4.2", "avx2", "avx512f" ...
  std::string level;                  // widest complete set: "SSE2", "SSE4", "AVX2", "AVX-512" (Highway's groups)
};

CpuInfo cpu_info();

}  // namespace octrad
