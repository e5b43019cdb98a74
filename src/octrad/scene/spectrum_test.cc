// Spectra as the RGB that Mitsuba makes of them.
#include "octrad/scene/spectrum.h"

#include <gtest/gtest.h>

#include "octrad/base/error.h"
#include "octrad/base/folder_test_helper.h"
#include "octrad/scene/load.h"
#include "octrad/scene/mitsuba_spectra_test_data.h"

namespace octrad {
namespace {

void expect_close(Vec3f found, Vec3f expected, const std::string& what) {
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(found[c], expected[c], 2e-6f * (1.0f + expected[c])) << what << " " << c;
}

class SpectrumTest : public ::testing::Test {
 protected:
  Scene load(const std::string& body) const {
    return load_scene(
        folder_.write("s.xml", "<scene version=\"3.0.0\"><sensor type=\"perspective\"/>\n" + body + "</scene>"));
  }
  // The constant that `spectrum` (its name is NAME) stands for.
  Vec3f emission(std::string spectrum) const {
    spectrum.replace(spectrum.find("NAME"), 4, "radiance");
    const Scene scene = load("<shape type=\"sphere\"><emitter type=\"area\">" + spectrum + "</emitter></shape>");
    return scene.textures.at(static_cast<std::size_t>(scene.area_lights.at(0).radiance)).color0;
  }
  Vec3f reflectance(std::string spectrum) const {
    spectrum.replace(spectrum.find("NAME"), 4, "reflectance");
    const Scene scene = load("<shape type=\"sphere\"><bsdf type=\"diffuse\">" + spectrum + "</bsdf></shape>");
    return scene.textures.at(static_cast<std::size_t>(scene.materials.at(1).reflectance)).color0;
  }
  Vec3f eta(const std::string& spectrum) const {
    return load("<shape type=\"sphere\"><bsdf type=\"conductor\">" + spectrum + "</bsdf></shape>").materials.at(1).eta;
  }
  std::string error(const std::string& spectrum) const {
    try {
      emission(spectrum);
    } catch (const Error& e) {
      return e.what();
    }
    return "no error";
  }
  TestFolder folder_;
};

TEST_F(SpectrumTest, AsMitsuba) {
  std::size_t count = 0;
  for (const testing::MitsubaSpectrum& s : testing::kMitsubaSpectra) {
    const std::string value = " value=\"" + std::string(s.text) + "\"/>";
    expect_close(emission("<spectrum name=\"NAME\"" + value), s.emission, s.text);
    expect_close(reflectance("<spectrum name=\"NAME\"" + value), s.reflectance, s.text);
    expect_close(eta("<spectrum name=\"eta\"" + value), s.index, s.text);
    // The same from a file.
    std::string lines = "# wavelength value\n\n";
    for (const char c : std::string(s.text)) lines += c == ':' ? ' ' : c == ',' || c == ' ' ? '\n' : c;
    folder_.write("s.spd", lines);
    expect_close(emission("<spectrum name=\"NAME\" filename=\"s.spd\"/>"), s.emission, s.text);
    ++count;
  }
  EXPECT_GE(count, 5u);
}

TEST_F(SpectrumTest, Types) {
  const std::string first = testing::kMitsubaSpectra[0].text;
  ASSERT_EQ(first, "400:0.1, 500:0.5, 600:0.9, 700:0.3");
  const Vec3f expected = testing::kMitsubaSpectra[0].emission;
  const auto typed = [](const std::string& type, const std::string& inside) {
    return "<spectrum name=\"NAME\" type=\"" + type + "\">" + inside + "</spectrum>";
  };
  const std::string values = "<string name=\"values\" value=\"0.1, 0.5 0.9, 0.3\"/>";
  expect_close(
      emission(typed(
          "regular",
          values + "<float name=\"wavelength_min\" value=\"400\"/><float name=\"wavelength_max\" value=\"700\"/>")),
      expected, "regular");
  expect_close(
      emission(typed("regular",
                     values + "<float name=\"lambda_min\" value=\"400\"/><float name=\"lambda_max\" value=\"700\"/>")),
      expected, "Mitsuba 2");
  expect_close(emission(typed("regular", values + "<string name=\"range\" value=\"400, 700\"/>")), expected, "range");
  expect_close(emission(typed("irregular", values + "<string name=\"wavelengths\" value=\"400 500 600 700\"/>")),
               expected, "irregular");
  // Of Mitsuba 3.9.1: a number alone is a spectrum of that value, `uniform` is white.
  expect_close(emission("<spectrum name=\"NAME\" value=\"0.5\"/>"), {0.60239697f, 0.4741455f, 0.45445803f}, "number");
  expect_close(reflectance("<spectrum name=\"NAME\" value=\"0.5\"/>"), Vec3f(0.5f), "number");
  EXPECT_EQ(emission(typed("uniform", "<float name=\"value\" value=\"0.75\"/>")), Vec3f(0.75f));
  EXPECT_EQ(emission(typed("d65", "<float name=\"scale\" value=\"3\"/>")), Vec3f(3.0f));
  EXPECT_EQ(emission(typed("d65", "<rgb name=\"color\" value=\"0.5 0.25 2\"/>")), Vec3f(0.5f, 0.25f, 2.0f));
  EXPECT_EQ(reflectance(typed("srgb", "<rgb name=\"color\" value=\"0.5 0.25 1\"/>")), Vec3f(0.5f, 0.25f, 1.0f));
  EXPECT_EQ(
      reflectance(
          "<texture name=\"NAME\" type=\"rawconstant\"><vector name=\"value\" x=\"0.5\" y=\"0.25\" z=\"1\"/></texture>"),
      Vec3f(0.5f, 0.25f, 1.0f));
}

// Planck's law: 2 h c^2 / lambda^5 / (exp(h c / (lambda k T)) - 1) at 500 nm and 5000 K is 12107 W m^-2 sr^-1 nm^-1.
TEST_F(SpectrumTest, Blackbody) {
  const Spectrum s = blackbody_spectrum(5000.0);
  ASSERT_EQ(s.wavelengths[140], 500.0);
  EXPECT_NEAR(s.values[140], 12107.2, 1.0);
  const auto light = [&](const std::string& kelvin) {
    return emission("<spectrum name=\"NAME\" type=\"blackbody\"><float name=\"temperature\" value=\"" + kelvin +
                    "\"/></spectrum>");
  };
  const Vec3f warm = light("2000"), cold = light("12000"), white = light("6504");
  EXPECT_GT(warm.x, 2.0f * warm.y);
  EXPECT_GT(warm.y, 2.0f * warm.z);
  EXPECT_GT(cold.z, 1.2f * cold.x);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(white[c] / luminance(white), 1.0f, 0.05f);
  EXPECT_NE(error("<spectrum name=\"NAME\" type=\"blackbody\"><float name=\"temperature\" value=\"-1\"/></spectrum>")
                .find("must be between"),
            std::string::npos);
}

TEST_F(SpectrumTest, Mistakes) {
  const auto bad = [&](const std::string& spectrum, const std::string& part) {
    const std::string message = error(spectrum);
    EXPECT_NE(message.find(part), std::string::npos) << message;
    EXPECT_NE(message.find(":2:"), std::string::npos) << message;
  };
  bad("<spectrum name=\"NAME\" value=\"500:1, 400:1\"/>", "must increase");
  bad("<spectrum name=\"NAME\" value=\"500:1\"/>", "at least two");
  bad("<spectrum name=\"NAME\" value=\"500:1, 600\"/>", "pairs \"wavelength:value\"");
  bad("<spectrum name=\"NAME\" value=\"1 2\"/>", "not one number");
  bad("<spectrum name=\"NAME\" filename=\"none.spd\"/>", "does not exist");
  bad("<spectrum name=\"NAME\" type=\"sky\"/>", "spectrum \"sky\" is not supported; supported: uniform, d65");
  bad("<spectrum name=\"NAME\" type=\"irregular\"><string name=\"wavelengths\" value=\"400 500\"/><string name=\"values\" value=\"1\"/></spectrum>",
      "as many values as wavelengths");
  folder_.write("b.spd", "400 1 7\n500\n");
  EXPECT_NE(error("<spectrum name=\"NAME\" filename=\"b.spd\"/>").find("b.spd:2:1: expected a wavelength and a value"),
            std::string::npos);
  // A blackbody reflects nothing of its own.
  EXPECT_THROW(reflectance("<spectrum name=\"NAME\" type=\"blackbody\"/>"), InputError);
}

}  // namespace
}  // namespace octrad
