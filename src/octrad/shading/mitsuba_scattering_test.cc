// Models, as scene files give them, against numbers that Mitsuba 3 computed (tests/mitsuba_scattering_values.py).
#include "octrad/shading/mitsuba_scattering_test_data.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "octrad/base/folder_test_helper.h"
#include "octrad/base/rng.h"
#include "octrad/image/io.h"
#include "octrad/scene/load.h"
#include "octrad/scene/sample_measured.h"
#include "octrad/shading/materials.h"
#include "octrad/shading/mitsuba_sampling_test_data.h"

namespace octrad {
namespace {

struct MitsubaScene {
  TestFolder folder;
  Scene scene;
  std::unique_ptr<Materials> materials;

  // One sphere of each of these, elements of a scene file.
  explicit MitsubaScene(const std::vector<std::string>& bsdfs) {
    Image tilt(2, 2, {"R", "G", "B"});
    for (std::size_t i = 0; i < tilt.data.size(); ++i) tilt.data[i] = kMitsubaTilt[static_cast<int>(i % 3)];
    write_exr(folder.file("tilt.exr"), tilt);
    for (const int part : {0, 1, 2, 4, 8})
      folder.write("part" + std::to_string(part) + ".bsdf", testing::measured_sample_file(part));
    std::string text =
        "<scene version=\"3.0.0\"><sensor type=\"perspective\"><float name=\"fov\" value=\"60\"/></sensor>\n";
    for (const std::string& bsdf : bsdfs) text += "<shape type=\"sphere\">" + bsdf + "</shape>\n";
    scene = load_scene(folder.write("s.xml", text + "</scene>\n"));
    materials = std::make_unique<Materials>(scene);
  }

  // Seen from `wo` at a point whose local frame is the world's.
  ShadingPoint shade(int shape, Vec3f wo) const {
    SurfaceInteraction s;
    s.geometric_normal = s.shading_normal = {0, 0, 1};
    s.dp_du = {1, 0, 0};
    s.dp_dv = {0, 1, 0};
    s.uv = kMitsubaUv;
    s.material = scene.shapes.at(static_cast<std::size_t>(shape)).material;
    return octrad::shade(*materials, s, wo);
  }
};

const MitsubaScene& mitsuba_scene() {
  static const MitsubaScene s([] {
    std::vector<std::string> bsdfs(std::begin(kMitsubaBsdfs), std::end(kMitsubaBsdfs));
    bsdfs.insert(bsdfs.end(), std::begin(kMitsubaOtherBsdfs), std::end(kMitsubaOtherBsdfs));
    return bsdfs;
  }());
  return s;
}

std::string words(int material, Vec3f wo) {
  const int others = material - static_cast<int>(std::size(kMitsubaBsdfs));
  return std::string(others < 0 ? kMitsubaBsdfs[material] : kMitsubaOtherBsdfs[others]) + " wo.z " +
         std::to_string(wo.z);
}
std::string words(int material, Vec3f wo, Vec3f wi) { return words(material, wo) + " wi.z " + std::to_string(wi.z); }

BsdfValue evaluate(const ShadingPoint& p, Vec3f wi) {
  return p.black ? BsdfValue{} : evaluate_bsdf(p.bsdf, p.to_local(p.wo), p.to_local(wi));
}

void expect_agreement(const ShadingPoint& p, const MitsubaScattering& e, const std::string& what) {
  const BsdfValue v = evaluate(p, e.wi);
  // Half vectors of refraction are differences of nearly equal vectors. The Bessel function of Mitsuba's hair is up
  // to .6 % too small. Rough plastics share light and samples by their transmittance, of which Mitsuba's quadrature
  // is off by up to 2 % where the indices are alike.
  const bool hair = p.bsdf.type == BsdfType::hair, coated = what.find("roughplastic") != std::string::npos;
  const float tolerance = hair ? 6e-3f : (coated ? 4e-3f : 2e-3f);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(v.value[c], e.value[c], 1e-6f + tolerance * e.value[c]) << what;
  if (max_component(e.value) > 0.0f) {
    EXPECT_NEAR(v.pdf, e.pdf, 1e-6f + (coated ? 2e-2f : tolerance) * e.pdf) << "pdf " << what;
  }
}

TEST(MitsubaScattering, Evaluations) {
  int lit = 0, behind = 0;
  for (const MitsubaScattering& e : kMitsubaScattering) {
    lit += max_component(e.value) > 0.0f;
    behind += max_component(e.value) > 0.0f && e.wi.z < 0.0f;
    expect_agreement(mitsuba_scene().shade(e.material, e.wo), e, words(e.material, e.wo, e.wi));
  }
  EXPECT_GT(lit, 250);
  EXPECT_GT(behind, 80);
}

TEST(MitsubaScattering, PerfectLobes) {
  for (const MitsubaDelta& e : kMitsubaDeltas) {
    const ShadingPoint p = mitsuba_scene().shade(e.material, e.wo);
    const std::string what = words(e.material, e.wo, e.wi);
    ASSERT_FALSE(p.black) << what;
    // Where parts of a blend let light pass, that is decided first: other numbers choose the same lobes.
    const bool masked = p.bsdf.opacity < 1.0f && p.bsdf.type == BsdfType::blendbsdf;
    const float u_lobe = masked ? 1.0f - e.u_lobe : e.u_lobe;
    const BsdfSample s = sample_bsdf(p.bsdf, p.to_local(e.wo), u_lobe, {0.3f, 0.7f});
    ASSERT_TRUE(s.valid && s.delta) << what;
    const Vec3f wi = p.to_world(s.wi);
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(wi[c], e.wi[c], 1e-4f) << what;
      EXPECT_NEAR(s.weight[c], e.weight[c], 1e-3f * e.weight[c]) << what;
    }
    if (masked) {
      EXPECT_NEAR(s.pdf, 0.4f, 1e-6f) << what;
    }
  }
}

// The means of MitsubaSampling over what sample_bsdf() draws for a lattice of numbers (Roberts 2018, "R3"), which is
// shifted at random: they deviate less than those of independent numbers.
constexpr int kSamplingPoints = 1024, kSamplingShifts = 16;
using SamplingMeans = std::array<double, 11>;

SamplingMeans sampling_means(const ShadingPoint& p, Vec3f wo, Rng& rng) {
  const Vec3f step(0.8191725f, 0.6710436f, 0.5497005f);
  Vec3f u(rng.uniform(), rng.uniform(), rng.uniform());
  SamplingMeans means{};
  if (p.black && p.bsdf.opacity >= 1.0f) return means;
  for (int i = 0; i < kSamplingPoints; ++i) {
    u += step;
    for (int k = 0; k < 3; ++k) u[k] -= u[k] >= 1.0f ? 1.0f : 0.0f;
    const BsdfSample s = sample_bsdf(p.bsdf, p.to_local(wo), u.x, {u.y, u.z});
    if (!s.valid || !(max_component(s.weight) > 0.0f)) continue;
    const Vec3f w = s.weight, wi = p.to_world(s.wi), moment = wi * ((w.x + w.y + w.z) / 3.0f);
    const float row[] = {w.x,  w.y,      w.z,      1.0f,    wi.z < 0.0f ? 1.0f : 0.0f, wi.x, wi.y,
                         wi.z, moment.x, moment.y, moment.z};
    for (std::size_t k = 0; k < means.size(); ++k) means[k] += static_cast<double>(row[k]) / kSamplingPoints;
  }
  return means;
}

TEST(MitsubaScattering, Samples) {
  const char* const names[] = {"red", "green", "blue", "share", "below", "x", "y", "z", "x lit", "y lit", "z lit"};
  for (const MitsubaSampling& e : kMitsubaSampling) {
    const ShadingPoint p = mitsuba_scene().shade(e.material, e.wo);
    Rng rng(1, RngPurpose::test, static_cast<std::uint64_t>(&e - kMitsubaSampling));
    SamplingMeans sum{}, squares{};
    for (int shift = 0; shift < kSamplingShifts; ++shift) {
      const SamplingMeans m = sampling_means(p, e.wo, rng);
      for (std::size_t k = 0; k < m.size(); ++k) {
        sum[k] += m[k];
        squares[k] += m[k] * m[k];
      }
    }
    for (std::size_t k = 0; k < sum.size(); ++k) {
      const double mean = sum[k] / kSamplingShifts;
      const double variance = std::fmax(squares[k] / kSamplingShifts - mean * mean, 0.0) / (kSamplingShifts - 1);
      const double error = std::sqrt(variance + static_cast<double>(e.error[k]) * static_cast<double>(e.error[k]));
      // Beside chance: values and densities agree as far as those of Evaluations. Where the part of a blend that draws
      // a direction rejects it, Mitsuba keeps the sample if another part lights it; up to .4 % of the samples.
      const bool directions = k >= 3 && k < 8;
      const bool wide = p.bsdf.type == BsdfType::hair || (p.bsdf.type == BsdfType::blendbsdf && directions);
      const float tolerance = wide ? 6e-3f : 2e-3f;
      const float whole = k < 3 ? e.mean[k] : (directions ? e.mean[3] : (e.mean[0] + e.mean[1] + e.mean[2]) / 3.0f);
      EXPECT_NEAR(mean, e.mean[k], 4.5 * error + static_cast<double>(tolerance * whole))
          << names[k] << " of " << words(e.material, e.wo) << ", standard error " << error;
    }
  }
}

// Models that tests/random_models.py draws anew each time: a line of a scene file each, the number of rows, the rows.
TEST(MitsubaScattering, RandomModels) {
  const char* const file = std::getenv("OCTRAD_MITSUBA_VALUES");
  if (file == nullptr) GTEST_SKIP() << "for tests/random_models.py, which needs Mitsuba";
  std::vector<std::string> bsdfs;
  std::vector<MitsubaScattering> rows;
  std::ifstream in(file);
  for (std::string bsdf; std::getline(in >> std::ws, bsdf); bsdfs.push_back(bsdf)) {
    std::size_t count = 0;
    for (in >> count; in && count > 0; --count) {
      MitsubaScattering& e = rows.emplace_back(MitsubaScattering{static_cast<int>(bsdfs.size()), {}, {}, {}, 0.0f});
      for (Vec3f* v : {&e.wo, &e.wi, &e.value}) in >> v->x >> v->y >> v->z;
      in >> e.pdf;
    }
    ASSERT_TRUE(in) << file;
  }
  const MitsubaScene scene(bsdfs);
  Rng rng(1, RngPurpose::test, 0);
  std::size_t lit = 0;
  for (const MitsubaScattering& e : rows) {
    const ShadingPoint p = scene.shade(e.material, e.wo);
    const std::string what = bsdfs.at(static_cast<std::size_t>(e.material)) + " wo.z " + std::to_string(e.wo.z);
    lit += max_component(e.value) > 0.0f;
    expect_agreement(p, e, what + " wi.z " + std::to_string(e.wi.z));
    // What is drawn has the density and the weight of its direction.
    if (p.black) continue;
    const BsdfSample s = sample_bsdf(p.bsdf, p.to_local(e.wo), rng.uniform(), rng.uniform2());
    if (!s.valid || s.delta || s.null) continue;
    const BsdfValue v = evaluate_bsdf(p.bsdf, p.to_local(e.wo), s.wi);
    EXPECT_NEAR(s.pdf, v.pdf, 1e-6f + 5e-3f * v.pdf) << what << " drawn z " << s.wi.z;
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(s.weight[c] * v.pdf, v.value[c], 1e-6f + 5e-3f * v.value[c]) << what << " drawn z " << s.wi.z;
  }
  EXPECT_GT(lit, rows.size() / 5);
  EXPECT_GT(rows.size(), 0u);
}

}  // namespace
}  // namespace octrad
