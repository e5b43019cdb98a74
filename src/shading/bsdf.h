// Scattering at one surface point. Directions are in the local shading frame (normal +z), both pointing away from the
// surface; wi is where light is looked for (sampled), wo where the viewer or the previous vertex is.
#pragma once

#include "geometry/tracer.h"
#include "scene/scene.h"

namespace octrad {

// Parameters of a material evaluated at a point: textures looked up, wrappers applied.
struct Bsdf {
  BsdfType type = BsdfType::diffuse;
  MicrofacetDistribution distribution = MicrofacetDistribution::ggx;
  bool two_sided = false;
  bool nonlinear = false;
  bool sample_visible = true;
  float opacity = 1.0f;            // probability of not passing straight through
  float alpha_u = 1.0f, alpha_v = 1.0f;
  float eta = 1.0f;                // int_ior / ext_ior
  Vec3f reflectance{0, 0, 0}, specular_reflectance{1, 1, 1}, specular_transmittance{1, 1, 1};
  Vec3f conductor_eta{0, 0, 0}, conductor_k{1, 1, 1};
};

struct BsdfSample {
  Vec3f wi;                        // local, unit
  Vec3f weight;                    // f cos / pdf (for delta lobes: the lobe's weight / its probability)
  float pdf = 0.0f;                // solid angle; for delta lobes the discrete probability
  bool delta = false;              // perfectly specular lobe
  bool null = false;               // straight through (mask, no interaction)
  bool transmission = false;
  float eta = 1.0f;                // relative index along wi, for Russian roulette (eta^2 scaling)
  bool valid = false;
};

// f(wo, wi) |cos wi| without delta lobes, linear RGB. Zero below the surface for one-sided models.
Vec3f evaluate(const Bsdf& bsdf, Vec3f wo, Vec3f wi);
// Solid-angle density with which sample() draws wi, delta lobes excluded.
float pdf(const Bsdf& bsdf, Vec3f wo, Vec3f wi);
// Draws wi. `u_lobe` picks the lobe, `u` the direction.
BsdfSample sample(const Bsdf& bsdf, Vec3f wo, float u_lobe, Vec2f u);

// Whether the model has only delta (or null) lobes: smooth conductor, dielectric, thin dielectric.
bool is_delta(const Bsdf& bsdf);
// First-hit attributes (method section 1): view-independent albedo, and roughness (1 for diffuse, 0 for smooth).
Vec3f albedo(const Bsdf& bsdf);
float roughness(const Bsdf& bsdf);

// A shaded hit: geometry, frame flipped to the side of wo on two-sided surfaces, bump applied, textures evaluated.
struct ShadingPoint {
  SurfaceInteraction surface;
  Vec3f ns, s, t;                  // shading frame in world space
  Vec3f wo;                        // world
  Bsdf bsdf;
  bool front = true;               // seen from the side of the geometric normal
  bool black = false;              // back of a one-sided opaque surface
  Vec3f to_local(Vec3f v) const { return {dot(v, s), dot(v, t), dot(v, ns)}; }
  Vec3f to_world(Vec3f v) const { return s * v.x + t * v.y + ns * v.z; }
};

ShadingPoint shade(const Scene& scene, const SurfaceInteraction& surface, Vec3f wo);

}  // namespace octrad
