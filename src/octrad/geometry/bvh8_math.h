// An 8-wide bounding volume hierarchy with quantised bounds and its traversal: closest hit and occlusion, for host and
// device.
// After Ylitie, Karras & Laine 2017, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs": boxes
// on an 8-bit grid of their node, children placed by octant so that no distances are sorted, one stack entry for all
// siblings that are still to be visited, primitives tested when enough lanes of a warp have some. The builder is in
// bvh8.h.
//
// What must hold for a ray to meet every triangle that the exact test accepts: the boxes on the grid contain the
// children (the builder), and the slabs are widened by more than the rounding of the slab distances and of the triangle
// test (Bvh8Slack).
#pragma once

#include <cassert>
#include <cmath>
#include <cstdint>

#include "octrad/base/bits.h"
#include "octrad/base/vec.h"
#include "octrad/geometry/bvh8_primitive_math.h"
#include "octrad/geometry/hit.h"

namespace octrad {

inline constexpr int kBvh8StackSize = 32;  // the builder makes no tree of more levels
inline constexpr int kBvh8MaxLeaf = 4;     // primitives of a leaf

// One node: a grid and up to eight children in slots 0..7. Byte i of each 64-bit word belongs to slot i; as a byte
// array, so in the machine's byte order. A box is origin + scale * [lower, upper] on each axis, scale = 2^(exponent -
// 142), or 0 for exponent 0.
struct alignas(16) Bvh8Node {
  float origin[3];
  std::uint32_t exponents;       // biased, of x, y, z in bits 0..7, 8..15, 16..23; bits 24..31: slots that are nodes
  std::uint32_t child_base;      // nodes: the node slots in order of slot
  std::uint32_t primitive_base;  // primitives: the bits of `primitives` in order
  std::uint32_t primitives;      // bits 4 slot, 4 slot + 1, ..: one for each primitive of a slot that is a leaf
  std::uint32_t one;           // the bits of 1.0f, for grid_place: there it costs neither a register nor an instruction
  std::uint64_t bounds[3][2];  // [axis][lower, upper]
};
static_assert(sizeof(Bvh8Node) == 80, "five loads of 16 bytes");

// The size of a grid's steps; for the builder.
inline double bvh8_grid_scale(unsigned exponent) {
  return exponent == 0 ? 0.0 : std::ldexp(1.0, static_cast<int>(exponent) - 142);
}

// Node 0 is the root; a tree without nodes is empty.
struct Bvh8View {
  const Bvh8Node* nodes;
  const Bvh8Primitive* primitives;
  std::uint32_t node_count, primitive_count;
  bool one_sided;  // some primitives are: rays may pass them (bvh8_passes)
};

namespace bvh8_detail {

// On the host only: in a kernel the call would cost registers in the innermost loop.
OCTRAD_HD inline void check([[maybe_unused]] bool holds) {
#if !defined(__CUDA_ARCH__)
  assert(holds);
#endif
}

// 1 + b / 2^15 of byte i < 4 of the word, made of bits: faster than a conversion.
OCTRAD_HD inline float grid_place(std::uint32_t word, std::uint32_t one, unsigned i) {
#if defined(__CUDA_ARCH__)
  return __uint_as_float(__byte_perm(word, one, 0x7604u | i << 4));
#else
  return float_of(one | (word >> (8 * i) & 0xffu) << 8);
#endif
}

// 2^15 times the scale of axis k's grid (bvh8_grid_scale).
OCTRAD_HD inline float grid_size(std::uint32_t exponents, int k) {
  return float_of((exponents >> (8 * k) & 0xffu) << 23);
}

// max(a, b, c, 0), and min(a, b, c, t_max) or a negative number where that is negative; none is NaN, t_max is not
// negative. Numbers that are not negative are in the order of their bits, and integers have instructions for three.
OCTRAD_HD inline float latest(float a, float b, float c) {
#if defined(__CUDA_ARCH__)
  return __int_as_float(__vimax3_s32_relu(__float_as_int(a), __float_as_int(b), __float_as_int(c)));
#else
  return greater(greater(a, b), greater(c, 0.0f));
#endif
}

OCTRAD_HD inline float soonest(float a, float b, float c, float t_max) {
#if defined(__CUDA_ARCH__)
  return __int_as_float(
      ::min(__vimin3_s32(__float_as_int(a), __float_as_int(b), __float_as_int(c)), __float_as_int(t_max)));
#else
  return lesser(lesser(a, b), lesser(c, t_max));
#endif
}

// Moves bit i of an 8-bit mask to bit i ^ octant. Bits above are lost.
OCTRAD_HD constexpr unsigned permute(unsigned mask, unsigned octant) {
  const unsigned a = octant & 1u, b = octant & 2u, c = octant & 4u;
  mask = ((mask >> a) & 0x55u) | ((mask << a) & 0xaau);
  mask = ((mask >> b) & 0x33u) | ((mask << b) & 0xccu);
  return ((mask >> c) & 0x0fu) | ((mask << c) & 0xf0u);
}

// Bit i of eight to bits 4 i .. 4 i + 3.
OCTRAD_HD constexpr std::uint32_t widen(std::uint32_t mask) {
  mask = (mask | mask << 12) & 0x000f000fu;
  mask = (mask | mask << 6) & 0x03030303u;
  mask = (mask | mask << 3) & 0x11111111u;
  return mask * 15u;
}

}  // namespace bvh8_detail

// Slots of the node whose boxes the ray may meet in [0, t_max]: never too few. Bits of empty slots are undefined.
OCTRAD_HD inline unsigned bvh8_slots(const Bvh8Node& node, const Bvh8Ray& ray, const Bvh8Slack& slack, float t_max) {
  using namespace bvh8_detail;
  // Places on the grid are counted from 2^15 steps before its origin (grid_place): `reach` has the rounding of that in
  // it.
  Vec3f step, start, reach;
  OCTRAD_UNROLL
  for (int k = 0; k < 3; ++k) {
    step[k] = grid_size(node.exponents, k) * ray.inverse[k];
    start[k] = (node.origin[k] - ray.origin[k]) * ray.inverse[k];
    reach[k] = std::fabs(start[k]) + std::fabs(step[k]);
  }
  // Distances are wrong by rounding relative to the grid's reach, the triangle test by the same along its own axis and
  // along the longest axis (through the shear).
  const float longest = reach[static_cast<int>(slack.longest)];
  Vec3f first, last;
  std::uint64_t entry[3], leave[3];
  OCTRAD_UNROLL
  for (int k = 0; k < 3; ++k) {
    const float error = kBvh8Widening * reach[k] + slack.widening[k] * longest;
    first[k] = start[k] - step[k] - error;
    last[k] = start[k] - step[k] + error;
    const bool negative = (ray.order >> k & 1u) == 0;
    entry[k] = negative ? node.bounds[k][1] : node.bounds[k][0];
    leave[k] = negative ? node.bounds[k][0] : node.bounds[k][1];
  }
  unsigned missed = ~0u;
  OCTRAD_UNROLL
  for (unsigned i = 8; i-- > 0;) {
    float in[3], out[3];
    OCTRAD_UNROLL
    for (int k = 0; k < 3; ++k) {
      in[k] = grid_place(static_cast<std::uint32_t>(entry[k] >> (i & 4u) * 8), node.one, i & 3u) * step[k] + first[k];
      out[k] = grid_place(static_cast<std::uint32_t>(leave[k] >> (i & 4u) * 8), node.one, i & 3u) * step[k] + last[k];
    }
    const float t_near = latest(in[0], in[1], in[2]), t_far = soonest(out[0], out[1], out[2], t_max);
#if defined(__CUDA_ARCH__)
    missed = __funnelshift_l(__float_as_uint(t_far - t_near), missed, 1);  // the sign
#else
    missed = missed << 1 | (t_near <= t_far ? 0u : 1u);
#endif
  }
  return ~missed;
}

namespace bvh8_detail {

// Whether at least half of the active lanes of the warp are waiting, so that these go on alone; on the host each ray is
// a warp of its own.
OCTRAD_HD inline bool enough(bool waiting) {
#if defined(__CUDA_ARCH__)
  const unsigned here = __activemask();
  return 2 * __popc(__ballot_sync(here, waiting)) >= __popc(here);
#else
  return waiting;
#endif
}

}  // namespace bvh8_detail

// The traversal of one ray; inactive before begin(). kAny: ends at any hit, else finds the nearest; of hits at the same
// distance the one of the lowest shape and primitive, so that the result does not depend on the tree.
template <bool kAny>
class Bvh8Traversal {
 public:
  // Children of one node that are still to be visited: a stack entry, at most one a level. Bits 24..31 of the masks:
  // slots to visit, the next one the highest; bits 0..7: slots that are nodes, in order of slot.
  struct Group {
    std::uint32_t base, masks;
  };

  // The part that lives in memory and must be the same for all calls; the object itself fits into registers.
  struct Memory {
    Bvh8Slack slack;
    Bvh8ShearedRay sheared;
    Group stack[kBvh8StackSize];
  };

  // t_min is not negative. False for a ray that meets nothing.
  OCTRAD_HD bool begin(const Bvh8View& bvh, Memory& memory, Vec3f origin, Vec3f direction, float t_min, float t_max) {
    *this = Bvh8Traversal{};
    t_min_ = t_min;
    t_max_ = t_max;
    if (bvh.node_count == 0 || !(t_min >= 0.0f && t_min <= t_max)) return false;
    if (!make_bvh8_ray(origin, direction, ray_, memory.slack, memory.sheared)) return false;
    group_ = {0, 1u << ray_.order | 1u};
    return true;
  }

  // Whether there are primitives to test before the next visit of a node.
  OCTRAD_HD bool has_primitives() const { return pending_ != 0; }
  OCTRAD_HD bool has_nodes() const { return group_.masks > kNodesOnly || depth_ > 0; }
  OCTRAD_HD bool active() const { return has_primitives() || has_nodes(); }

  OCTRAD_HD void visit(const Bvh8View& bvh, Memory& memory) {
    using namespace bvh8_detail;
    if (group_.masks <= kNodesOnly) group_ = memory.stack[--depth_];
    const unsigned bit = highest_bit(group_.masks), slot = bit ^ ray_.order;
    group_.masks &= ~(~0u << bit);
    const std::uint32_t index = group_.base + count_bits(group_.masks & ~(~0u << slot));
    if (group_.masks > kNodesOnly) {
      check(depth_ < kBvh8StackSize);
      memory.stack[depth_++] = group_;
    }
    check(index < bvh.node_count);
    const Bvh8Node node = load(bvh.nodes + index);
    const unsigned slots = bvh8_slots(node, ray_, memory.slack.load_local(), t_max_), nodes = node.exponents >> 24;
    group_ = {node.child_base, permute(slots & nodes, ray_.order) << 24 | nodes};
    primitives_ = node.primitives;
    pending_ = widen(slots) & node.primitives;
    base_ = node.primitive_base;
  }

  OCTRAD_HD void test(const Bvh8View& bvh, const Memory& memory) {
    using namespace bvh8_detail;
    const unsigned above = ~0u << highest_bit(pending_);
    pending_ &= ~above;
    const std::uint32_t index = base_ + count_bits(primitives_ & ~above);
    check(index < bvh.primitive_count);
    float t;
    if (!bvh8_meets(bvh.primitives, index, memory.sheared.load_local(), t_min_, t_max_, t)) return;
    if (bvh.one_sided && bvh8_passes(bvh.primitives[index], memory.sheared)) return;
    if (kAny) {
      pending_ = 0;
      depth_ = 0;
      group_.masks = 0;
    } else if (t == t_max_ && best_ != kNone) {
      const Bvh8Primitive &a = bvh.primitives[index], &b = bvh.primitives[best_];
      if (a.shape() > b.shape() || (a.shape() == b.shape() && a.primitive() > b.primitive())) return;
    }
    best_ = index;
    t_max_ = t;
  }

  OCTRAD_HD bool met() const { return best_ != kNone; }
  OCTRAD_HD Hit hit(const Bvh8View& bvh, const Memory& memory) const {
    return met() ? bvh8_hit(bvh.primitives, best_, memory.sheared.load_local(), t_max_) : Hit{};
  }

 private:
  static constexpr std::uint32_t kNone = ~std::uint32_t{0}, kNodesOnly = 0xffffffu;

  Bvh8Ray ray_{};
  float t_min_ = 0.0f, t_max_ = 0.0f;
  std::uint32_t best_ = kNone;
  Group group_{0, 0};
  std::uint32_t primitives_ = 0, pending_ = 0, base_ = 0;  // of the node visited last; pending: to be tested
  int depth_ = 0;
};

template <bool kAny>
OCTRAD_HD inline void bvh8_finish(const Bvh8View& bvh, Bvh8Traversal<kAny>& traversal,
                                  typename Bvh8Traversal<kAny>::Memory& memory) {
  for (;;) {
    if (!traversal.has_primitives()) {
      if (!traversal.has_nodes()) return;
      traversal.visit(bvh, memory);
    }
    while (bvh8_detail::enough(traversal.has_primitives())) {
      if (traversal.has_primitives()) traversal.test(bvh, memory);
    }
  }
}

// The nearest hit between t_min and t_max (bvh8_meets), or one that is not valid.
OCTRAD_HD inline Hit bvh8_intersect(const Bvh8View& bvh, Vec3f origin, Vec3f direction, float t_min, float t_max) {
  Bvh8Traversal<false> traversal;
  Bvh8Traversal<false>::Memory memory;
  if (!traversal.begin(bvh, memory, origin, direction, t_min, t_max)) return {};
  bvh8_finish(bvh, traversal, memory);
  return traversal.hit(bvh, memory);
}

// Whether anything is between t_min and t_max.
OCTRAD_HD inline bool bvh8_occluded(const Bvh8View& bvh, Vec3f origin, Vec3f direction, float t_min, float t_max) {
  Bvh8Traversal<true> traversal;
  Bvh8Traversal<true>::Memory memory;
  if (!traversal.begin(bvh, memory, origin, direction, t_min, t_max)) return false;
  bvh8_finish(bvh, traversal, memory);
  return traversal.met();
}

}  // namespace octrad
