// Models, as scene files give them, against numbers that Mitsuba 3 computed (tests/mitsuba_scattering_values.py).
#include "octrad/shading/mitsuba_scattering_test_data.h"

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "octrad/base/folder_test_helper.h"
#include "octrad/image/io.h"
#include "octrad/scene/load.h"
#include "octrad/scene/sample_measured.h"
#include "octrad/shading/materials.h"

namespace octrad {
namespace {

struct MitsubaScene {
  TestFolder folder;
  Scene scene;
  std::unique_ptr<Materials> materials;

  MitsubaScene() {
    Image tilt(2, 2, {"R", "G", "B"});
    for (std::size_t i = 0; i < tilt.data.size(); ++i) tilt.data[i] = kMitsubaTilt[static_cast<int>(i % 3)];
    write_exr(folder.file("tilt.exr"), tilt);
    for (const int part : {0, 1, 2, 4, 8})
      folder.write("part" + std::to_string(part) + ".bsdf", testing::measured_sample_file(part));
    std::string text =
        "<scene version=\"3.0.0\"><sensor type=\"perspective\"><float name=\"fov\" value=\"60\"/></sensor>\n";
    for (const char* bsdf : kMitsubaBsdfs) text += std::string("<shape type=\"sphere\">") + bsdf + "</shape>\n";
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
  static const MitsubaScene s;
  return s;
}

std::string words(int material, Vec3f wo, Vec3f wi) {
  return std::string(kMitsubaBsdfs[material]) + " wo.z " + std::to_string(wo.z) + " wi.z " + std::to_string(wi.z);
}

TEST(MitsubaScattering, Evaluations) {
  int lit = 0, behind = 0;
  for (const MitsubaScattering& e : kMitsubaScattering) {
    const ShadingPoint p = mitsuba_scene().shade(e.material, e.wo);
    BsdfValue v;
    if (!p.black) v = evaluate_bsdf(p.bsdf, p.to_local(e.wo), p.to_local(e.wi));
    const std::string what = words(e.material, e.wo, e.wi);
    lit += max_component(e.value) > 0.0f;
    behind += max_component(e.value) > 0.0f && e.wi.z < 0.0f;
    // Half vectors of refraction are differences of nearly equal vectors. The Bessel function of Mitsuba's hair is up
    // to .6 % too small.
    const float tolerance = p.bsdf.type == BsdfType::hair ? 6e-3f : 2e-3f;
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(v.value[c], e.value[c], 1e-6f + tolerance * e.value[c]) << what;
    if (max_component(e.value) > 0.0f) {
      EXPECT_NEAR(v.pdf, e.pdf, 1e-6f + tolerance * e.pdf) << "pdf " << what;
    }
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

}  // namespace
}  // namespace octrad
