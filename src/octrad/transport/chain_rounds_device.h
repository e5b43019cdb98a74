// Rays that go on over mirrors, glass and near mirrors, or through masks, a surface a round: casting all of them
// together keeps a GPU busier than following each by a thread alone. For files named *_device.cc; used by DeviceRhs.
#pragma once

#include "octrad/transport/cast.h"
#include "octrad/transport/device_memory.h"
#include "octrad/transport/follow_math.h"

namespace octrad {

// A chain between two surfaces: what follow_hit() has left behind, by place of its ray. The ray itself, its hit and
// shadow rays are in the queues of their owner.
struct ChainStates {
  // Throughput 0..2, emission met after the first segment 3..5, at its end 6..8, its light density 9, light sampled at
  // the last surface 10..12, that surface 13..15 and the density there 16, surfaces passed 17 (-1: the chain has
  // ended), mirrors among them 18.
  static constexpr int kNumbers = 19;
  FloatPlanes numbers;
  Rng* generators = nullptr;

  OCTRAD_HD void store(std::uint32_t q, const Segment& segment, const RayEnd& end, Vec3f light, bool ended,
                       const Rng& rng) const {
    numbers.set3(0, q, end.throughput);
    numbers.set3(3, q, end.emitted);
    numbers.set3(6, q, end.first_emitted);
    numbers.set(9, q, end.first_light_pdf);
    numbers.set3(10, q, light);
    numbers.set3(13, q, segment.vertex);
    numbers.set(16, q, segment.pdf);
    numbers.set(17, q, ended ? -1.0f : static_cast<float>(segment.passed));
    numbers.set(18, q, static_cast<float>(segment.mirrors));
    generators[q] = rng;
  }
  OCTRAD_HD void drop_light(std::uint32_t q) const { numbers.set3(10, q, Vec3f(0.0f)); }
  // False for a chain that has ended.
  OCTRAD_HD bool load(std::uint32_t q, Segment& segment, RayEnd& end, Rng& rng) const {
    end.throughput = numbers.get3(0, q);
    end.emitted = numbers.get3(3, q) + numbers.get3(10, q);
    end.first_emitted = numbers.get3(6, q);
    end.first_light_pdf = numbers.get(9, q);
    segment.vertex = numbers.get3(13, q);
    segment.pdf = numbers.get(16, q);
    segment.passed = static_cast<int>(numbers.get(17, q));
    segment.mirrors = static_cast<int>(numbers.get(18, q));
    rng = generators[q];
    return segment.passed >= 0;
  }
};

// The rays of one round: those that it begins with and those that go on, and the shadow rays of the latter.
struct ChainRound {
  const std::uint32_t* items = nullptr;  // places of rays
  const std::uint32_t* count = nullptr;
  std::uint32_t* next = nullptr;
  std::uint32_t* next_count = nullptr;
  std::uint32_t* shadow_count = nullptr;
  bool first = true;  // chains begin: they have no state yet
};

struct ExtendChains : Kernel {
  Bvh8View tree;
  const std::uint32_t* items;
  const std::uint32_t* length;
  RayPlanes rays;
  Hit* hits;
  static constexpr bool kAny = false;
  OCTRAD_HD Bvh8View bvh() const { return tree; }
  OCTRAD_HD std::uint32_t size() const { return *length; }
  OCTRAD_HD void count() const {}
  OCTRAD_HD RayQuery ray(std::uint32_t k) const { return rays.load(items[k]); }
  OCTRAD_HD void met(std::uint32_t k, const Hit& hit) const { hits[items[k]] = hit; }
};

struct OccludeChains : Kernel {
  Bvh8View tree;
  const std::uint32_t* length;
  RayPlanes rays;
  const std::uint32_t* owners;  // places of the chains' rays
  ChainStates states;
  static constexpr bool kAny = true;
  OCTRAD_HD Bvh8View bvh() const { return tree; }
  OCTRAD_HD std::uint32_t size() const { return *length; }
  OCTRAD_HD void count() const {}
  OCTRAD_HD RayQuery ray(std::uint32_t k) const { return rays.load(k); }
  OCTRAD_HD void met(std::uint32_t k, bool any) const {
    if (any) states.drop_light(owners[k]);
  }
};

}  // namespace octrad
