// What surrounds the decoder network of every field, for one point (method sections 1, 5, 6 and 7; paper equations 12
// and 13): the network's inputs, radiance from its linear outputs, and the loss. The
// definition: called by the CPU and by kernels.
#pragma once

#include <cmath>

#include "octrad/base/surface_point.h"
#include "octrad/model/choices.h"

namespace octrad {

// A coordinate beyond [-1, 1] drawn into (-2, 2), smoothly (Barron et al. 2022, "Mip-NeRF 360", for one axis).
OCTRAD_HD inline float contract(float x) {
  const float size = std::fabs(x);
  return size <= 1.0f ? x : std::copysign(2.0f - 1.0f / size, x);
}
OCTRAD_HD inline Vec3f contract(Vec3f p) { return {contract(p.x), contract(p.y), contract(p.z)}; }

inline constexpr int kPointInputs = 13;  // x (3), w (3), n (3), albedo (3), alpha (1)

struct DecoderRules {
  Activation activation = Activation::exp;
  Activation glossy_activation = Activation::exp;  // of points below rough_threshold
  LossNormalizer normalizer = LossNormalizer::prediction;
  float loss_power = 2.0f;        // LossWeight::power; its unit is the exposure
  float demodulate_from = 1e30f;  // alpha from which the network predicts radiance / albedo
  float rough_threshold = 0.5f;
  float chroma = 0.0f;      // weight of the loss of colours without brightness; 0: it is not computed
  bool normalized = false;  // positions: [-1, 1] in the domain, contracted outside, or world units
  Vec3f position_scale{1.0f, 1.0f, 1.0f}, position_offset;  // normalized: x * scale + offset is in [-1, 1]

  OCTRAD_HD Activation activation_at(float alpha) const {
    return alpha < rough_threshold ? glossy_activation : activation;
  }
  OCTRAD_HD Vec3f position(Vec3f x) const {
    const Vec3f p = x * position_scale + position_offset;
    return normalized ? contract(p) : p;
  }
};

// out[0 .. kPointInputs - 1]
OCTRAD_HD inline void decoder_inputs(const DecoderRules& rules, const SurfacePoint& p, Vec3f w, float* out) {
  const Vec3f x = rules.position(p.x);
  out[0] = x.x;
  out[1] = x.y;
  out[2] = x.z;
  out[3] = w.x;
  out[4] = w.y;
  out[5] = w.z;
  out[6] = p.n.x;
  out[7] = p.n.y;
  out[8] = p.n.z;
  out[9] = p.albedo.x;
  out[10] = p.albedo.y;
  out[11] = p.albedo.z;
  out[12] = p.alpha;
}

// Exposure times demodulation.
OCTRAD_HD inline Vec3f decoder_factor(const DecoderRules& rules, Vec3f albedo, float alpha, float target_scale) {
  if (alpha < rules.demodulate_from) return Vec3f(target_scale);
  return albedo * target_scale;
}

// Radiance of a point from its linear outputs.
OCTRAD_HD inline Vec3f decoder_radiance(const DecoderRules& rules, Vec3f albedo, float alpha, Vec3f linear,
                                        float target_scale) {
  const Activation activation = rules.activation_at(alpha);
  const Vec3f factor = decoder_factor(rules, albedo, alpha, target_scale);
  Vec3f radiance;
  OCTRAD_UNROLL
  for (int c = 0; c < 3; ++c) radiance[c] = factor[c] * activate(activation, linear[c]).value;
  return radiance;
}

// Loss of one channel and its gradient at the linear output, times `norm`; `target_scale`: the exposure.
OCTRAD_HD inline LossTerm<float> decoder_loss(const DecoderRules& rules, Activation activation, float factor,
                                              float linear, float target, float epsilon, float target_scale,
                                              float norm) {
  const Activated<float> output = activate(activation, linear);
  LossTerm<float> term =
      relative_squared_loss(factor * output.value, target, epsilon, rules.normalizer, {rules.loss_power, target_scale});
  term.gradient = term.gradient * factor * output.derivative * norm;
  if (!term.finite || !std::isfinite(term.gradient)) {
    term.gradient = 0.0f;
    term.finite = false;
  }
  return term;
}

// Loss of a point of roughness `alpha` from its linear outputs, and the gradient there, times `norm`.
struct PointLoss {
  float value[3];
  float chroma;  // already times its weight
  float gradient[3];
  int dropped;  // channels with something that is not finite
};
OCTRAD_HD inline PointLoss decoder_point_loss(const DecoderRules& rules, Vec3f albedo, float alpha, Vec3f linear,
                                              Vec3f target, float epsilon, float target_scale, float norm) {
  const Activation activation = rules.activation_at(alpha);
  const Vec3f factor = decoder_factor(rules, albedo, alpha, target_scale);
  const float chroma = rules.chroma;
  PointLoss loss{};
  Vec3f prediction, slope;
  OCTRAD_UNROLL
  for (int c = 0; c < 3; ++c) {
    const LossTerm<float> term =
        decoder_loss(rules, activation, factor[c], linear[c], target[c], epsilon, target_scale, norm);
    loss.value[c] = term.value;
    loss.gradient[c] = term.gradient;
    loss.dropped += term.finite ? 0 : 1;
    if (!(chroma > 0.0f)) continue;
    const Activated<float> output = activate(activation, linear[c]);
    prediction[c] = factor[c] * output.value;
    slope[c] = factor[c] * output.derivative;
  }
  if (!(chroma > 0.0f)) return loss;
  const ChromaTerm<float> term = chroma_loss(prediction, target, epsilon);
  const Vec3f gradient = term.gradient * slope * (chroma * norm);
  if (!std::isfinite(term.value) || !is_finite(gradient)) return loss;  // counted above
  loss.chroma = chroma * term.value;
  OCTRAD_UNROLL
  for (int c = 0; c < 3; ++c) loss.gradient[c] += gradient[c];
  return loss;
}

}  // namespace octrad
