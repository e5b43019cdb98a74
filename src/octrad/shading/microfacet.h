// Beckmann and GGX distributions of microfacet normals with Smith's separable shadowing
// (Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces").
#pragma once

#include "octrad/scene/material_types.h"
#include "octrad/shading/square_maps.h"

namespace octrad {

// Inverse of the error function, |x| < 1: M. Giles 2010, "Approximating the erfinv function", single precision.
OCTRAD_HD inline float erf_inverse(float x) {
  float w = -std::log((1.0f - x) * (1.0f + x));
  float p;
  if (w < 5.0f) {
    w -= 2.5f;
    p = 2.81022636e-08f;
    p = 3.43273939e-07f + p * w;
    p = -3.5233877e-06f + p * w;
    p = -4.39150654e-06f + p * w;
    p = 0.00021858087f + p * w;
    p = -0.00125372503f + p * w;
    p = -0.00417768164f + p * w;
    p = 0.246640727f + p * w;
    p = 1.50140941f + p * w;
  } else {
    w = std::sqrt(w) - 3.0f;
    p = -0.000200214257f;
    p = 0.000100950558f + p * w;
    p = 0.00134934322f + p * w;
    p = -0.00367342844f + p * w;
    p = 0.00573950773f + p * w;
    p = -0.0076224613f + p * w;
    p = 0.00943887047f + p * w;
    p = 1.00167406f + p * w;
    p = 2.83297682f + p * w;
  }
  return p * x;
}

struct Microfacet {
  MicrofacetDistribution distribution;
  float alpha_u, alpha_v;
  bool visible;  // sample visible normals (Heitz & d'Eon 2014) instead of D cos

  // Below 1e-4 single precision breaks down; the limit is Mitsuba's.
  OCTRAD_HD Microfacet(MicrofacetDistribution kind, float au, float av, bool sample_visible)
      : distribution(kind),
        alpha_u(au > 1e-4f ? au : 1e-4f),
        alpha_v(av > 1e-4f ? av : 1e-4f),
        visible(sample_visible) {}

  // Density of normals D(m) per projected area.
  OCTRAD_HD float density(Vec3f m) const {
    const float cos2 = m.z * m.z;
    const float x = m.x / alpha_u, y = m.y / alpha_v;
    float d;
    if (distribution == MicrofacetDistribution::beckmann) {
      d = std::exp(-(x * x + y * y) / cos2) / (kPi * alpha_u * alpha_v * cos2 * cos2);
    } else {
      const float e = x * x + y * y + cos2;
      d = 1.0f / (kPi * alpha_u * alpha_v * e * e);
    }
    return d * m.z > 1e-20f ? d : 0.0f;
  }

  // Smith's masking of one direction. Beckmann: the rational fit of Walter et al. 2007.
  OCTRAD_HD float masking(Vec3f w, Vec3f m) const {
    if (dot(w, m) * w.z <= 0.0f) return 0.0f;
    const float a = alpha_u * w.x, b = alpha_v * w.y;
    const float s = a * a + b * b;
    if (s == 0.0f) return 1.0f;
    const float tan2 = s / (w.z * w.z);
    if (distribution == MicrofacetDistribution::beckmann) {
      const float c = 1.0f / std::sqrt(tan2), c2 = c * c;
      return c >= 1.6f ? 1.0f : (3.535f * c + 2.181f * c2) / (1.0f + 2.276f * c + 2.577f * c2);
    }
    return 2.0f / (1.0f + std::sqrt(1.0f + tan2));
  }

  OCTRAD_HD Vec3f sample_normal(Vec3f w, Vec2f u) const {
    if (!visible) return sample_all(u);
    const Vec3f p = normalize(Vec3f(alpha_u * w.x, alpha_v * w.y, w.z));  // stretched: unit roughness
    return distribution == MicrofacetDistribution::ggx ? unstretch(sample_visible_ggx(p, u))
                                                       : sample_visible_beckmann(p, u);
  }

 private:
  OCTRAD_HD Vec3f unstretch(Vec3f h) const {
    return normalize(Vec3f(alpha_u * h.x, alpha_v * h.y, h.z > 1e-9f ? h.z : 1e-9f));
  }

  // Dupuy & Benyoub 2023, "Sampling Visible GGX Normals with Spherical Caps".
  OCTRAD_HD static Vec3f sample_visible_ggx(Vec3f p, Vec2f u) {
    const float z = (1.0f - u.y) * (1.0f + p.z) - p.z;
    const float r2 = 1.0f - z * z;
    const Vec2f across = circle_point(u.x) * std::sqrt(r2 > 0.0f ? r2 : 0.0f);
    return Vec3f(across.x, across.y, z) + p;
  }

  // Slopes of unit roughness seen from p: along p's azimuth the density is (1 - s tan) exp(-s^2) for s < cot, whose
  // integral is inverted in x = erf(s) by Newton steps kept inside a bracket; across it the slope is normal.
  OCTRAD_HD Vec3f sample_visible_beckmann(Vec3f p, Vec2f u) const {
    const float sin2 = p.x * p.x + p.y * p.y;
    const float sin_theta = std::sqrt(sin2);
    const float cos_phi = sin_theta > 0.0f ? p.x / sin_theta : 1.0f,
                sin_phi = sin_theta > 0.0f ? p.y / sin_theta : 0.0f;
    constexpr float kInvSqrtPi = 0.56418958354775628695f;
    constexpr float kEdge = 0.9999999f;
    float slope;
    if (sin_theta < 1e-4f) {
      const float e = 2.0f * u.x - 1.0f;
      slope = erf_inverse(e < -kEdge ? -kEdge : (e > kEdge ? kEdge : e));
    } else {
      const float tangent = sin_theta / p.z, cotangent = p.z / sin_theta;
      const float top = std::erf(cotangent);
      const float total = 1.0f + top + kInvSqrtPi * tangent * std::exp(-cotangent * cotangent);
      const float v = (u.x < 1e-6f ? 1e-6f : (u.x > 1.0f - 1e-6f ? 1.0f - 1e-6f : u.x)) * total;
      float low = -kEdge, high = top < kEdge ? top : kEdge;
      float x = low + (high - low) * u.x;
      for (int i = 0; i < 12; ++i) {
        const float s = erf_inverse(x);
        const float f = 1.0f + x + kInvSqrtPi * tangent * std::exp(-s * s) - v;
        if (f > 0.0f) high = x;
        else low = x;
        if (std::fabs(f) < 1e-6f * total) break;
        float next = x - f / (1.0f - s * tangent);
        if (!(next > low && next < high)) next = 0.5f * (low + high);
        x = next;
      }
      slope = erf_inverse(x < -kEdge ? -kEdge : (x > kEdge ? kEdge : x));
    }
    const float e = 2.0f * u.y - 1.0f;
    const float across = erf_inverse(e < -kEdge ? -kEdge : (e > kEdge ? kEdge : e));
    const float sx = (cos_phi * slope - sin_phi * across) * alpha_u;
    const float sy = (sin_phi * slope + cos_phi * across) * alpha_v;
    return normalize(Vec3f(-sx, -sy, 1.0f));
  }

  // Density D cos (Walter et al. 2007, equations 28-29 and 35-36, stretched for anisotropy).
  OCTRAD_HD Vec3f sample_all(Vec2f u) const {
    float r;  // length of the slope at unit roughness
    if (distribution == MicrofacetDistribution::beckmann) {
      r = std::sqrt(-std::log(1.0f - u.x));
    } else {
      r = std::sqrt(u.x / (1.0f - u.x));
    }
    const Vec2f around = circle_point(u.y);
    return normalize(Vec3f(r * around.x * alpha_u, r * around.y * alpha_v, 1.0f));
  }
};

}  // namespace octrad
