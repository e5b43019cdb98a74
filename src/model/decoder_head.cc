#include "model/decoder_head.h"

#include <algorithm>
#include <cmath>


namespace octrad {

LookupRule lookup_rule(const Config& config) {
  LookupRule rule;
  rule.mirror = config.lookup_direction == "mirror";
  rule.rough = config.lookup_rough_direction == "normal" ? RoughDirection::normal : RoughDirection::mirror;
  rule.rough_threshold = static_cast<float>(config.lookup_rough_threshold);
  return rule;
}

Vec3f lookup_direction(const LookupRule& rule, const SurfacePoint& point) {
  if (point.alpha >= rule.rough_threshold && rule.rough == RoughDirection::normal) return point.n;
  return rule.mirror ? reflect(point.wo, point.n) : point.wo;
}

Activation output_activation(const std::string& name) {
  if (name == "exp") return Activation::exp;
  return name == "abs" ? Activation::abs : Activation::squareplus;
}

DecoderHead::DecoderHead(const Config& config, int encoding_features, int width, int hidden, Activation activation,
                         Vec3f origin, Vec3f size, unsigned long long stream)
    : mlp_(MlpShape{encoding_features + kPointInputs, width, hidden, 3}),
      adam_(mlp_.parameter_count(), adam_options(config)),
      activation_(activation),
      normalizer_(config.loss_normalizer == "symmetric" ? LossNormalizer::symmetric : LossNormalizer::prediction),
      demodulate_(config.target_demodulate == "albedo" && config.target_emission == "outside"),  // emission does not scale with albedo
      rough_threshold_(static_cast<float>(config.lookup_rough_threshold)),
      position_scale_(1.0f, 1.0f, 1.0f) {
  if (config.decoder_position == "normalized") {
    position_scale_ = Vec3f(2.0f) / size;
    position_offset_ = Vec3f(-1.0f) - origin * position_scale_;
  }
  mlp_.initialize(static_cast<unsigned long long>(config.seed), stream);
  mlp_.prepare();
}

void DecoderHead::fill_inputs(std::span<const SurfacePoint> points, const Vec3f* directions, float* inputs, int first, int stride) const {
  float* row[kPointInputs];
  for (int r = 0; r < kPointInputs; ++r) row[r] = inputs + static_cast<std::ptrdiff_t>(first + r) * stride;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const SurfacePoint& p = points[i];
    const Vec3f x = p.x * position_scale_ + position_offset_;
    const Vec3f w = directions[i];
    row[0][i] = x.x; row[1][i] = x.y; row[2][i] = x.z;
    row[3][i] = w.x; row[4][i] = w.y; row[5][i] = w.z;
    row[6][i] = p.n.x; row[7][i] = p.n.y; row[8][i] = p.n.z;
    row[9][i] = p.albedo.x; row[10][i] = p.albedo.y; row[11][i] = p.albedo.z;
    row[12][i] = p.alpha;
  }
  for (std::size_t i = points.size(); i < static_cast<std::size_t>(stride); ++i) {
    for (int r = 0; r < kPointInputs; ++r) row[r][i] = 0.0f;
  }
}

Vec3f DecoderHead::factor(const SurfacePoint& point) const {
  if (!demodulate_ || point.alpha < rough_threshold_) return Vec3f(target_scale_);
  return point.albedo * target_scale_;
}

void DecoderHead::activate(std::span<const SurfacePoint> points, const float* linear, int stride, Vec3f* radiance) const {
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3f f = factor(points[i]);
    for (int c = 0; c < 3; ++c) radiance[i][c] = f[c] * octrad::activate(activation_, linear[static_cast<std::size_t>(c * stride) + i]).value;
  }
}

double DecoderHead::loss(std::span<const SurfacePoint> points, std::span<const Vec3f> targets, const float* linear, int stride,
                         std::size_t batch, double epsilon, float* d_linear, long long& non_finite) const {
  double total = 0.0;
  const float norm = 1.0f / (3.0f * static_cast<float>(batch));
  for (int c = 0; c < 3; ++c) {
    const float* in = linear + static_cast<std::ptrdiff_t>(c) * stride;
    float* out = d_linear + static_cast<std::ptrdiff_t>(c) * stride;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const float f = factor(points[i])[c];
      const Activated<float> output = octrad::activate(activation_, in[i]);
      const LossTerm<float> term = relative_squared_loss(f * output.value, targets[i][c], static_cast<float>(epsilon), normalizer_);
      total += static_cast<double>(term.value);
      out[i] = term.gradient * f * output.derivative * norm;
      if (!term.finite || !std::isfinite(out[i])) {
        out[i] = 0.0f;
        ++non_finite;
      }
    }
    for (int i = static_cast<int>(points.size()); i < stride; ++i) out[i] = 0.0f;
  }
  return total;
}

}  // namespace octrad
