#include "octrad/model/decoder_head.h"

namespace octrad {
namespace {

// Of point i, from [3][stride].
Vec3f outputs_at(const float* linear, int stride, std::size_t i) {
  const auto row = static_cast<std::size_t>(stride);
  return {linear[i], linear[row + i], linear[2 * row + i]};
}

}  // namespace

DecoderHead::DecoderHead(const Config& config, const MlpShape& shape, Activation activation, Vec3f origin, Vec3f size,
                         unsigned long long stream)
    : mlp_(shape) {
  rules_.activation = rules_.glossy_activation = activation;
  rules_.normalizer = config.loss_normalizer;
  rules_.loss_power = static_cast<float>(config.loss_power);
  // Emission does not scale with albedo; nor does a coated surface as a whole, while each of its lobes does.
  if (config.target_emission == TargetEmission::outside && config.target_demodulate == TargetDemodulation::albedo)
    rules_.demodulate_from = split_coats(config) ? 0.0f : static_cast<float>(config.lookup_rough_threshold);
  rules_.rough_threshold = static_cast<float>(config.lookup_rough_threshold);
  rules_.normalized = config.decoder_position == DecoderPosition::normalized;
  unit_scale_ = Vec3f(2.0f) / size;
  unit_offset_ = Vec3f(-1.0f) - origin * unit_scale_;
  if (rules_.normalized) {
    rules_.position_scale = unit_scale_;
    rules_.position_offset = unit_offset_;
  }
  mlp_.initialize(static_cast<unsigned long long>(config.seed), stream);
  mlp_.prepare();
}

DecoderRules DecoderHead::half_rules() const {
  DecoderRules rules = rules_;
  rules.position_scale = unit_scale_;
  rules.position_offset = unit_offset_;
  return rules;
}

MlpInputMap DecoderHead::input_map(int first) const {
  return rules_.normalized ? MlpInputMap{} : MlpInputMap{first, unit_scale_, unit_offset_};
}

void DecoderHead::fill_inputs(std::span<const SurfacePoint> points, const Vec3f* directions, float* inputs, int first,
                              int stride) const {
  float* row[kPointInputs];
  for (int r = 0; r < kPointInputs; ++r) row[r] = inputs + static_cast<std::ptrdiff_t>(first + r) * stride;
  for (std::size_t i = 0; i < points.size(); ++i) {
    float numbers[kPointInputs];
    decoder_inputs(rules_, points[i], directions[i], numbers);
    for (int r = 0; r < kPointInputs; ++r) row[r][i] = numbers[r];
  }
}

void DecoderHead::activate(std::span<const SurfacePoint> points, const float* linear, int stride,
                           Vec3f* radiance) const {
  for (std::size_t i = 0; i < points.size(); ++i) {
    radiance[i] =
        decoder_radiance(rules_, points[i].albedo, points[i].alpha, outputs_at(linear, stride, i), target_scale_);
  }
}

double DecoderHead::loss(std::span<const SurfacePoint> points, std::span<const Vec3f> targets, const float* linear,
                         int stride, std::size_t batch, double epsilon, float* d_linear, long long& non_finite) const {
  double total = 0.0;
  const float norm = 1.0f / (3.0f * static_cast<float>(batch));
  const std::ptrdiff_t row = stride;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const PointLoss loss = decoder_point_loss(rules_, points[i].albedo, points[i].alpha, outputs_at(linear, stride, i),
                                              targets[i], static_cast<float>(epsilon), target_scale_, norm);
    for (int c = 0; c < 3; ++c) {
      total += static_cast<double>(loss.value[c]);
      d_linear[c * row + static_cast<std::ptrdiff_t>(i)] = loss.gradient[c];
    }
    total += static_cast<double>(loss.chroma);
    non_finite += loss.dropped;
  }
  return total;
}

}  // namespace octrad
