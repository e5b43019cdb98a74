#include "app/selftest/memory_device.h"

#include "octrad/base/rng.h"
#include "octrad/device/launch.h"

namespace octrad::selftest {
namespace {

// Where access k of item i goes: cheap, and without a pattern that caches could use.
OCTRAD_HD inline std::uint32_t place(std::uint32_t i, int k, std::uint32_t mask) {
  return static_cast<std::uint32_t>(mix64((static_cast<std::uint64_t>(i) << 3) + static_cast<std::uint64_t>(k) + 1)) &
         mask;
}

struct SectorReads : Kernel {
  const Sector* table;
  std::uint32_t mask;
  float* out;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    Sector sectors[kAccesses];
    for (int k = 0; k < kAccesses; ++k) sectors[k] = table[place(i, k, mask)];
    float sum = 0.0f;
    for (int k = 0; k < kAccesses; ++k) {
      for (int j = 0; j < 8; ++j) sum += sectors[k].values[j];
    }
    out[i] = sum;
  }
};

struct Gathers : Kernel {
  const float* table;
  std::uint32_t mask;
  float* out;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    float sum = 0.0f;
    for (int k = 0; k < kAccesses; ++k) sum += table[place(i, k, mask)];
    out[i] = sum;
  }
};

struct Scatter : Kernel {
  float* table;
  std::uint32_t mask;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    for (int k = 0; k < kAccesses; ++k) atomic_add(table + place(i, k, mask), 1.0f);
  }
};

// One reduction of 16 bytes where the GPU has it (compute capability 9.0), else four.
OCTRAD_HD inline void add_four(float* at) {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
  atomicAdd(reinterpret_cast<float4*>(at), make_float4(1.0f, 1.0f, 1.0f, 1.0f));
#else
  for (int j = 0; j < 4; ++j) atomic_add(at + j, 1.0f);
#endif
}

struct Scatter4 : Kernel {
  float* table;
  std::uint32_t mask;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    for (int k = 0; k < kAccesses; ++k) add_four(table + 4 * static_cast<std::size_t>(place(i, k, mask)));
  }
};

struct Nothing : Kernel {
  OCTRAD_HD void operator()(std::uint32_t) const {}
};

}  // namespace

void run_sector_reads(Stream& stream, std::size_t n, const Sector* table, std::uint32_t mask, float* out) {
  launch(stream, n, SectorReads{{}, table, mask, out});
}

void run_gathers(Stream& stream, std::size_t n, const float* table, std::uint32_t mask, float* out) {
  launch(stream, n, Gathers{{}, table, mask, out});
}

void run_scatter(Stream& stream, std::size_t n, float* table, std::uint32_t mask) {
  launch(stream, n, Scatter{{}, table, mask});
}

void run_scatter4(Stream& stream, std::size_t n, float* table, std::uint32_t mask) {
  launch(stream, n, Scatter4{{}, table, mask});
}

void run_nothing(Stream& stream) { launch(stream, 1, Nothing{}); }

}  // namespace octrad::selftest
