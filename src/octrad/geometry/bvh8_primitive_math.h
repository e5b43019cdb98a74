// What the leaves of the 8-wide tree hold (bvh8_math.h), and how rays meet it. The test of triangles is watertight
// (Woop, Benthin & Wald 2013, "Watertight Ray/Triangle Intersection"): products that decide on which side of an edge a
// ray passes are never fused with sums, so that host and device agree and neighbours never both reject a ray.
#pragma once

#include <cmath>
#include <cstdint>

#include "octrad/base/bits.h"
#include "octrad/base/vec.h"
#include "octrad/geometry/hit.h"
#include "octrad/geometry/sphere_math.h"

namespace octrad {

inline constexpr float kBvh8Largest = 1.152921504606846976e18f;  // 2^60: the builder leaves out what reaches further

// One coordinate of a triangle's three corners; of a sphere: that of the centre, and the radius.
struct alignas(16) Bvh8Row {
  float corner[3];
  // Bit 31: a sphere; bit 30: a triangle that rays pass along its normal, (p1-p0)x(p2-p0), or against it if bit 0 of
  // row 2 is set. Below: row 0 the shape, row 1 the primitive of the shape, as in Hit.
  std::uint32_t id;
};
inline constexpr std::uint32_t kBvh8Sphere = 1u << 31, kBvh8OneSided = 1u << 30;

// A primitive by coordinate, so that a ray loads the rows in the order of its own axes.
struct Bvh8Primitive {
  Bvh8Row rows[3];
  OCTRAD_HD bool sphere() const { return (rows[0].id & kBvh8Sphere) != 0; }
  OCTRAD_HD int shape() const { return static_cast<int>(rows[0].id & (kBvh8OneSided - 1)); }
  OCTRAD_HD int primitive() const { return static_cast<int>(rows[1].id & (kBvh8OneSided - 1)); }
};
static_assert(sizeof(Bvh8Primitive) == 48, "three loads of 16 bytes");

namespace bvh8_detail {

OCTRAD_HD inline float multiply(float a, float b) {
#if defined(__CUDA_ARCH__)
  return __fmul_rn(a, b);  // never part of a fused multiply-add
#else
  return a * b;  // the project is compiled without contraction
#endif
}

OCTRAD_HD inline double multiply(double a, double b) {
#if defined(__CUDA_ARCH__)
  return __dmul_rn(a, b);
#else
  return a * b;
#endif
}

// Loads a record 16 bytes at a time.
template <typename T>
OCTRAD_HD inline T load(const T* from) {
#if defined(__CUDA_ARCH__)
  T record;
#pragma unroll
  for (unsigned i = 0; i < sizeof(T) / 16; ++i)
    reinterpret_cast<uint4*>(&record)[i] = __ldg(reinterpret_cast<const uint4*>(from) + i);
  return record;
#else
  return *from;
#endif
}

}  // namespace bvh8_detail

// Relative error that the slabs are widened by: 16 units of rounding, where the slab distance needs 9 (4 of them
// because places on the grid are counted from before its origin) and the shear of the triangle's corners 6.
inline constexpr float kBvh8Widening = 16.0f / 16777216.0f;

// What is computed once for a ray. Not all of it fits into registers: Bvh8Ray is kept there, the other two in local
// memory.
struct Bvh8Ray {
  Vec3f origin;
  Vec3f inverse;   // 1 / direction, of a component that is not 0
  unsigned order;  // 24 + bit k: component k is not negative; the higher slot ^ order, the sooner its visit
};

struct alignas(16) Bvh8Slack {
  Vec3f widening;    // of the slabs, relative to the distance along the longest axis
  unsigned longest;  // axis
#if defined(__CUDA_ARCH__)
  __device__ Bvh8Slack load_local() const {  // see Bvh8ShearedRay
    Bvh8Slack copy;
    asm volatile("ld.local.v4.b32 {%0, %1, %2, %3}, [%4];"
                 : "=f"(copy.widening.x), "=f"(copy.widening.y), "=f"(copy.widening.z), "=r"(copy.longest)
                 : "l"(__cvta_generic_to_local(this))
                 : "memory");
    return copy;
  }
#else
  const Bvh8Slack& load_local() const { return *this; }
#endif
};

// The ray for tests of primitives, with axes permuted: z is the longest component, x and y follow cyclically.
struct alignas(16) Bvh8ShearedRay {
  Vec3f position;
  unsigned axis_x;
  Vec3f shear;  // Woop's: maps the direction to (0, 0, 1)
  unsigned axis_y;
  Vec3f direction;
  unsigned axis_z;
#if defined(__CUDA_ARCH__)
  // Reads the object from local memory; otherwise the compiler would keep all of it in registers.
  __device__ Bvh8ShearedRay load_local() const {
    Bvh8ShearedRay copy;
    const std::size_t at = __cvta_generic_to_local(this);
    asm volatile("ld.local.v4.b32 {%0, %1, %2, %3}, [%4];"
                 : "=f"(copy.position.x), "=f"(copy.position.y), "=f"(copy.position.z), "=r"(copy.axis_x)
                 : "l"(at)
                 : "memory");
    asm volatile("ld.local.v4.b32 {%0, %1, %2, %3}, [%4 + 16];"
                 : "=f"(copy.shear.x), "=f"(copy.shear.y), "=f"(copy.shear.z), "=r"(copy.axis_y)
                 : "l"(at)
                 : "memory");
    asm volatile("ld.local.v4.b32 {%0, %1, %2, %3}, [%4 + 32];"
                 : "=f"(copy.direction.x), "=f"(copy.direction.y), "=f"(copy.direction.z), "=r"(copy.axis_z)
                 : "l"(at)
                 : "memory");
    return copy;
  }
#else
  const Bvh8ShearedRay& load_local() const { return *this; }
#endif
  // Undoes the permutation of axes.
  OCTRAD_HD Vec3f turned(Vec3f v) const {
    return axis_z == 2 ? v : (axis_z == 1 ? Vec3f{v.y, v.z, v.x} : Vec3f{v.z, v.x, v.y});
  }
};

// False for a direction without length or that is not finite, and for an origin beyond 4 kBvh8Largest, where floats are
// too coarse; such a ray meets nothing. The direction need not have unit length; components below 2^-24 of the largest
// are raised to that for the boxes, and what this moves is part of the slack. Directions so short or long that
// distances on the grids could overflow or lose digits meet all boxes: slow, but right.
OCTRAD_HD inline bool make_bvh8_ray(Vec3f origin, Vec3f direction, Bvh8Ray& ray, Bvh8Slack& slack,
                                    Bvh8ShearedRay& sheared) {
  const Vec3f size{std::fabs(direction.x), std::fabs(direction.y), std::fabs(direction.z)};
  const float largest = max_component(size);
  const Vec3f away{std::fabs(origin.x), std::fabs(origin.y), std::fabs(origin.z)};
  if (!(largest > 0.0f) || !is_finite(direction)) return false;
  if (!(away.x <= 4.0f * kBvh8Largest && away.y <= 4.0f * kBvh8Largest && away.z <= 4.0f * kBvh8Largest)) return false;
  const bool usual = largest >= 9.313226e-10f && largest <= kBvh8Largest;
  ray.origin = origin;
  ray.order = 31u;
  const float least = greater(largest * 5.9604645e-8f, 1.1754944e-38f);
  OCTRAD_UNROLL
  for (int k = 0; k < 3; ++k) {
    const bool raised = size[k] < least;
    const float component = raised ? std::copysign(least, direction[k]) : direction[k];
    ray.inverse[k] = usual ? 1.0f / component : 0.0f;
    slack.widening[k] = raised ? 1.0f + kBvh8Widening : kBvh8Widening;
    if (component < 0.0f) ray.order &= ~(1u << k);
  }
  slack.longest = size.x >= size.y ? (size.x >= size.z ? 0u : 2u) : (size.y >= size.z ? 1u : 2u);
  sheared.axis_z = slack.longest;
  sheared.axis_x = sheared.axis_z == 2 ? 0 : sheared.axis_z + 1;
  sheared.axis_y = sheared.axis_x == 2 ? 0 : sheared.axis_x + 1;
  const int x = static_cast<int>(sheared.axis_x), y = static_cast<int>(sheared.axis_y),
            z = static_cast<int>(sheared.axis_z);
  sheared.position = {origin[x], origin[y], origin[z]};
  const Vec3f d{direction[x], direction[y], direction[z]};
  sheared.direction = d;
  sheared.shear = {d.x / d.z, d.y / d.z, 1.0f / d.z};
  return true;
}

namespace bvh8_detail {

// A primitive in the order of the ray's axes.
struct Rows {
  Bvh8Row x, y, z;
  OCTRAD_HD Rows(const Bvh8Primitive* primitives, std::uint32_t index, const Bvh8ShearedRay& sheared) {
    const Bvh8Row* rows = primitives->rows;
    x = load(rows + (3 * index + sheared.axis_x));
    y = load(rows + (3 * index + sheared.axis_y));
    z = load(rows + (3 * index + sheared.axis_z));
  }
};

// The corners where the ray is the z axis from 0.
struct Sheared {
  float x[3], y[3], z[3];
  OCTRAD_HD Sheared(const Rows& rows, const Bvh8ShearedRay& sheared) {
    OCTRAD_UNROLL
    for (int i = 0; i < 3; ++i) {
      const float along = rows.z.corner[i] - sheared.position.z;
      x[i] = rows.x.corner[i] - sheared.position.x - multiply(sheared.shear.x, along);
      y[i] = rows.y.corner[i] - sheared.position.y - multiply(sheared.shear.y, along);
      z[i] = multiply(sheared.shear.z, along);
    }
  }
  // Twice the area between the ray and the edge between two corners.
  template <typename T>
  OCTRAD_HD T edge(int a, int b) const {
    return multiply(static_cast<T>(x[a]), static_cast<T>(y[b])) - multiply(static_cast<T>(y[a]), static_cast<T>(x[b]));
  }
};

// Areas opposite to the corners.
template <typename T>
struct Areas {
  T u, v, w;
  OCTRAD_HD explicit Areas(const Sheared& s) : u(s.edge<T>(2, 1)), v(s.edge<T>(0, 2)), w(s.edge<T>(1, 0)) {}
  OCTRAD_HD T sum() const { return u + v + w; }
};

// Rounding keeps the order of two products or makes them equal; where they are equal, or too small to be exact, double
// decides, in which products of floats are exact.
OCTRAD_HD inline bool doubtful(const Areas<float>& a) {
  return lesser(std::fabs(a.u), lesser(std::fabs(a.v), std::fabs(a.w))) < 1e-30f;
}

OCTRAD_HD inline bool inside(const Sheared& s) {
  const Areas<float> areas(s);
  const std::uint32_t u = bits_of(areas.u), signs = (u ^ bits_of(areas.v)) | (u ^ bits_of(areas.w));
  if (!doubtful(areas)) return signs >> 31 == 0;
  const Areas<double> exact(s);
  const double least = lesser(exact.u, lesser(exact.v, exact.w)), most = greater(exact.u, greater(exact.v, exact.w));
  return !(least < 0.0 && most > 0.0) && exact.sum() != 0.0;
}

// Distance to the triangle's plane, in double: in float, long and grazed triangles have errors far above rounding, a
// ray that starts on a surface may meet it again, and which of two near surfaces is met would differ between devices.
OCTRAD_HD inline double plane_distance(const Rows& rows, const Sheared& s, const Bvh8ShearedRay& sheared) {
  const Vec3d a(Vec3f(rows.x.corner[0], rows.y.corner[0], rows.z.corner[0]));
  const Vec3d b(Vec3f(rows.x.corner[1], rows.y.corner[1], rows.z.corner[1]));
  const Vec3d c(Vec3f(rows.x.corner[2], rows.y.corner[2], rows.z.corner[2]));
  const Vec3d n = cross(b - a, c - a);
  const double facing = dot(n, Vec3d(sheared.direction));
  if (facing != 0.0) return dot(n, a - Vec3d(sheared.position)) / facing;
  const Areas<double> areas(s);
  const Vec3d z(Vec3f(s.z[0], s.z[1], s.z[2]));
  return dot(Vec3d(areas.u, areas.v, areas.w), z) / areas.sum();
}

// Weights of the second and third corner.
template <typename T>
OCTRAD_HD inline void set_weights(const Areas<T>& areas, Hit& hit) {
  const T area = areas.sum();
  hit.u = static_cast<float>(areas.v / area);
  hit.v = static_cast<float>(areas.w / area);
}

}  // namespace bvh8_detail

// Whether the ray meets the primitive, and where. Both sides; edges and corners belong to the triangle. Distances in
// (t_min, t_max] for triangles and [t_min, t_max] for spheres, as Embree's.
OCTRAD_HD inline bool bvh8_meets(const Bvh8Primitive* primitives, std::uint32_t index, const Bvh8ShearedRay& sheared,
                                 float t_min, float t_max, float& t) {
  using namespace bvh8_detail;
  const Rows rows(primitives, index, sheared);
  if ((rows.x.id & kBvh8Sphere) != 0) {
    const Bvh8Row* row = primitives[index].rows;
    const double at =
        intersect_sphere({row[0].corner[0], row[1].corner[0], row[2].corner[0]}, row[0].corner[1],
                         sheared.turned(sheared.position), sheared.turned(sheared.direction), t_min, t_max);
    t = static_cast<float>(at);
    return at >= 0.0;
  }
  const Sheared s(rows, sheared);
  if (!inside(s)) return false;
  // The distances of the corners bound that of the plane (rays nearly inside it).
  const float lower = lesser(s.z[0], lesser(s.z[1], s.z[2])), upper = greater(s.z[0], greater(s.z[1], s.z[2]));
  const float rounding = 4e-7f * greater(std::fabs(lower), std::fabs(upper));
  const float first = lower - rounding, last = upper + rounding;
  if (!(first <= t_max && last > t_min)) return false;
  t = lesser(greater(static_cast<float>(plane_distance(rows, s, sheared)), first), last);
  return t > t_min && t <= t_max;
}

// Whether the ray passes the primitive wherever it meets it: from inside a curve. Apart: inlined, it changes what the
// compiler keeps in registers in kernels of scenes without curves.
OCTRAD_HD_APART_ON_DEVICE inline bool bvh8_passes(const Bvh8Primitive& p, const Bvh8ShearedRay& sheared) {
  using bvh8_detail::multiply;
  if ((p.rows[0].id & kBvh8OneSided) == 0) return false;
  const auto across = [](const Bvh8Row& a, const Bvh8Row& b) {
    return multiply(a.corner[1] - a.corner[0], b.corner[2] - b.corner[0]) -
           multiply(b.corner[1] - b.corner[0], a.corner[2] - a.corner[0]);
  };
  const Vec3f d = sheared.turned(sheared.direction);
  const float along = multiply(across(p.rows[1], p.rows[2]), d.x) + multiply(across(p.rows[2], p.rows[0]), d.y) +
                      multiply(across(p.rows[0], p.rows[1]), d.z);
  return ((p.rows[2].id & 1u) != 0 ? -along : along) > 0.0f;
}

// The record of a hit at distance t that bvh8_meets found.
OCTRAD_HD inline Hit bvh8_hit(const Bvh8Primitive* primitives, std::uint32_t index, const Bvh8ShearedRay& sheared,
                              float t) {
  using namespace bvh8_detail;
  const Bvh8Primitive& p = primitives[index];
  Hit hit;
  hit.shape = p.shape();
  hit.primitive = p.primitive();
  hit.t = t;
  if (p.sphere()) return hit;
  const Sheared s(Rows(primitives, index, sheared), sheared);
  const Areas<float> areas(s);
  if (doubtful(areas)) {
    set_weights(Areas<double>(s), hit);
  } else {
    set_weights(areas, hit);
  }
  return hit;
}

}  // namespace octrad
