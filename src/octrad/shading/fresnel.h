// Reflection and refraction at smooth boundaries (Born & Wolf, "Principles of Optics"; d'Eon & Irving 2011).
#pragma once

#include "octrad/base/vec.h"

namespace octrad {

struct DielectricFresnel {
  float reflectance;      // unpolarised power reflectance
  float cos_transmitted;  // of the refracted direction, sign opposite to cos_incident; 0 at total internal reflection
  float eta_it;           // relative index along the path: transmitted side over incident side
  float eta_ti;
};

// `cos_incident` > 0 outside, < 0 inside; `eta` = inside index / outside index.
OCTRAD_HD inline DielectricFresnel fresnel_dielectric(float cos_incident, float eta) {
  const bool outside = cos_incident >= 0.0f;
  const float eta_it = outside ? eta : 1.0f / eta;
  const float eta_ti = outside ? 1.0f / eta : eta;
  const float cos_t_squared = 1.0f - (1.0f - cos_incident * cos_incident) * eta_ti * eta_ti;
  const float cos_i = std::fabs(cos_incident);
  const float cos_t = std::sqrt(cos_t_squared > 0.0f ? cos_t_squared : 0.0f);
  const float rs = (cos_i - eta_it * cos_t) / (cos_i + eta_it * cos_t);
  const float rp = (cos_t - eta_it * cos_i) / (cos_t + eta_it * cos_i);
  float r = 0.5f * (rs * rs + rp * rp);
  if (eta == 1.0f) r = 0.0f;
  else if (cos_i == 0.0f) r = 1.0f;
  return {r, outside ? -cos_t : cos_t, eta_it, eta_ti};
}

// Refracts `w` (pointing away from the surface) about the unit normal `m`; cos_transmitted and eta_ti from
// fresnel_dielectric.
OCTRAD_HD inline Vec3f refract(Vec3f w, Vec3f m, float cos_transmitted, float eta_ti) {
  return m * (dot(w, m) * eta_ti + cos_transmitted) - w * eta_ti;
}

// One channel of a conductor with complex index eta + i k, from outside.
OCTRAD_HD inline float fresnel_conductor(float cos_incident, float eta, float k) {
  const float cos2 = cos_incident * cos_incident, sin2 = 1.0f - cos2, sin4 = sin2 * sin2;
  const float t0 = eta * eta - k * k - sin2;
  const float d = t0 * t0 + 4.0f * k * k * eta * eta;
  const float a2_plus_b2 = std::sqrt(d > 0.0f ? d : 0.0f);
  const float h = 0.5f * (a2_plus_b2 + t0);
  const float a = std::sqrt(h > 0.0f ? h : 0.0f);
  const float t1 = a2_plus_b2 + cos2, t2 = 2.0f * cos_incident * a;
  const float rs = (t1 - t2) / (t1 + t2);
  const float t3 = a2_plus_b2 * cos2 + sin4, t4 = t2 * sin2;
  const float rp = t3 + t4 > 0.0f ? rs * (t3 - t4) / (t3 + t4) : rs;
  return 0.5f * (rs + rp);
}

OCTRAD_HD inline Vec3f fresnel_conductor(float cos_incident, Vec3f eta, Vec3f k) {
  return {fresnel_conductor(cos_incident, eta.x, k.x), fresnel_conductor(cos_incident, eta.y, k.y),
          fresnel_conductor(cos_incident, eta.z, k.z)};
}

// Mean reflectance of a smooth dielectric boundary under diffuse light: the polynomial fits of Egan & Hilgeman 1973
// (eta < 1) and d'Eon & Irving 2011 (eta >= 1), as Mitsuba uses them.
OCTRAD_HD inline float fresnel_diffuse_reflectance(float eta) {
  const float r = 1.0f / eta;
  if (eta < 1.0f) return 0.0636f * r + (eta * (eta * -1.4399f + 0.7099f) + 0.6681f);
  return 0.919317f + r * (-3.4793f + r * (6.75335f + r * (-7.80989f + r * (4.98554f + r * -1.36881f))));
}

}  // namespace octrad
