// Fibres of hair and fur (Chiang et al. 2016, "A Practical and Controllable Hair and Fur Model for Production Path
// Tracing", after Marschner et al. 2003 and d'Eon et al. 2011) as Mitsuba's `hair` has them. Light is reflected at the
// surface (p = 0), crosses the fibre (1), or is reflected inside once (2) or more often (3) before it leaves; it leaves
// where it came in. Not reciprocal.
//
// The fibre runs along the local y axis. theta is the angle of a direction to the plane across the fibre, phi the angle
// in that plane from x to the normal z. `wo` in the code is where the paper has omega_i, and the other way round:
// values are of light that is followed from the viewer.
#pragma once

#include "octrad/shading/bsdf/principled.h"

namespace octrad {

inline constexpr int kHairPaths = 4;  // p = 0, 1, 2 and all others

// What a path through the fibre leaves of light, A_p (Marschner et al.; all that comes after p = 2: Chiang et al.).
struct HairAttenuation {
  Vec3f a[kHairPaths];
  float gamma_t;  // angle inside between direction and normal, in the plane across the fibre

  // `transmittance`: of one radius of the fibre. `h`: where the fibre is met, from -1 to 1 across it, the sine of the
  // angle gamma to the normal there.
  OCTRAD_HD HairAttenuation(Vec3f transmittance, float eta, float sin_theta, float cos_theta, float h,
                            float cos_gamma) {
    const float across = std::sqrt(greater(eta * eta - sin_theta * sin_theta, 1e-12f)) / greater(cos_theta, 1e-6f);
    const float sin_gamma_t = lesser(greater(h / across, -1.0f), 1.0f);
    const float cos_gamma_t = std::sqrt(1.0f - sin_gamma_t * sin_gamma_t);
    const float sin_theta_t = sin_theta / eta;
    const float cos_theta_t = std::sqrt(greater(1.0f - sin_theta_t * sin_theta_t, 1e-12f));
    const float chord = 2.0f * cos_gamma_t / cos_theta_t;  // in radii
    gamma_t = std::asin(sin_gamma_t);
    const float f = fresnel_dielectric(cos_theta * cos_gamma, eta).reflectance;
    a[0] = Vec3f(f);
    for (int c = 0; c < 3; ++c) {
      const float t = std::pow(transmittance[c], chord);
      a[1][c] = (1.0f - f) * (1.0f - f) * t;
      a[2][c] = a[1][c] * t * f;
      a[3][c] = a[2][c] * t * f / greater(1.0f - t * f, 1e-7f);
    }
  }
};

// exp(-x) times the modified Bessel function of the first kind and order 0, x >= 0 (Abramowitz & Stegun 1964, 9.8.1
// and 9.8.2; relative error 5e-7).
OCTRAD_HD inline float scaled_bessel_i0(float x) {
  if (x < 3.75f) {
    const float t = x / 3.75f, y = t * t;
    return std::exp(-x) *
           (1.0f + y * (3.5156229f +
                        y * (3.0899424f + y * (1.2067492f + y * (0.2659732f + y * (0.0360768f + y * 0.0045813f))))));
  }
  const float y = 3.75f / x;
  return (0.39894228f +
          y * (0.01328592f +
               y * (0.00225319f +
                    y * (-0.00157565f +
                         y * (0.00916281f +
                              y * (-0.02057706f + y * (0.02635537f + y * (-0.01647633f + y * 0.00392377f)))))))) /
         std::sqrt(x);
}

// Longitudinal scattering, M_p (d'Eon et al.): density in solid angle over the density in phi.
OCTRAD_HD inline float hair_longitudinal(float v, float sin_o, float cos_o, float sin_i, float cos_i) {
  const float exponent = (cos_o * cos_i - sin_o * sin_i - 1.0f) / v;
  return std::exp(exponent) * scaled_bessel_i0(cos_o * cos_i / v) / (v * -std::expm1(-2.0f / v));
}

// The logistic density between -pi and pi, and a sample of it (Chiang et al.).
OCTRAD_HD inline float hair_logistic(float x, float s) {
  const float e = std::exp(-std::fabs(x) / s);
  return e / (s * (1.0f + e) * (1.0f + e) * std::tanh(kPi / (2.0f * s)));
}
OCTRAD_HD inline float sample_hair_logistic(float u, float s) {
  const float low = 1.0f / (1.0f + std::exp(kPi / s));
  const float x = -s * std::log(1.0f / (low + u * std::tanh(kPi / (2.0f * s))) - 1.0f);
  return x < -kPi ? -kPi : (x < kPi ? x : kPi);  // and where the logarithm is infinite
}

OCTRAD_HD inline float power(float x, int n) {
  float product = 1.0f;
  for (; n > 0; n /= 2, x *= x) {
    if (n % 2 == 1) product *= x;
  }
  return product;
}

// Variance of M_0 and scale of the logistic, of roughnesses between 0 and 1 (Chiang et al.).
OCTRAD_HD inline float hair_variance(float roughness) {
  const float b = greater(roughness, 0.02f);
  const float deviation = 0.726f * b + 0.812f * b * b + 3.7f * power(b, 20);
  return deviation * deviation;
}
OCTRAD_HD inline float hair_scale(float roughness) {
  const float b = greater(roughness, 0.02f);
  return 0.62665707f * (0.265f * b + 1.194f * b * b + 5.372f * power(b, 22));  // sqrt(pi / 8)
}

struct HairInput : ExtraParameters {
  Vec3f transmittance;  // of one radius
  float eta;
  OCTRAD_HD explicit HairInput(const Bsdf& b)
      : ExtraParameters(b),
        transmittance(b.specular_transmittance),
        eta(b.eta) {}
};

// All that depends on the direction to the viewer.
struct HairView {
  float variance[kHairPaths], scale;
  float sin_theta[kHairPaths], cos_theta[kHairPaths];  // tilted by the scales on the surface
  float phi, gamma;
  HairAttenuation left;
  float probability[kHairPaths];

  OCTRAD_HD HairView(const HairInput& in, Vec3f wo)
      : scale(hair_scale(in.at(ExtraParameter::azimuthal_roughness))),
        phi(std::atan2(wo.z, wo.x)),
        gamma(std::atan2(-wo.x, wo.z)),
        left(in.transmittance, in.eta, wo.y, cos_of(wo.y), std::sin(gamma), std::fabs(std::cos(gamma))) {
    const float v = hair_variance(in.at(ExtraParameter::roughness));
    variance[0] = v;
    variance[1] = 0.25f * v;
    variance[2] = variance[3] = 4.0f * v;
    const float tilt = in.at(ExtraParameter::scale_tilt) * (kPi / 180.0f), cos = cos_of(wo.y);
    const float turns[kHairPaths] = {-2.0f * tilt, tilt, 4.0f * tilt, 0.0f};
    float sum = 0.0f;
    for (int p = 0; p < kHairPaths; ++p) {
      const float s = std::sin(turns[p]), c = std::cos(turns[p]);
      sin_theta[p] = wo.y * c + cos * s;
      cos_theta[p] = std::fabs(cos * c - wo.y * s);
      probability[p] = luminance(left.a[p]);
      sum += probability[p];
    }
    for (float& share : probability) share /= sum;  // Fresnel's reflectance is above 0
  }
  OCTRAD_HD static float cos_of(float sin) { return std::sqrt(greater(1.0f - sin * sin, 0.0f)); }

  // From phi to where a smooth fibre sends the light of path p < 3.
  OCTRAD_HD float turn(int p) const {
    return 2.0f * static_cast<float>(p) * left.gamma_t - 2.0f * gamma + static_cast<float>(p) * kPi;
  }

  OCTRAD_HD BsdfValue evaluate(Vec3f wi) const {
    const float cos = cos_of(wi.y), turned = std::atan2(wi.z, wi.x) - phi;
    BsdfValue out;
    for (int p = 0; p < kHairPaths; ++p) {
      float density = 0.5f * kInvPi;
      if (p + 1 < kHairPaths) {
        float off = (turned - turn(p)) * (0.5f * kInvPi);
        off -= std::floor(off + 0.5f);
        density = hair_logistic(off * (2.0f * kPi), scale);
      }
      density *= hair_longitudinal(variance[p], sin_theta[p], cos_theta[p], wi.y, cos);
      out.value += left.a[p] * density;
      out.pdf += probability[p] * density;
    }
    return out;
  }
};

OCTRAD_HD_APART inline BsdfValue evaluate_hair(HairInput in, Vec3f wo, Vec3f wi) {
  return HairView(in, wo).evaluate(wi);
}

OCTRAD_HD_APART inline BsdfSample sample_hair(HairInput in, Vec3f wo, float u_lobe, Vec2f u) {
  const HairView view(in, wo);
  int p = 0;
  for (; p + 1 < kHairPaths && u_lobe >= view.probability[p]; ++p) u_lobe -= view.probability[p];
  u_lobe = lesser(u_lobe / view.probability[p], 0.99999994f);
  const float v = view.variance[p], low = std::exp(-2.0f / v);
  const float cos = 1.0f + v * std::log(greater(u.x + (1.0f - u.x) * low, 1e-7f));
  const float across = HairView::cos_of(cos) * std::cos(2.0f * kPi * u.y);
  const float sin_i = across * view.cos_theta[p] - cos * view.sin_theta[p];
  const float turned =
      p + 1 < kHairPaths ? view.turn(p) + sample_hair_logistic(u_lobe, view.scale) : 2.0f * kPi * u_lobe;
  const float cos_i = HairView::cos_of(sin_i), phi = view.phi + turned;
  BsdfSample s;
  s.wi = normalize(Vec3f(cos_i * std::cos(phi), sin_i, cos_i * std::sin(phi)));
  s.transmission = s.wi.z * wo.z < 0.0f;
  s.weigh(view.evaluate(s.wi));
  return s;
}

// Roughness of microfacets that spread directions as much, by the geometric mean of both deviations: half vectors
// deviate by half of what directions do, and alpha is sqrt(2) times that.
OCTRAD_HD_APART inline float hair_alpha(HairInput in) {
  const float around = hair_scale(in.at(ExtraParameter::azimuthal_roughness)) * 1.8137994f;  // pi / sqrt(3)
  const float along = std::sqrt(hair_variance(in.at(ExtraParameter::roughness)));
  return lesser(std::sqrt(0.5f * along * around), kRoughestLobe);
}

// Means across a fibre that is seen at a right angle, by Gauss and Legendre's rule of four points.
OCTRAD_HD_APART inline LobeEnergies hair_energies(HairInput in) {
  LobeEnergies e;
  const float places[] = {0.06943184f, 0.33000948f, 0.66999052f, 0.93056816f};
  for (int i = 0; i < 4; ++i) {
    const float weight = i == 0 || i == 3 ? 0.17392742f : 0.32607258f;
    const float h = places[i];
    const HairAttenuation left(in.transmittance, in.eta, 0.0f, 1.0f, h, std::sqrt(1.0f - h * h));
    for (const Vec3f& a : left.a) e.reflection += a * weight;
  }
  e.alpha = hair_alpha(in);
  return e;
}

struct HairModel {
  static constexpr bool kDeltaOnly = false;

  OCTRAD_HD static BsdfValue evaluate(const Bsdf& b, Vec3f wo, Vec3f wi) { return evaluate_hair(HairInput(b), wo, wi); }
  OCTRAD_HD static BsdfSample sample(const Bsdf& b, Vec3f wo, float u_lobe, Vec2f u) {
    return sample_hair(HairInput(b), wo, u_lobe, u);
  }
  OCTRAD_HD static Vec3f albedo(const Bsdf& b) { return hair_energies(HairInput(b)).albedo(); }
  OCTRAD_HD static float roughness(const Bsdf& b) { return hair_alpha(HairInput(b)); }
};

}  // namespace octrad
