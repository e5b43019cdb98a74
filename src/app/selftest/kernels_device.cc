#include "app/selftest/kernels.h"

#include "app/selftest/shading_numbers.h"
#include "octrad/base/rng.h"
#include "octrad/device/launch.h"
#include "octrad/transport/cast.h"

namespace octrad::selftest {
namespace {

struct SelftestClosest : Kernel {
  Bvh8View tree;
  std::uint32_t n;
  const DeviceRay* rays;
  Hit* hits;
  static constexpr bool kAny = false;
  OCTRAD_HD Bvh8View bvh() const { return tree; }
  OCTRAD_HD std::uint32_t size() const { return n; }
  OCTRAD_HD void count() const {}
  OCTRAD_HD RayQuery ray(std::uint32_t i) const { return {rays[i].origin, rays[i].direction, rays[i].t_max}; }
  OCTRAD_HD void met(std::uint32_t i, const Hit& hit) const { hits[i] = hit; }
};

struct SelftestOccluded : Kernel {
  Bvh8View tree;
  std::uint32_t n;
  const DeviceRay* rays;
  std::uint32_t* blocked;
  static constexpr bool kAny = true;
  OCTRAD_HD Bvh8View bvh() const { return tree; }
  OCTRAD_HD std::uint32_t size() const { return n; }
  OCTRAD_HD void count() const {}
  OCTRAD_HD RayQuery ray(std::uint32_t i) const { return {rays[i].origin, rays[i].direction, rays[i].t_max}; }
  OCTRAD_HD void met(std::uint32_t i, bool any) const { blocked[i] = any ? 1u : 0u; }
};

struct SelftestClosestAlone : Kernel {
  Bvh8View tree;
  const DeviceRay* rays;
  Hit* hits;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    hits[i] = bvh8_intersect(tree, rays[i].origin, rays[i].direction, 0.0f, rays[i].t_max);
  }
};

struct SelftestOccludedAlone : Kernel {
  Bvh8View tree;
  const DeviceRay* rays;
  std::uint32_t* blocked;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    blocked[i] = bvh8_occluded(tree, rays[i].origin, rays[i].direction, 0.0f, rays[i].t_max) ? 1u : 0u;
  }
};

struct SelftestShading : Kernel {
  DeviceWorld world;
  const DeviceRay* rays;
  const Hit* hits;
  const float* u;
  float* out;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    const std::size_t item = i;
    shading_numbers(world, hits[i], rays[i].origin, rays[i].direction, u + 6 * item, out + kShadingNumbers * item);
  }
};

// Where access k of item i goes: cheap, and without a pattern that caches could use.
OCTRAD_HD inline std::uint32_t place(std::uint32_t i, int k, std::uint32_t mask) {
  return static_cast<std::uint32_t>(mix64((static_cast<std::uint64_t>(i) << 3) + static_cast<std::uint64_t>(k) + 1)) &
         mask;
}

struct SelftestSectorReads : Kernel {
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

struct SelftestGathers : Kernel {
  const float* table;
  std::uint32_t mask;
  float* out;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    float sum = 0.0f;
    for (int k = 0; k < kAccesses; ++k) sum += table[place(i, k, mask)];
    out[i] = sum;
  }
};

struct SelftestScatter : Kernel {
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

struct SelftestScatter4 : Kernel {
  float* table;
  std::uint32_t mask;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    for (int k = 0; k < kAccesses; ++k) add_four(table + 4 * static_cast<std::size_t>(place(i, k, mask)));
  }
};

struct SelftestNothing : Kernel {
  OCTRAD_HD void operator()(std::uint32_t) const {}
};

}  // namespace

void run_closest(Stream& stream, std::size_t n, const Bvh8View& bvh, const DeviceRay* rays, Hit* hits) {
  cast(stream, n, SelftestClosest{{}, bvh, static_cast<std::uint32_t>(n), rays, hits});
}

void run_occluded(Stream& stream, std::size_t n, const Bvh8View& bvh, const DeviceRay* rays, std::uint32_t* blocked) {
  cast(stream, n, SelftestOccluded{{}, bvh, static_cast<std::uint32_t>(n), rays, blocked});
}

void run_closest_alone(Stream& stream, std::size_t n, const Bvh8View& bvh, const DeviceRay* rays, Hit* hits) {
  launch(stream, n, SelftestClosestAlone{{}, bvh, rays, hits});
}

void run_occluded_alone(Stream& stream, std::size_t n, const Bvh8View& bvh, const DeviceRay* rays,
                        std::uint32_t* blocked) {
  launch(stream, n, SelftestOccludedAlone{{}, bvh, rays, blocked});
}

void run_shading(Stream& stream, std::size_t n, const DeviceWorld& world, const DeviceRay* rays, const Hit* hits,
                 const float* u, float* out) {
  launch(stream, n, SelftestShading{{}, world, rays, hits, u, out});
}

void run_sector_reads(Stream& stream, std::size_t n, const Sector* table, std::uint32_t mask, float* out) {
  launch(stream, n, SelftestSectorReads{{}, table, mask, out});
}

void run_gathers(Stream& stream, std::size_t n, const float* table, std::uint32_t mask, float* out) {
  launch(stream, n, SelftestGathers{{}, table, mask, out});
}

void run_scatter(Stream& stream, std::size_t n, float* table, std::uint32_t mask) {
  launch(stream, n, SelftestScatter{{}, table, mask});
}

void run_scatter4(Stream& stream, std::size_t n, float* table, std::uint32_t mask) {
  launch(stream, n, SelftestScatter4{{}, table, mask});
}

void run_nothing(Stream& stream) { launch(stream, 1, SelftestNothing{}); }

}  // namespace octrad::selftest
