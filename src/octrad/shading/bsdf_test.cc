#include "octrad/shading/materials.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "octrad/scene/sample_scenes.h"
#include "octrad/shading/bsdf_math.h"
#include "octrad/shading/chi_square_test_helper.h"

namespace octrad {
namespace {

using testing::SceneMaker;

struct Named {
  std::string name;
  int material;
};

// Every model with its parameters' defaults, and more parameter sets of some.
struct Zoo {
  SceneMaker maker;
  std::vector<Named> entries;
  std::unique_ptr<Materials> materials;

  void add(const std::string& name, Material m) { entries.push_back({name, maker.material(m)}); }
  Zoo() {
    const int color = maker.texture(Vec3f(0.9f, 0.5f, 0.1f)), white = maker.texture(1.0f);
    auto make = [&](BsdfType type) {
      Material m;
      m.type = type;
      m.reflectance = color;
      m.specular_reflectance = white;
      return m;
    };
#define OCTRAD_ADD(name, Model, transmits) add(#name, make(BsdfType::name));
    OCTRAD_BSDF_LIST(OCTRAD_ADD)
#undef OCTRAD_ADD
    Material nonlinear = make(BsdfType::plastic);
    nonlinear.nonlinear = true;
    add("plastic nonlinear", nonlinear);
    for (const auto distribution : {MicrofacetDistribution::ggx, MicrofacetDistribution::beckmann}) {
      for (const bool visible : {true, false}) {
        for (const bool anisotropic : {false, true}) {
          Material m = make(BsdfType::roughconductor);
          m.distribution = distribution;
          m.sample_visible = visible;
          m.alpha_u = maker.texture(0.35f);
          m.alpha_v = anisotropic ? maker.texture(0.15f) : m.alpha_u;
          add(std::string("roughconductor ") + (distribution == MicrofacetDistribution::ggx ? "ggx" : "beckmann") +
                  (visible ? " visible" : " all") + (anisotropic ? " anisotropic" : ""),
              m);
        }
        Material m = make(BsdfType::roughplastic);
        m.distribution = distribution;
        m.sample_visible = visible;
        m.nonlinear = visible;
        m.alpha_u = maker.texture(0.25f);
        add(std::string("roughplastic ") + (distribution == MicrofacetDistribution::ggx ? "ggx" : "beckmann") +
                (visible ? " visible" : " all"),
            m);
      }
    }
    Material masked = make(BsdfType::diffuse);
    masked.opacity = maker.texture(0.3f);
    add("mask over diffuse", masked);
    materials = std::make_unique<Materials>(maker.scene);
  }
};

const Zoo& zoo() {
  static const Zoo z;
  return z;
}

const std::vector<Vec3f> kViews = {normalize(Vec3f(0.05f, 0.02f, 1.0f)), normalize(Vec3f(0.6f, -0.5f, 0.8f)),
                                   normalize(Vec3f(-1.0f, 0.4f, 0.35f))};

// 100,000 draws a case; the probability of one wrong alarm over all is 0.01 (and the seeds are fixed).
TEST(Bsdf, SamplesFollowTheirDensity) {
  constexpr double kSignificance = 0.01 / 100.0;
  std::uint64_t seed = 1;
  for (const Named& entry : zoo().entries) {
    const Bsdf b = zoo().materials->at(entry.material, {0, 0});
    if (is_delta_bsdf(b)) continue;
    for (const Vec3f wo : kViews) {
      const auto result = testing::chi_square(
          [&](Rng& rng, Vec3f& w) {
            const float u_lobe = rng.uniform();
            const BsdfSample s = sample_bsdf(b, wo, u_lobe, rng.uniform2());
            w = s.wi;
            return s.valid && !s.delta;
          },
          [&](Vec3f w) { return static_cast<double>(evaluate_bsdf(b, wo, w).pdf); }, 100000, ++seed);
      EXPECT_GT(result.p_value, kSignificance) << entry.name << " wo.z " << wo.z << ": " << result.text;
      // What is missing of 1 is what delta lobes and samples under the surface take.
      EXPECT_NEAR(result.integral, result.share, 0.008) << entry.name << " wo.z " << wo.z;
    }
  }
}

TEST(Bsdf, WeightsAreValueOverDensity) {
  for (const Named& entry : zoo().entries) {
    const Bsdf b = zoo().materials->at(entry.material, {0, 0});
    Rng rng(5, RngPurpose::test, 1);
    int smooth = 0;
    for (int i = 0; i < 2000; ++i) {
      const Vec3f wo = kViews[static_cast<std::size_t>(i) % kViews.size()];
      const float u_lobe = rng.uniform();
      const BsdfSample s = sample_bsdf(b, wo, u_lobe, rng.uniform2());
      if (!s.valid) continue;
      EXPECT_NEAR(length(s.wi), 1.0f, 1e-4f) << entry.name;
      EXPECT_GT(s.pdf, 0.0f) << entry.name;
      if (s.delta) continue;
      ++smooth;
      const BsdfValue v = evaluate_bsdf(b, wo, s.wi);
      EXPECT_NEAR(v.pdf, s.pdf, 2e-3f * s.pdf) << entry.name;
      EXPECT_EQ(v.pdf, evaluate_bsdf(b, wo, s.wi).pdf);
      EXPECT_EQ(v.value, evaluate_bsdf(b, wo, s.wi).value);
      for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(s.weight[c] * s.pdf, v.value[c], 3e-3f * v.value[c] + 1e-6f) << entry.name;
    }
    EXPECT_EQ(smooth > 0, !is_delta_bsdf(b)) << entry.name;
  }
}

TEST(Bsdf, ReciprocalAndBounded) {
  for (const Named& entry : zoo().entries) {
    const Bsdf b = zoo().materials->at(entry.material, {0, 0});
    for (const Vec3f a : kViews) {
      for (const Vec3f c : kViews) {
        const Vec3f forward = evaluate_bsdf(b, a, c).value / c.z, backward = evaluate_bsdf(b, c, a).value / a.z;
        for (int i = 0; i < 3; ++i) EXPECT_NEAR(forward[i], backward[i], 2e-4f * forward[i] + 1e-6f) << entry.name;
      }
    }
    // Reflectance by Monte Carlo over the weights: no more light leaves than arrives (refraction scales radiance by
    // the squared index, which is taken out).
    for (const Vec3f wo : kViews) {
      Rng rng(6, RngPurpose::test, 2);
      Vec3d sum{0, 0, 0};
      constexpr int kSamples = 20000;
      for (int i = 0; i < kSamples; ++i) {
        const float u_lobe = rng.uniform();
        const BsdfSample s = sample_bsdf(b, wo, u_lobe, rng.uniform2());
        if (s.valid) sum += Vec3d(s.weight * (s.eta * s.eta));
      }
      for (int c = 0; c < 3; ++c) {
        EXPECT_LT(sum[c] / kSamples, 1.003) << entry.name << " wo.z " << wo.z;
        EXPECT_GT(sum[c] / kSamples, 0.05) << entry.name << " wo.z " << wo.z;
      }
    }
  }
}

TEST(Bsdf, NothingFromBelowOneSidedModels) {
  for (const Named& entry : zoo().entries) {
    const Bsdf b = zoo().materials->at(entry.material, {0, 0});
    if (transmits(b.type) || b.opacity < 1.0f) continue;
    const Vec3f below{0.3f, 0.2f, -std::sqrt(1.0f - 0.13f)};
    EXPECT_FALSE(sample_bsdf(b, below, 0.3f, {0.2f, 0.6f}).valid) << entry.name;
    EXPECT_EQ(max_component(evaluate_bsdf(b, kViews[0], below).value), 0.0f);
    EXPECT_EQ(max_component(evaluate_bsdf(b, below, kViews[0]).value), 0.0f);
  }
}

TEST(Bsdf, FirstHitAttributes) {
  const Vec3f diffuse(0.9f, 0.5f, 0.1f), specular(1.0f);
  for (const Named& entry : zoo().entries) {
    const Bsdf b = zoo().materials->at(entry.material, {0, 0});
    EXPECT_TRUE(albedo_bsdf(b) == diffuse || albedo_bsdf(b) == specular) << entry.name;
    EXPECT_GE(roughness_bsdf(b), 0.0f) << entry.name;
    EXPECT_LE(roughness_bsdf(b), 1.0f) << entry.name;
    EXPECT_FALSE(is_delta_bsdf(b) && roughness_bsdf(b) > 0.0f) << entry.name;
    const bool metal_or_glass =
        b.type == BsdfType::conductor || b.type == BsdfType::roughconductor || transmits(b.type);
    EXPECT_EQ(albedo_bsdf(b), metal_or_glass ? specular : diffuse) << entry.name;
    switch (b.type) {
      case BsdfType::diffuse: EXPECT_EQ(roughness_bsdf(b), 1.0f); break;
      case BsdfType::roughplastic: EXPECT_EQ(roughness_bsdf(b), std::min(b.alpha_u, 0.999f)); break;
      case BsdfType::roughconductor:
        EXPECT_FLOAT_EQ(roughness_bsdf(b), std::min(std::sqrt(b.alpha_u * b.alpha_v), 0.999f));
        break;
      default: break;
    }
  }
}

TEST(Bsdf, MaskPassesItsShareStraight) {
  const int index = zoo().entries.back().material;
  const Bsdf b = zoo().materials->at(index, {0, 0});
  ASSERT_FLOAT_EQ(b.opacity, 0.3f);
  const BsdfSample through = sample_bsdf(b, kViews[1], 0.31f, {0.5f, 0.5f});
  EXPECT_TRUE(through.valid && through.null && through.delta);
  EXPECT_EQ(through.wi, -kViews[1]);
  EXPECT_FLOAT_EQ(through.pdf, 0.7f);
  EXPECT_EQ(through.weight, Vec3f(1.0f));
  EXPECT_FALSE(sample_bsdf(b, kViews[1], 0.29f, {0.5f, 0.5f}).null);
}

// Total internal reflection and the index matched boundary.
TEST(Bsdf, DielectricLimits) {
  Bsdf b;
  b.type = BsdfType::dielectric;
  b.eta = 1.5f;
  const Vec3f grazing_inside = normalize(Vec3f(1.0f, 0.0f, -0.5f));
  const BsdfSample reflected = sample_bsdf(b, grazing_inside, 0.999f, {0.5f, 0.5f});
  EXPECT_FALSE(reflected.transmission);
  EXPECT_FLOAT_EQ(reflected.pdf, 1.0f);
  b.eta = 1.0f;
  const BsdfSample straight = sample_bsdf(b, grazing_inside, 0.001f, {0.5f, 0.5f});
  EXPECT_TRUE(straight.transmission);
  EXPECT_NEAR(dot(straight.wi, -grazing_inside), 1.0f, 1e-6f);
}

TEST(Shade, SidesAndFrames) {
  SceneMaker maker;
  const int one_sided = maker.diffuse(Vec3f(0.5f)), two_sided = maker.diffuse(Vec3f(0.25f), true);
  Material both;
  both.reflectance = maker.texture(0.1f);
  both.two_sided = true;
  both.back = one_sided;
  const int two_faces = maker.material(both);
  const Materials materials(maker.scene);
  SurfaceInteraction s;
  s.geometric_normal = s.shading_normal = {0, 1, 0};
  s.dp_du = {2, 0, 0};
  s.dp_dv = {0, 0, 1};
  const Vec3f above = normalize(Vec3f(1, 2, 3)), below = normalize(Vec3f(1, -2, 3));
  s.material = one_sided;
  EXPECT_FALSE(shade(materials, s, above).black);
  EXPECT_TRUE(shade(materials, s, below).black);
  s.material = two_sided;
  const ShadingPoint p = shade(materials, s, below);
  EXPECT_FALSE(p.black || p.front);
  EXPECT_EQ(p.ns, Vec3f(0, -1, 0));
  EXPECT_GT(p.to_local(below).z, 0.0f);
  const Vec3f v = p.to_world(p.to_local(Vec3f(0.1f, 0.2f, 0.3f)));
  EXPECT_NEAR(length(v - Vec3f(0.1f, 0.2f, 0.3f)), 0.0f, 1e-6f);
  EXPECT_EQ(p.s, Vec3f(1, 0, 0));
  s.material = two_faces;
  EXPECT_EQ(shade(materials, s, above).bsdf.reflectance, Vec3f(0.1f));
  EXPECT_EQ(shade(materials, s, below).bsdf.reflectance, Vec3f(0.5f));
  EXPECT_FALSE(shade(materials, s, below).black);
}

}  // namespace
}  // namespace octrad
