#include "octrad/shading/materials.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "octrad/base/sanitized_test_helper.h"
#include "octrad/scene/sample_measured.h"
#include "octrad/scene/sample_scenes.h"
#include "octrad/shading/bsdf_math.h"
#include "octrad/shading/chi_square_test_helper.h"
#include "octrad/shading/measured_summary.h"

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
      if (type == BsdfType::roughdielectric) m.alpha_u = m.alpha_v = maker.texture(0.3f);
      if (type == BsdfType::principled || type == BsdfType::principledthin) maker.principled(m, maker.texture(0.4f));
      if (type == BsdfType::hair) maker.hair(m, 0.4f);
      if (type == BsdfType::measured) maker.measured(m);
      return m;
    };
    Material blend = make(BsdfType::blendbsdf);
    blend.blended[0] = maker.material(make(BsdfType::roughplastic));
    blend.blended[1] = maker.material(make(BsdfType::dielectric));
    blend.extra[ExtraParameter::weight] = maker.texture(0.3f);
    add("blendbsdf with glass", blend);
    Material rough_blend = blend;
    Material brushed = make(BsdfType::roughconductor);
    brushed.alpha_u = maker.texture(0.5f);
    brushed.alpha_v = maker.texture(0.2f);
    rough_blend.blended[0] = maker.material(brushed);
    rough_blend.blended[1] = maker.material(make(BsdfType::roughdielectric));
    add("blendbsdf of rough ones", rough_blend);
    rough_blend.blended[0] = entries[0].material;
    rough_blend.blended[1] = maker.material(make(BsdfType::null));
    add("blendbsdf of a blend and null", rough_blend);
    struct Disney {
      const char* name;
      BsdfType type;
      float roughness, metallic, spec_trans, clearcoat, sheen, diff_trans, anisotropic;
    };
    for (const Disney& d : {Disney{"metal", BsdfType::principled, 0.5f, 1.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.9f},
                            Disney{"coated", BsdfType::principled, 0.8f, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f, 0.0f},
                            Disney{"glass", BsdfType::principled, 0.5f, 0.0f, 1.0f, 0.0f, 0.0f, 0.0f, 0.0f},
                            Disney{"leaf", BsdfType::principledthin, 0.5f, 0.0f, 0.1f, 0.0f, 0.0f, 1.2f, 0.0f},
                            Disney{"pane", BsdfType::principledthin, 0.6f, 0.0f, 1.0f, 0.0f, 0.0f, 0.0f, 0.5f}}) {
      Material m = make(d.type);
      m.extra[ExtraParameter::roughness] = maker.texture(d.roughness);
      m.extra[ExtraParameter::metallic] = maker.texture(d.metallic);
      m.extra[ExtraParameter::spec_trans] = d.spec_trans > 0.0f ? maker.texture(d.spec_trans) : -1;
      m.extra[ExtraParameter::clearcoat] = maker.texture(d.clearcoat);
      m.extra[ExtraParameter::sheen] = maker.texture(d.sheen);
      m.extra[ExtraParameter::diff_trans] = maker.texture(d.diff_trans);
      m.extra[ExtraParameter::anisotropic] = maker.texture(d.anisotropic);
      m.extra[ExtraParameter::spec_tint] = m.extra[ExtraParameter::flatness] = -1;
      add(std::string("principled ") + d.name, m);
    }
#define OCTRAD_ADD(name, Model, transmits) \
  if (BsdfType::name != BsdfType::blendbsdf) add(#name, make(BsdfType::name));
    OCTRAD_BSDF_LIST(OCTRAD_ADD)
#undef OCTRAD_ADD
    Material clear_hair = make(BsdfType::hair);
    maker.hair(clear_hair, 0.3f);
    clear_hair.specular_transmittance = white;
    clear_hair.extra[ExtraParameter::azimuthal_roughness] = maker.texture(0.9f);
    clear_hair.extra[ExtraParameter::scale_tilt] = maker.texture(-5.0f);
    add("hair without absorption", clear_hair);
    for (const int part : {1, 2, 4, 8}) {
      Material measured = make(BsdfType::measured);
      maker.measured(measured, part);
      add("measured " + std::to_string(part), measured);
    }
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
          m.type = BsdfType::roughdielectric;
          add(std::string("roughdielectric") + entries.back().name.substr(14), m);
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
// And from behind, where light passes.
std::vector<Vec3f> views(const Bsdf& b) {
  std::vector<Vec3f> all = kViews;
  if (b.both_sides) {
    all[0] = normalize(Vec3f(0.5f, 0.2f, 1.0f));  // narrow lobes stay away from the pole of chi_square()'s cells
    all.insert(all.end(), {normalize(Vec3f(0.3f, 0.2f, -0.9f)), normalize(Vec3f(0.8f, 0.1f, -0.5f))});
  }
  return all;
}

// 100,000 draws a case; the probability of one wrong alarm over all is 0.01 (and the seeds are fixed).
TEST(Bsdf, SamplesFollowTheirDensity) {
  if (testing::sanitized()) GTEST_SKIP() << "statistics of many samples; others draw some under the sanitizers";
  constexpr double kSignificance = 0.01 / 200.0;
  std::uint64_t seed = 1;
  for (const Named& entry : zoo().entries) {
    Bsdf b = zoo().materials->at(entry.material, {0, 0});
    if (is_delta_bsdf(b)) continue;
    if (has_lobes(b) && b.type != BsdfType::plastic) b.lobe = static_cast<Lobe>(seed % 3);
    for (const Vec3f wo : views(b)) {
      const auto result = testing::chi_square(
          [&](Rng& rng, Vec3f& w) {
            const float u_lobe = rng.uniform();
            const BsdfSample s = sample_bsdf(b, wo, u_lobe, rng.uniform2());
            w = s.wi;
            return s.valid && !s.delta && s.pdf > 0.0f;
          },
          [&](Vec3f w) { return static_cast<double>(evaluate_bsdf(b, wo, w).pdf); }, 100000, ++seed, 24, 36,
          b.type == BsdfType::roughdielectric ? 20 : 12);                          // refraction narrows lobes
      if (wo.z < 0.0f && result.share == 0.0 && result.integral == 0.0) continue;  // its other side has no such lobes
      EXPECT_GT(result.p_value, kSignificance) << entry.name << " wo.z " << wo.z << ": " << result.text;
      // What is missing of 1 is what delta lobes and samples under the surface take.
      EXPECT_NEAR(result.integral, result.share, 0.008) << entry.name << " wo.z " << wo.z;
    }
  }
}

// The whole is the sum of its lobes, each of which reflects its albedo under even light.
TEST(Bsdf, LobesOfCoatsAreTheWhole) {
  int coated = 0;
  for (const Named& entry : zoo().entries) {
    const Bsdf whole = zoo().materials->at(entry.material, {0, 0});
    if (!is_coated(whole) || whole.record != nullptr) continue;
    ++coated;
    Bsdf base = whole, coat = whole;
    base.lobe = Lobe::base;
    coat.lobe = Lobe::coat;
    EXPECT_EQ(roughness_bsdf(base), 1.0f);
    EXPECT_EQ(roughness_bsdf(coat), roughness_bsdf(whole));
    for (const Vec3f wo : kViews) {
      Rng rng(3, RngPurpose::test, static_cast<std::uint64_t>(coated));
      constexpr int kSamples = 40000;
      Vec3f reflected[2];
      double chosen[2] = {0.0, 0.0};
      for (int i = 0; i < kSamples; ++i) {
        const Vec3f wi = square_to_cosine_hemisphere(rng.uniform2());
        const Vec3f sum = evaluate_bsdf(base, wo, wi).value + evaluate_bsdf(coat, wo, wi).value;
        EXPECT_LE(
            max_component(max(sum - evaluate_bsdf(whole, wo, wi).value, evaluate_bsdf(whole, wo, wi).value - sum)),
            1e-5f * max_component(sum));
        for (const Bsdf* lobe : {&base, &coat}) {
          const float u_lobe = rng.uniform();
          const BsdfSample s = sample_bsdf(*lobe, wo, u_lobe, rng.uniform2());
          if (s.valid) reflected[lobe == &coat] += s.weight / static_cast<float>(kSamples);
        }
        Bsdf one = whole;
        const float weight = choose_lobe(one, wo, rng.uniform());
        chosen[one.lobe == Lobe::coat] += static_cast<double>(weight) / kSamples;
      }
      for (const Bsdf* lobe : {&base, &coat}) {
        const Vec3f expected = lobe_albedo(*lobe, wo), found = reflected[lobe == &coat];
        // The tables of rough coats do not keep the light that reciprocity needs.
        const bool smooth = whole.type == BsdfType::plastic;
        const float tolerance = lobe == &coat ? (smooth ? 0.01f : 0.45f) * max_component(expected)
                                : smooth      ? 0.02f
                                              : 0.35f * max_component(expected);
        for (int c = 0; c < 3; ++c) EXPECT_NEAR(found[c], expected[c], tolerance) << entry.name << " wo.z " << wo.z;
        EXPECT_NEAR(chosen[lobe == &coat], 1.0, 0.05) << entry.name;  // each counts once on average
      }
      Bsdf below = base;
      EXPECT_GE(min_component(lobe_albedo(below, {0.6f, 0, -0.8f})), 0.0f);  // a view that bumps have tilted under
    }
  }
  EXPECT_GE(coated, 6);
}

TEST(Bsdf, WeightsAreValueOverDensity) {
  for (const Named& entry : zoo().entries) {
    const Bsdf b = zoo().materials->at(entry.material, {0, 0});
    Rng rng(5, RngPurpose::test, 1);
    int smooth = 0;
    for (int i = 0; i < 2000; ++i) {
      const std::vector<Vec3f> all = views(b);
      const Vec3f wo = all[static_cast<std::size_t>(i) % all.size()];
      const float u_lobe = rng.uniform();
      const BsdfSample s = sample_bsdf(b, wo, u_lobe, rng.uniform2());
      if (!s.valid) continue;
      EXPECT_EQ(s.transmission, s.wi.z * wo.z < 0.0f) << entry.name;
      EXPECT_NEAR(length(s.wi), 1.0f, 1e-4f) << entry.name;
      EXPECT_GT(s.pdf, 0.0f) << entry.name;
      if (s.delta) continue;
      ++smooth;
      const BsdfValue v = evaluate_bsdf(b, wo, s.wi);
      EXPECT_NEAR(v.pdf, s.pdf, 2e-3f * s.pdf) << entry.name;
      for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(s.weight[c] * s.pdf, v.value[c], 3e-3f * v.value[c] + 1e-6f) << entry.name;
    }
    EXPECT_EQ(smooth > 0, !is_delta_bsdf(b)) << entry.name;
  }
}

TEST(Bsdf, ReciprocalAndBounded) {
  for (const Named& entry : zoo().entries) {
    const Bsdf b = zoo().materials->at(entry.material, {0, 0});
    // Refraction is reciprocal in basic radiance, radiance over the squared index on its side.
    const auto basic = [&](Vec3f wo, Vec3f wi) {
      const bool inside = wo.z < 0.0f;
      return evaluate_bsdf(b, wo, wi).value / (std::fabs(wi.z) * (inside ? b.eta * b.eta : 1.0f));
    };
    // Below a mixture light has two indices.
    // Nor does Mitsuba's thin model ask for the same of both directions that it transmits between.
    const bool mixture = b.type == BsdfType::blendbsdf || b.type == BsdfType::principledthin;
    // Nor do tables of measurements.
    const bool reciprocal = b.type != BsdfType::hair && b.type != BsdfType::measured;
    for (const Vec3f a : !reciprocal ? std::vector<Vec3f>() : mixture ? kViews : views(b)) {
      for (const Vec3f c : mixture ? kViews : views(b)) {
        const Vec3f forward = basic(a, c), backward = basic(c, a);
        for (int i = 0; i < 3; ++i) EXPECT_NEAR(forward[i], backward[i], 5e-4f * forward[i] + 1e-6f) << entry.name;
      }
    }
    // Reflectance by Monte Carlo over the weights: no more light leaves than arrives (refraction scales radiance by
    // the squared index, which is taken out).
    for (const Vec3f wo : views(b)) {
      Rng rng(6, RngPurpose::test, 2);
      Vec3d sum{0, 0, 0};
      constexpr int kSamples = 20000;
      for (int i = 0; i < kSamples; ++i) {
        const float u_lobe = rng.uniform();
        const BsdfSample s = sample_bsdf(b, wo, u_lobe, rng.uniform2());
        if (s.valid) sum += Vec3d(s.weight * (s.eta * s.eta));
      }
      for (int c = 0; c < 3; ++c) {
        EXPECT_LT(sum[c] / kSamples, b.record != nullptr ? 1.1 : 1.003) << entry.name << " wo.z " << wo.z;
        EXPECT_GT(sum[c] / kSamples, 0.05) << entry.name << " wo.z " << wo.z;
      }
    }
  }
}

TEST(Bsdf, NothingFromBelowOneSidedModels) {
  int one_sided = 0;
  for (const Named& entry : zoo().entries) {
    const Bsdf b = zoo().materials->at(entry.material, {0, 0});
    if (b.both_sides || b.opacity < 1.0f) continue;
    ++one_sided;
    const Vec3f below{0.3f, 0.2f, -std::sqrt(1.0f - 0.13f)};
    EXPECT_FALSE(sample_bsdf(b, below, 0.3f, {0.2f, 0.6f}).valid) << entry.name;
    EXPECT_EQ(max_component(evaluate_bsdf(b, kViews[0], below).value), 0.0f);
    EXPECT_EQ(max_component(evaluate_bsdf(b, below, kViews[0]).value), 0.0f);
  }
  EXPECT_GE(one_sided, 6);
}

TEST(Bsdf, FirstHitAttributes) {
  const Vec3f diffuse(0.9f, 0.5f, 0.1f), specular(1.0f);
  for (const Named& entry : zoo().entries) {
    const Bsdf b = zoo().materials->at(entry.material, {0, 0});
    EXPECT_GT(min_component(albedo_bsdf(b)), 0.0f) << entry.name;
    EXPECT_LE(max_component(albedo_bsdf(b)), 1.3f) << entry.name;
    EXPECT_GE(roughness_bsdf(b), 0.0f) << entry.name;
    EXPECT_LE(roughness_bsdf(b), 1.0f) << entry.name;
    EXPECT_FALSE(is_delta_bsdf(b) && roughness_bsdf(b) > 0.0f) << entry.name;
    const bool metal_or_glass =
        b.type == BsdfType::conductor || b.type == BsdfType::roughconductor || transmits(b.type);
    const bool several = b.record != nullptr;  // by the energy of their lobes: EnergiesOfLobes
    if (!several) {
      for (int c = 0; c < 3; ++c)
        EXPECT_FLOAT_EQ(albedo_bsdf(b)[c], (metal_or_glass ? specular : diffuse)[c]) << entry.name;
    }
    switch (b.type) {
      case BsdfType::diffuse: EXPECT_EQ(roughness_bsdf(b), 1.0f); break;
      case BsdfType::roughplastic: EXPECT_EQ(roughness_bsdf(b), std::min(b.alpha_u, 0.999f)); break;
      case BsdfType::roughdielectric:
      case BsdfType::roughconductor:
        EXPECT_FLOAT_EQ(roughness_bsdf(b), std::min(std::sqrt(b.alpha_u * b.alpha_v), 0.999f));
        break;
      default: break;
    }
  }
}

// All light that a fibre without absorption meets leaves it, on one of four ways; and what hair is expected to reflect
// under even light is the mean over views across it.
TEST(Bsdf, HairKeepsLight) {
  int found = 0;
  for (const Named& entry : zoo().entries) {
    const Bsdf b = zoo().materials->at(entry.material, {0, 0});
    if (b.type != BsdfType::hair) continue;
    ++found;
    const bool clear = b.specular_transmittance.x == 1.0f;
    Rng rng(7, RngPurpose::test, 3);
    constexpr int kSamples = 60000;
    Vec3d sum{0, 0, 0};
    for (int i = 0; i < kSamples; ++i) {
      const float h = 2.0f * rng.uniform() - 1.0f;
      const float u_lobe = rng.uniform();
      const BsdfSample s = sample_bsdf(b, {h, 0.0f, std::sqrt(1.0f - h * h)}, u_lobe, rng.uniform2());
      ASSERT_TRUE(s.valid);
      if (clear) {
        EXPECT_NEAR(s.weight.x, 1.0f, 2e-5f);
      }
      sum += Vec3d(s.weight);
    }
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(sum[c] / kSamples, albedo_bsdf(b)[c], 0.01) << entry.name;
  }
  EXPECT_EQ(found, 2);
}

// What caches are told: what the values reflect of even light, and the alphas that the table was made with.
TEST(Bsdf, MeasuredSummary) {
  for (const int part : {0, 1, 2, 4, 8}) {
    const MeasuredMaterial material = parse_measured("sample", testing::measured_sample_file(part));
    MaterialRecord record;
    record.measured = {material.data.data(), material.layout};
    Rng rng(9, RngPurpose::test, static_cast<std::uint64_t>(part));
    constexpr int kSamples = 100000;
    Vec3d sum(0.0);
    for (int i = 0; i < kSamples; ++i) {
      const Vec3f wo = square_to_cosine_hemisphere(rng.uniform2()), wi = square_to_cosine_hemisphere(rng.uniform2());
      sum += Vec3d(evaluate_measured(record, wo, wi).value * (kPi / wi.z));
    }
    const MeasuredSummary summary = summarize(material);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(summary.albedo[c], sum[c] / kSamples, 0.01) << part;
    EXPECT_GT(summary.albedo.x, part == 8 ? 0.2f : 0.55f) << part;
    // The median of slopes along two alphas is a little larger than their geometric mean.
    EXPECT_NEAR(summary.roughness, part % 8 == 0 ? 0.5f : std::sqrt(0.25f * 0.6f), part % 8 == 0 ? 0.02f : 0.08f)
        << part;
  }
}

// At the ends of what scene files may say, and of where a fibre may be met: numbers, and samples with their densities.
TEST(Bsdf, HairIsFinite) {
  Zoo ends;
  std::vector<int> made;
  for (const float roughness : {0.0f, 1.0f}) {
    for (const float index : {0.7f, 1.001f, 90.0f}) {
      for (const Vec3f left : {Vec3f(0.0f), Vec3f(0, 1e-30f, 1), Vec3f(1.0f)}) {
        Material m;
        m.type = BsdfType::hair;
        ends.maker.hair(m, roughness);
        m.specular_transmittance = ends.maker.texture(left);
        m.int_ior = index;
        made.push_back(ends.maker.material(m));
      }
    }
  }
  const Materials materials(ends.maker.scene);
  Rng rng(8, RngPurpose::test, 4);
  int drawn = 0;
  for (const int i : made) {
    const Bsdf b = materials.at(i, {0, 0});
    EXPECT_TRUE(is_finite(albedo_bsdf(b)) && std::isfinite(roughness_bsdf(b)));
    for (const Vec3f wo :
         {Vec3f(0, 1, 0), Vec3f(0, -1, 0), Vec3f(1, 0, 0), Vec3f(0, 0, 1), normalize(Vec3f(1e-4f, 1, 0)),
          normalize(Vec3f(-1, 0.3f, 1e-6f)), normalize(Vec3f(0.2f, 0.3f, -0.5f))}) {
      for (int k = 0; k < 50; ++k) {
        const float u_lobe = k == 0 ? 0.0f : k == 1 ? 0.99999994f : rng.uniform();
        const Vec2f u = k == 0 ? Vec2f{0, 0} : k == 1 ? Vec2f{0.99999994f, 0.99999994f} : rng.uniform2();
        const BsdfSample s = sample_bsdf(b, wo, u_lobe, u);
        if (!s.valid) continue;
        ++drawn;
        EXPECT_TRUE(is_finite(s.wi) && is_finite(s.weight) && std::isfinite(s.pdf));
        EXPECT_NEAR(length(s.wi), 1.0f, 1e-5f);
        EXPECT_LT(max_component(s.weight), 20.0f);
        const BsdfValue v = evaluate_bsdf(b, wo, {0.6f, 0.0f, -0.8f});
        EXPECT_TRUE(is_finite(v.value) && std::isfinite(v.pdf) && min_component(v.value) >= 0.0f);
      }
    }
  }
  EXPECT_GT(drawn, 6000);  // of 6,300
}

// Oren and Nayar's model without roughness is Lambert's; with it, grazing light comes back to where it came from. The
// numbers are of their equations with sigma = 20 degrees, in double precision.
TEST(Bsdf, RoughDiffuse) {
  Bsdf b;
  b.type = BsdfType::roughdiffuse;
  b.reflectance = Vec3f(0.9f);
  b.alpha_u = 0.0f;
  const auto at = [](double theta, double phi) {
    return Vec3f(static_cast<float>(std::sin(theta) * std::cos(phi)),
                 static_cast<float>(std::sin(theta) * std::sin(phi)), static_cast<float>(std::cos(theta)));
  };
  const Vec3f wo = at(1.1, 0.3);
  EXPECT_NEAR(evaluate_bsdf(b, wo, at(0.8, 2.0)).value.x, 0.9f * kInvPi * std::cos(0.8f), 1e-5f);
  const Vec3f up{0.0f, 0.0f, std::nextafter(1.0f, 2.0f)};  // as unit vectors are rounded
  EXPECT_NEAR(evaluate_bsdf(b, up, up).value.x, 0.9f * kInvPi, 1e-5f);
  b.alpha_u = static_cast<float>(20.0 * 3.14159265358979 / 180.0 * std::sqrt(2.0));
  for (const double phi : {0.3, 1.0, 2.5}) {
    const double s2 = std::pow(20.0 * 3.14159265358979 / 180.0, 2), cos = std::cos(phi - 0.3),
                 t = 2.0 * 0.8 / 3.14159265358979;
    const double c1 = 1.0 - 0.5 * s2 / (s2 + 0.33), rough = s2 / (s2 + 0.09);
    const double c2 = 0.45 * rough * (cos >= 0.0 ? std::sin(1.1) : std::sin(1.1) - t * t * t);
    const double c3 = 0.125 * rough * std::pow(4.0 * 1.1 * 0.8 / (3.14159265358979 * 3.14159265358979), 2);
    const double once = c1 + cos * c2 * std::tan(0.8) + (1.0 - std::fabs(cos)) * c3 * std::tan(0.95);
    const double twice = 0.17 * s2 / (s2 + 0.13) * (1.0 - cos * t * t);
    const double expected = (0.9 * once + 0.81 * twice) / 3.14159265358979 * std::cos(0.8);
    EXPECT_NEAR(evaluate_bsdf(b, wo, at(0.8, phi)).value.x, expected, 1e-5) << phi;
  }
  EXPECT_GT(evaluate_bsdf(b, wo, at(1.1, 0.3)).value.x, 1.2f * evaluate_bsdf(b, wo, at(1.1, 3.4)).value.x);
}

// What a radiance field is told of surfaces with several lobes: about what they show of even light.
TEST(Bsdf, EnergiesOfLobes) {
  int several = 0;
  for (const Named& entry : zoo().entries) {
    const Bsdf b = zoo().materials->at(entry.material, {0, 0});
    if (b.record == nullptr && b.type != BsdfType::roughdielectric) continue;
    ++several;
    Rng rng(9, RngPurpose::test, static_cast<std::uint64_t>(several));
    Vec3d sum{0, 0, 0};
    constexpr int kSamples = 20000;
    for (int i = 0; i < kSamples; ++i) {
      const Vec3f wo = square_to_cosine_hemisphere(rng.uniform2());
      const float u_lobe = rng.uniform();
      const BsdfSample s = sample_opaque(b, wo, u_lobe, rng.uniform2());
      if (s.valid) sum += Vec3d(s.weight * (s.eta * s.eta));
    }
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(sum[c] / kSamples, albedo_bsdf(b)[c], 0.22) << entry.name;  // rough metal darkens
  }
  EXPECT_GE(several, 16);
  // Roughness is the mean over the lobes' energies; white metal reflects all of it.
  const auto& m = zoo();
  for (const Named& entry : m.entries) {
    const float roughness = roughness_bsdf(m.materials->at(entry.material, {0, 0}));
    if (entry.name == "principled leaf") {
      EXPECT_GT(roughness, 0.9f);
    } else if (entry.name == "principled metal") {
      EXPECT_NEAR(roughness, 0.25f, 1e-3f);
    }
  }
}

// Rough glass is looked up in the direction in which light comes through it: one to one with the view, and apart from
// the directions in which its other side is seen (method section 1).
TEST(Bsdf, SeenThroughGlass) {
  Bsdf b;
  b.type = BsdfType::roughdielectric;
  b.both_sides = true;
  b.eta = 1.5f;
  b.lobe = Lobe::base;
  const Vec3f outside = normalize(Vec3f(0.6f, 0.0f, 0.8f)), inside = normalize(Vec3f(0.2f, 0.1f, -0.9f));
  for (const Vec3f wo : {outside, inside}) {
    const SeenThrough seen = seen_through(b, wo);
    ASSERT_TRUE(seen.mainly);
    EXPECT_LT(seen.direction.z * wo.z, 0.0f);
    // Snell's law.
    const float from = length(Vec3f(wo.x, wo.y, 0.0f)), to = length(Vec3f(seen.direction.x, seen.direction.y, 0.0f));
    EXPECT_NEAR(to, wo.z > 0.0f ? from / 1.5f : from * 1.5f, 1e-5f);
    b.alpha_u = b.alpha_v = 0.01f;
    const BsdfSample s = sample_bsdf(b, wo, 0.5f, {0.5f, 0.5f});
    EXPECT_LT(length(s.wi - seen.direction), 0.05f);
  }
  // Total reflection: along the surface; without a lobe in question, like a mirror.
  const Vec3f beyond = normalize(Vec3f(0.9f, 0.0f, -0.3f));
  EXPECT_NEAR(seen_through(b, beyond).direction.z, 0.0f, 1e-6f);
  b.lobe = Lobe::all;
  EXPECT_TRUE(seen_through(b, outside).mainly);
  EXPECT_FALSE(seen_through(b, beyond).mainly);
  b.lobe = Lobe::coat;
  EXPECT_FALSE(seen_through(b, outside).mainly);
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

// Of unit vectors that roundings have made a little longer, and of grazing light, as well.
TEST(Bsdf, BumpShadowingIsTheFormulaAndFinite) {
  for (const float tilt : {1.0f, 0.9f, 0.5f, 0.1f}) {
    for (const float cos : {1.0f, 0.7f, -0.4f, 0.05f, 1e-3f}) {
      const double t2 = static_cast<double>(tilt) * static_cast<double>(tilt),
                   c2 = static_cast<double>(cos) * static_cast<double>(cos);
      const double alpha2 = std::min(1.0, 0.125 * (1.0 - t2) / t2);
      const double expected = 2.0 / (1.0 + std::sqrt(1.0 + alpha2 * (1.0 - c2) / c2));
      EXPECT_NEAR(static_cast<double>(bump_shadowing(tilt, cos)), expected, 1e-5 * expected) << tilt << " " << cos;
    }
  }
  for (const float tilt : {1.0000001f, 1.000001f, 0.9999999f, 1e-3f, 1e-25f, 0.0f, -1.0f}) {
    for (const float cos : {1.0000001f, 1e-3f, 1e-5f, -1e-8f, 1e-12f, 1e-25f, 1e-38f}) {
      const float share = bump_shadowing(tilt, cos);
      EXPECT_TRUE(share >= 0.0f && share <= 1.0f) << tilt << " " << cos << ": " << share;
      if (tilt > 1.0f) {
        EXPECT_FLOAT_EQ(share, 1.0f) << cos;
      }
    }
  }
}

}  // namespace
}  // namespace octrad
