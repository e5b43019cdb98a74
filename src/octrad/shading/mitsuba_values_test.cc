// Our models against numbers that Mitsuba 3 computed (tests/mitsuba_bsdf_values.py).
#include "octrad/shading/mitsuba_values_test_data.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <iterator>
#include <string>

#include "octrad/scene/sample_scenes.h"
#include "octrad/shading/environment_map.h"
#include "octrad/shading/materials.h"

namespace octrad {
namespace {

struct MitsubaMaterials {
  testing::SceneMaker maker;
  std::unique_ptr<Materials> materials;
  MitsubaMaterials() {
    for (const MitsubaMaterial& m : kMitsubaMaterials) {
      Material out;
      out.type = m.type;
      out.distribution = m.distribution;
      out.sample_visible = m.visible;
      out.nonlinear = m.nonlinear;
      out.int_ior = m.int_ior;
      out.ext_ior = m.ext_ior;
      out.alpha_u = maker.texture(m.alpha_u);
      out.alpha_v = maker.texture(m.alpha_v);
      out.reflectance = maker.texture(m.reflectance);
      out.specular_reflectance = maker.texture(m.specular);
      out.specular_transmittance = maker.texture(m.transmittance);
      out.eta = m.eta;
      out.k = m.k;
      maker.material(out);
    }
    materials = std::make_unique<Materials>(maker.scene);
  }
};

const Materials& mitsuba_materials() {
  static const MitsubaMaterials m;
  return *m.materials;
}

void expect_close(float ours, float theirs, float relative, const std::string& what) {
  EXPECT_NEAR(ours, theirs, 1e-6f + relative * std::fabs(theirs)) << what;
}

TEST(MitsubaValues, Evaluations) {
  for (const MitsubaEvaluation& e : kMitsubaEvaluations) {
    const Bsdf b = mitsuba_materials().at(e.material, {0, 0});
    const Vec3f v = evaluate_bsdf(b, e.wo, e.wi).value;
    const std::string what = "material " + std::to_string(e.material) + " wo.z " + std::to_string(e.wo.z) + " wi.z " +
                             std::to_string(e.wi.z);
    for (int c = 0; c < 3; ++c) expect_close(v[c], e.value[c], b.type == BsdfType::roughplastic ? 2e-3f : 1e-4f, what);
    // Rough plastics share samples by their transmittance, where the rest of the quadrature shows.
    expect_close(evaluate_bsdf(b, e.wo, e.wi).pdf, e.pdf, b.type == BsdfType::roughplastic ? 6e-3f : 1e-4f,
                 "pdf " + what);
  }
}

TEST(MitsubaValues, DeltaLobes) {
  for (const MitsubaSample& e : kMitsubaSamples) {
    const BsdfSample s = sample_bsdf(mitsuba_materials().at(e.material, {0, 0}), e.wo, e.u_lobe, {0.3f, 0.7f});
    ASSERT_TRUE(s.valid && s.delta) << e.material;
    const std::string what = "material " + std::to_string(e.material) + " wo.z " + std::to_string(e.wo.z);
    for (int c = 0; c < 3; ++c) {
      expect_close(s.wi[c], e.wi[c], 1e-4f, what);
      expect_close(s.weight[c], e.weight[c], 1e-3f, what);
    }
    expect_close(s.pdf, e.pdf, 1e-3f, what);
    expect_close(s.eta, e.eta, 1e-5f, what);
  }
}

TEST(MitsubaValues, Environment) {
  Environment e;
  e.width = 12;
  e.height = 7;
  for (int y = 0; y < e.height; ++y) {
    for (int x = 0; x < e.width; ++x) {
      Vec3f v;
      for (int c = 0; c < 3; ++c) v[c] = 0.25f + static_cast<float>((7 * x + 13 * y + 5 * c + x * y) % 11);
      e.pixels.push_back(v);
    }
  }
  std::copy(std::begin(kMitsubaEnvironmentToWorld), std::end(kMitsubaEnvironmentToWorld), e.to_world);
  const EnvironmentMap map(e);
  for (const MitsubaEnvironmentValue& v : kMitsubaEnvironment) {
    const std::string what = "direction " + std::to_string(v.direction.x) + " " + std::to_string(v.direction.y) + " " +
                             std::to_string(v.direction.z);
    for (int c = 0; c < 3; ++c) expect_close(map.radiance(v.direction)[c], v.radiance[c], 1e-3f, what);
    expect_close(map.pdf(Vec3f(0.0f), v.direction), v.pdf, 2e-3f, "pdf " + what);
  }
}

}  // namespace
}  // namespace octrad
