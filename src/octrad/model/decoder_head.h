// The last part of every field: the decoder MLP over [encoding, position, direction, normal, albedo, roughness], its
// output activation, exposure and albedo demodulation, loss and gradient (method sections 5-7).
#pragma once

#include <span>

#include "octrad/base/surface_point.h"
#include "octrad/model/config.h"
#include "octrad/model/decoder_math.h"
#include "octrad/network/activations_math.h"
#include "octrad/network/loss_math.h"
#include "octrad/network/mlp.h"
#include "octrad/network/mlp_input_map.h"

namespace octrad {

class DecoderHead {
 public:
  // shape: kPointInputs of its inputs are the point's own, and it has 3 outputs.
  DecoderHead(const Config& config, const MlpShape& shape, Activation activation, Vec3f origin, Vec3f size,
              unsigned long long stream);

  // Fills rows [first, first + 13) of the feature-major inputs [rows][stride].
  void fill_inputs(std::span<const SurfacePoint> points, const Vec3f* directions, float* inputs, int first,
                   int stride) const;
  // Radiance from the linear outputs [3][stride].
  void activate(std::span<const SurfacePoint> points, const float* linear, int stride, Vec3f* radiance) const;
  // Loss summed over points and channels, and its gradient (scaled by 1 / (3 batch)) at the linear outputs [3][stride].
  double loss(std::span<const SurfacePoint> points, std::span<const Vec3f> targets, const float* linear, int stride,
              std::size_t batch, double epsilon, float* d_linear, long long& non_finite) const;

  Mlp& mlp() { return mlp_; }
  const Mlp& mlp() const { return mlp_; }
  void set_target_scale(float scale) { target_scale_ = scale; }
  float target_scale() const { return target_scale_; }
  const DecoderRules& rules() const { return rules_; }
  // In constructors of fields: for points below the roughness of the rules, and the weight of the chroma loss.
  void set_glossy_activation(Activation activation) { rules_.glossy_activation = activation; }
  void set_chroma(float weight) { rules_.chroma = weight; }
  // For devices, whose networks are given halves: positions come in [-1, 1] of the domain even where the network is one
  // of world units (not contracted then), and `input_map` is what makes up for that, the first position being input
  // number `first`. Halves of coordinates in centimetres, or far from 0, would be steps of their own size / 2048.
  DecoderRules half_rules() const;
  MlpInputMap input_map(int first) const;

 private:
  Mlp mlp_;
  DecoderRules rules_;
  Vec3f unit_scale_, unit_offset_;  // x * scale + offset is in [-1, 1] of the domain
  float target_scale_ = 1.0f;
};

}  // namespace octrad
