#include "octrad/base/cpu_info.h"

#include <sched.h>

#include <fstream>

namespace octrad {

CpuInfo cpu_info() {
  CpuInfo info;
  std::ifstream in("/proc/cpuinfo");
  for (std::string line; std::getline(in, line);) {
    if (line.compare(0, 10, "model name") == 0 || line.compare(0, 8, "Hardware") == 0) {
      const std::size_t colon = line.find(": ");
      if (colon != std::string::npos) info.model = line.substr(colon + 2);
      break;
    }
  }
  cpu_set_t set;
  CPU_ZERO(&set);
  if (sched_getaffinity(0, sizeof(set), &set) == 0) info.logical_cores = CPU_COUNT(&set);
#if defined(__x86_64__)
  __builtin_cpu_init();
  // __builtin_cpu_supports takes literals only.
#define OCTRAD_FEATURE(name) \
  if (__builtin_cpu_supports(name)) info.features.emplace_back(name);
  OCTRAD_FEATURE("sse2")
  OCTRAD_FEATURE("ssse3")
  OCTRAD_FEATURE("sse4.1")
  OCTRAD_FEATURE("sse4.2")
  OCTRAD_FEATURE("avx")
  OCTRAD_FEATURE("avx2")
  OCTRAD_FEATURE("fma")
  OCTRAD_FEATURE("avx512f")
  OCTRAD_FEATURE("avx512cd")
  OCTRAD_FEATURE("avx512dq")
  OCTRAD_FEATURE("avx512bw")
  OCTRAD_FEATURE("avx512vl")
#undef OCTRAD_FEATURE
  const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  const bool avx512 = avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512cd") &&
                      __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw") &&
                      __builtin_cpu_supports("avx512vl");
  info.level = avx512 ? "AVX-512" : avx2 ? "AVX2" : __builtin_cpu_supports("sse4.2") ? "SSE4" : "SSE2";
#else
  info.level = "scalar";
#endif
  return info;
}

}  // namespace octrad
