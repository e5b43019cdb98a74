#include "octrad/shading/measured_summary.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "octrad/shading/bsdf_math.h"

namespace octrad {
namespace {

// Mean of the weights of samples: 64 directions to the viewer, uniform in the square of the sine, by 256 samples.
Vec3f mean_reflectance(const MaterialRecord& record) {
  constexpr int kViews = 8, kSamples = 16;
  Vec3d sum(0.0);
  for (int i = 0; i < kViews * kViews; ++i) {
    const float sin2 = (static_cast<float>(i % kViews) + 0.5f) / kViews;
    const float phi = 2.0f * kPi * (static_cast<float>(i / kViews) + 0.5f) / kViews, sin = std::sqrt(sin2);
    const Vec3f wo(sin * std::cos(phi), sin * std::sin(phi), std::sqrt(1.0f - sin2));
    for (int k = 0; k < kSamples * kSamples; ++k) {
      const Vec2f u{(static_cast<float>(k % kSamples) + 0.5f) / kSamples,
                    (static_cast<float>(k / kSamples) + 0.5f) / kSamples};
      const BsdfSample s = sample_measured(record, wo, u);
      if (s.valid) sum += Vec3d(s.weight);
    }
  }
  return Vec3f(sum / static_cast<double>(kViews * kViews * kSamples * kSamples));
}

// Of normals that are as common as D cos(theta) sin(theta) says, the median of tan(theta): alpha for GGX.
float median_slope(const MeasuredView& m) {
  const MeasuredGrid& g = m.layout.normals;
  constexpr int kSteps = 512;
  const int rows = std::min(g.height - 1, kSteps);
  std::vector<double> before(kSteps + 1, 0.0);
  for (int i = 0; i < kSteps; ++i) {
    const float x = (static_cast<float>(i) + 0.5f) / kSteps, theta = 0.5f * kPi * x * x;
    double row = 0.0;
    for (int y = 0; y < rows; ++y) {
      const float middle = (static_cast<float>(y) + 0.5f) / static_cast<float>(rows);
      row += static_cast<double>(measured_value(m.data + g.values, g, MeasuredNodes(), MeasuredCell(g, {x, middle})));
    }
    before[static_cast<std::size_t>(i) + 1] =
        before[static_cast<std::size_t>(i)] + row * static_cast<double>(x * std::sin(theta) * std::cos(theta));
  }
  if (!(before.back() > 0.0)) return kRoughestLobe;
  int i = 0;
  while (i + 1 < kSteps && before[static_cast<std::size_t>(i) + 1] < 0.5 * before.back()) ++i;
  const double cell = before[static_cast<std::size_t>(i) + 1] - before[static_cast<std::size_t>(i)];
  const double part = cell > 0.0 ? (0.5 * before.back() - before[static_cast<std::size_t>(i)]) / cell : 0.5;
  const double x = (i + part) / kSteps;
  return static_cast<float>(std::tan(0.5 * static_cast<double>(kPi) * x * x));
}

}  // namespace

MeasuredSummary summarize(const MeasuredMaterial& material) {
  MaterialRecord record;
  record.measured = {material.data.data(), material.layout};
  MeasuredSummary summary;
  summary.albedo = min(mean_reflectance(record), Vec3f(1.0f));
  summary.roughness = std::fmin(std::fmax(median_slope(record.measured), 1e-3f), kRoughestLobe);
  return summary;
}

}  // namespace octrad
