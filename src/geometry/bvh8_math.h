// An 8-wide tree of boxes with quantised bounds, and how rays walk it: closest hit and occlusion, for host and device.
// After Ylitie, Karras & Laine 2017, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs": boxes on an
// 8-bit grid of their node, children placed by octant so that no distances are sorted, one stack entry for all siblings
// that are still to come. The test of triangles is watertight (Woop, Benthin & Wald 2013, "Watertight Ray/Triangle
// Intersection"). The builder is in bvh8.h.
//
// What must hold for a ray to meet every triangle that the exact test accepts: the boxes on the grid contain the children
// (the builder), and the slabs are widened by more than the rounding of the slab distances and of the triangle test
// (Bvh8Ray::slack). Products that decide on which side of an edge a ray passes are never fused with sums: host and device
// then agree, and neighbours never both reject a ray.
#pragma once

#include <cassert>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "base/vec.h"
#include "geometry/hit.h"
#include "geometry/sphere_math.h"

namespace octrad {

inline constexpr int kBvh8StackSize = 32;        // the builder makes no tree of more levels
inline constexpr int kBvh8MaxLeaf = 4;           // primitives of a leaf
inline constexpr float kBvh8Largest = 1.152921504606846976e18f;  // 2^60: the builder leaves out what reaches further

// One node: a grid and up to eight children in slots 0..7. Byte i of each 64-bit word belongs to slot i; as a byte array,
// so in the machine's byte order. A box is origin + scale * [lower, upper] on each axis, scale = 2^(exponent - 127), or 0
// for exponent 0.
struct alignas(16) Bvh8Node {
  float origin[3];
  std::uint32_t exponents;         // biased, of x, y, z in bits 0..7, 8..15, 16..23; bits 24..31: slots that are nodes
  std::uint32_t child_base;        // nodes: the node slots in order of slot
  std::uint32_t primitive_base;
  std::uint64_t leaves;            // leaf slots: count << 5 | first, counted from primitive_base; 0: empty or a node
  std::uint64_t bounds[3][2];      // [axis][lower, upper]
};
static_assert(sizeof(Bvh8Node) == 80, "five loads of 16 bytes");

// A triangle's corners, or a sphere's centre and radius.
struct alignas(16) Bvh8Primitive {
  float data[9];
  std::int32_t shape;
  std::int32_t primitive;          // of the shape, as in Hit
  std::int32_t sphere;             // 0 or 1
};
static_assert(sizeof(Bvh8Primitive) == 48, "three loads of 16 bytes");

// Node 0 is the root; a tree without nodes is empty.
struct Bvh8View {
  const Bvh8Node* nodes;
  const Bvh8Primitive* primitives;
  std::uint32_t node_count, primitive_count;
};

namespace bvh8_detail {

// On the host only: in a kernel the call would cost registers in the innermost loop.
OCTRAD_HD inline void check([[maybe_unused]] bool holds) {
#if !defined(__CUDA_ARCH__)
  assert(holds);
#endif
}

OCTRAD_HD inline float multiply(float a, float b) {
#if defined(__CUDA_ARCH__)
  return __fmul_rn(a, b);          // never part of a fused multiply-add
#else
  return a * b;                    // the project is compiled without contraction
#endif
}

OCTRAD_HD inline double multiply(double a, double b) {
#if defined(__CUDA_ARCH__)
  return __dmul_rn(a, b);
#else
  return a * b;
#endif
}

// Index of the lowest bit that is set; mask != 0.
OCTRAD_HD inline unsigned lowest_bit(unsigned mask) {
#if defined(__CUDA_ARCH__)
  return static_cast<unsigned>(__ffs(static_cast<int>(mask)) - 1);
#else
  return static_cast<unsigned>(__builtin_ctz(mask));
#endif
}

OCTRAD_HD inline unsigned count_bits(unsigned mask) {
#if defined(__CUDA_ARCH__)
  return static_cast<unsigned>(__popc(mask));
#else
  mask = mask - ((mask >> 1) & 0x55u);           // eight bits only
  mask = (mask & 0x33u) + ((mask >> 2) & 0x33u);
  return (mask + (mask >> 4)) & 0xfu;
#endif
}

// A record in loads of 16 bytes.
template <typename T>
OCTRAD_HD inline T load(const T* from) {
#if defined(__CUDA_ARCH__)
  T record;
#pragma unroll
  for (unsigned i = 0; i < sizeof(T) / 16; ++i) reinterpret_cast<uint4*>(&record)[i] = __ldg(reinterpret_cast<const uint4*>(from) + i);
  return record;
#else
  return *from;
#endif
}

OCTRAD_HD inline unsigned byte_of(std::uint64_t word, unsigned i) { return static_cast<unsigned>(word >> (8 * i)) & 0xffu; }

// The eight bytes of a word as numbers.
OCTRAD_HD inline void unpack(std::uint64_t word, float* out) {
#if defined(__CUDA_ARCH__)
#pragma unroll
  for (unsigned i = 0; i < 8; ++i) out[i] = static_cast<float>(byte_of(word, i));
#else
  unsigned char bytes[8];
  std::memcpy(bytes, &word, 8);
  for (int i = 0; i < 8; ++i) out[i] = static_cast<float>(bytes[i]);
#endif
}

// 2^(exponent - 127), and 0 for 0.
OCTRAD_HD inline float grid_scale(unsigned exponent) {
  const std::uint32_t bits = exponent << 23;
  float scale;
  std::memcpy(&scale, &bits, 4);
  return scale;
}

// Moves bit i of an 8-bit mask to bit i ^ octant.
OCTRAD_HD constexpr unsigned permute(unsigned mask, unsigned octant) {
  if (octant & 1u) mask = ((mask & 0x55u) << 1) | ((mask & 0xaau) >> 1);
  if (octant & 2u) mask = ((mask & 0x33u) << 2) | ((mask & 0xccu) >> 2);
  if (octant & 4u) mask = ((mask & 0x0fu) << 4) | ((mask & 0xf0u) >> 4);
  return mask;
}

}  // namespace bvh8_detail

// Everything about a ray that is computed once.
struct Bvh8Ray {
  Vec3f origin, direction;
  Vec3f inverse;                   // 1 / direction, of a component that is not 0
  Vec3f slack;                     // widening of the slabs, relative to the distance along the longest axis
  float shear_x, shear_y, shear_z; // Woop's: maps the direction to (0, 0, 1)
  int axis_x, axis_y, axis_z;      // z: the longest
  unsigned octant;                 // bit k: component k is negative
};

// Relative error that the slabs are widened by: 16 units of rounding, where the slab distance needs 6 and the shear of the
// triangle's corners 6.
inline constexpr float kBvh8Widening = 16.0f / 16777216.0f;

// False for a direction without length or that is not finite; such a ray meets nothing. The direction need not have unit
// length; components below 2^-24 of the largest are raised to that for the boxes, and what this moves is part of the slack.
OCTRAD_HD inline bool make_bvh8_ray(Vec3f origin, Vec3f direction, Bvh8Ray& ray) {
  const Vec3f size{std::fabs(direction.x), std::fabs(direction.y), std::fabs(direction.z)};
  const float largest = max_component(size);
  if (!(largest > 0.0f) || !is_finite(direction) || !is_finite(origin)) return false;
  ray.origin = origin;
  ray.direction = direction;
  ray.octant = 0;
  const float least = std::fmax(largest * 5.9604645e-8f, 1.1754944e-38f);
  for (int k = 0; k < 3; ++k) {
    const bool raised = size[k] < least;
    const float component = raised ? std::copysign(least, direction[k]) : direction[k];
    ray.inverse[k] = 1.0f / component;
    ray.slack[k] = raised ? 1.0f + kBvh8Widening : kBvh8Widening;
    if (component < 0.0f) ray.octant |= 1u << k;
  }
  ray.axis_z = size.x >= size.y ? (size.x >= size.z ? 0 : 2) : (size.y >= size.z ? 1 : 2);
  ray.axis_x = ray.axis_z == 2 ? 0 : ray.axis_z + 1;
  ray.axis_y = ray.axis_x == 2 ? 0 : ray.axis_x + 1;
  const float along = direction[ray.axis_z];
  ray.shear_x = direction[ray.axis_x] / along;
  ray.shear_y = direction[ray.axis_y] / along;
  ray.shear_z = 1.0f / along;
  return true;
}

// Slots of the node whose boxes the ray may meet in [t_min, t_max]: never too few. Bits of empty slots mean nothing.
OCTRAD_HD inline unsigned bvh8_slots(const Bvh8Node& node, const Bvh8Ray& ray, float t_min, float t_max) {
  Vec3f step, start, reach;
  for (int k = 0; k < 3; ++k) {
    step[k] = bvh8_detail::grid_scale((node.exponents >> (8 * k)) & 0xffu) * ray.inverse[k];
    start[k] = (node.origin[k] - ray.origin[k]) * ray.inverse[k];
    reach[k] = std::fabs(start[k]) + 255.0f * std::fabs(step[k]);
  }
  // Distances are wrong by rounding relative to the grid's reach, the triangle test by the same along its own axis and
  // along the longest axis (through the shear).
  const float longest = reach[ray.axis_z];
  float t_near[8], t_far[8];
  for (int i = 0; i < 8; ++i) {
    t_near[i] = t_min;
    t_far[i] = t_max;
  }
#if defined(__CUDA_ARCH__)
#pragma unroll
#endif
  for (int k = 0; k < 3; ++k) {
    const bool negative = (ray.octant >> k & 1u) != 0;
    const float error = kBvh8Widening * reach[k] + ray.slack[k] * longest;
    const float first = start[k] - error, last = start[k] + error;
    float entry[8], leave[8];
    bvh8_detail::unpack(negative ? node.bounds[k][1] : node.bounds[k][0], entry);
    bvh8_detail::unpack(negative ? node.bounds[k][0] : node.bounds[k][1], leave);
#if defined(__CUDA_ARCH__)
#pragma unroll
#endif
    for (int i = 0; i < 8; ++i) {
      const float in = entry[i] * step[k] + first, out = leave[i] * step[k] + last;
      t_near[i] = in > t_near[i] ? in : t_near[i];
      t_far[i] = out < t_far[i] ? out : t_far[i];
    }
  }
  unsigned slots = 0;
#if defined(__CUDA_ARCH__)
#pragma unroll
#endif
  for (int i = 0; i < 8; ++i) slots |= (t_near[i] <= t_far[i] ? 1u : 0u) << i;
  return slots;
}

namespace bvh8_detail {

// Distance to the triangle's plane, in double: in float, long and grazed triangles have errors far above rounding, a ray that
// starts on a surface may meet it again, and which of two near surfaces is met would differ between devices. `z`: distances
// of the corners, which bound it (rays nearly inside the plane).
OCTRAD_HD inline float plane_distance(const float* p, const float* z, const Bvh8Ray& ray, double fallback) {
  const Vec3d a(p[0], p[1], p[2]);
  const Vec3d n = cross(Vec3d(p[3], p[4], p[5]) - a, Vec3d(p[6], p[7], p[8]) - a);
  const double facing = dot(n, Vec3d(ray.direction));
  const double t = facing != 0.0 ? dot(n, a - Vec3d(ray.origin)) / facing : fallback;
  const float lower = std::fmin(z[0], std::fmin(z[1], z[2])), upper = std::fmax(z[0], std::fmax(z[1], z[2]));
  const float rounding = 4e-7f * std::fmax(std::fabs(lower), std::fabs(upper));
  return std::fmin(std::fmax(static_cast<float>(t), lower - rounding), upper + rounding);
}

// Weights of the corners from the areas opposite to them.
template <typename T>
OCTRAD_HD inline bool finish(T u, T v, T w, const float* corners, const float* z, const Bvh8Ray& ray, float t_min, float t_max, Hit& hit) {
  if ((u < T(0) || v < T(0) || w < T(0)) && (u > T(0) || v > T(0) || w > T(0))) return false;
  const T area = u + v + w;
  if (area == T(0)) return false;
  const T b0 = u / area, b1 = v / area, b2 = w / area;
  const T mean = b0 * static_cast<T>(z[0]) + b1 * static_cast<T>(z[1]) + b2 * static_cast<T>(z[2]);
  const float t = plane_distance(corners, z, ray, static_cast<double>(mean));
  if (!(t > t_min && t <= t_max)) return false;
  hit.t = t;
  hit.u = static_cast<float>(b1);
  hit.v = static_cast<float>(b2);
  return true;
}

template <typename T>
OCTRAD_HD inline T edge(float ax, float ay, float bx, float by) {
  return multiply(static_cast<T>(ax), static_cast<T>(by)) - multiply(static_cast<T>(ay), static_cast<T>(bx));
}

}  // namespace bvh8_detail

// Both sides; edges and corners belong to the triangle. Fills t, u and v of `hit` for a distance in (t_min, t_max].
OCTRAD_HD inline bool bvh8_triangle(const float* corners, const Bvh8Ray& ray, float t_min, float t_max, Hit& hit) {
  using bvh8_detail::edge;
  float x[3], y[3], z[3];
#if defined(__CUDA_ARCH__)
#pragma unroll
#endif
  for (int i = 0; i < 3; ++i) {
    const Vec3f p{corners[3 * i] - ray.origin.x, corners[3 * i + 1] - ray.origin.y, corners[3 * i + 2] - ray.origin.z};
    const float along = p[ray.axis_z];
    x[i] = p[ray.axis_x] - bvh8_detail::multiply(ray.shear_x, along);
    y[i] = p[ray.axis_y] - bvh8_detail::multiply(ray.shear_y, along);
    z[i] = bvh8_detail::multiply(ray.shear_z, along);
  }
  const float u = edge<float>(x[2], y[2], x[1], y[1]);
  const float v = edge<float>(x[0], y[0], x[2], y[2]);
  const float w = edge<float>(x[1], y[1], x[0], y[0]);
  // Rounding keeps the order of two products or makes them equal; where they are equal, or too small to be exact, double
  // decides, in which products of floats are exact.
  if (u == 0.0f || v == 0.0f || w == 0.0f || std::fabs(u + v + w) < 1e-30f) {
    return bvh8_detail::finish<double>(edge<double>(x[2], y[2], x[1], y[1]), edge<double>(x[0], y[0], x[2], y[2]),
                                       edge<double>(x[1], y[1], x[0], y[0]), corners, z, ray, t_min, t_max, hit);
  }
  return bvh8_detail::finish<float>(u, v, w, corners, z, ray, t_min, t_max, hit);
}

// Distances in (t_min, t_max] for triangles and [t_min, t_max] for spheres, as Embree's.
OCTRAD_HD inline bool bvh8_primitive(const Bvh8Primitive& p, const Bvh8Ray& ray, float t_min, float t_max, Hit& hit) {
  if (p.sphere == 0) return bvh8_triangle(p.data, ray, t_min, t_max, hit);
  const double t = intersect_sphere({p.data[0], p.data[1], p.data[2]}, p.data[3], ray.origin, ray.direction, t_min, t_max);
  if (!(t >= 0.0)) return false;
  hit.t = static_cast<float>(t);
  hit.u = hit.v = 0.0f;
  return true;
}

// The walk. kAny: any hit will do, else the nearest; of hits at the same distance the one of the lowest shape and
// primitive, so that the result does not depend on the tree.
template <bool kAny>
OCTRAD_HD inline Hit bvh8_trace(const Bvh8View& bvh, Vec3f origin, Vec3f direction, float t_min, float t_max) {
  using namespace bvh8_detail;
  Hit best;
  Bvh8Ray ray;
  if (bvh.node_count == 0 || !make_bvh8_ray(origin, direction, ray)) return best;
  // A group is what is left of the children of one node: an entry a level at most.
  struct Group { std::uint32_t base, masks; };   // masks: slots to come, in the ray's order; << 8: slots that are nodes
  Group stack[kBvh8StackSize];
  int depth = 0;
  Group group{0, (1u << 8) | permute(1u, ray.octant)};
  for (;;) {
    const unsigned order = lowest_bit(group.masks & 0xffu);
    group.masks &= group.masks - 1;
    const unsigned slot = order ^ ray.octant;
    const std::uint32_t index = group.base + count_bits((group.masks >> 8) & ((1u << slot) - 1u));
    if ((group.masks & 0xffu) != 0) {
      check(depth < kBvh8StackSize);
      stack[depth++] = group;
    }
    check(index < bvh.node_count);
    const Bvh8Node node = load(bvh.nodes + index);
    const unsigned slots = bvh8_slots(node, ray, t_min, t_max), nodes = node.exponents >> 24;
    for (unsigned leaves = permute(slots & ~nodes, ray.octant); leaves != 0; leaves &= leaves - 1) {
      const unsigned leaf = byte_of(node.leaves, lowest_bit(leaves) ^ ray.octant);
      const std::uint32_t first = node.primitive_base + (leaf & 31u);
      for (std::uint32_t i = first; i < first + (leaf >> 5); ++i) {
        const Bvh8Primitive p = load(bvh.primitives + i);
        Hit hit;
        if (!bvh8_primitive(p, ray, t_min, t_max, hit)) continue;
        hit.shape = p.shape;
        hit.primitive = p.primitive;
        if (kAny) return hit;
        const bool tie = best.valid() && hit.t == best.t;
        if (tie && (best.shape < hit.shape || (best.shape == hit.shape && best.primitive < hit.primitive))) continue;
        best = hit;
        t_max = hit.t;
      }
    }
    group = {node.child_base, (nodes << 8) | permute(slots & nodes, ray.octant)};
    if ((group.masks & 0xffu) == 0) {
      if (depth == 0) return best;
      group = stack[--depth];
    }
  }
}

// The nearest hit between t_min and t_max (bvh8_primitive), or one that is not valid.
OCTRAD_HD inline Hit bvh8_intersect(const Bvh8View& bvh, Vec3f origin, Vec3f direction, float t_min, float t_max) {
  return bvh8_trace<false>(bvh, origin, direction, t_min, t_max);
}

// Whether anything is between t_min and t_max.
OCTRAD_HD inline bool bvh8_occluded(const Bvh8View& bvh, Vec3f origin, Vec3f direction, float t_min, float t_max) {
  return bvh8_trace<true>(bvh, origin, direction, t_min, t_max).valid();
}

}  // namespace octrad
