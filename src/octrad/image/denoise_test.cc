// Which layers a denoiser takes, and libraries that are none. The denoiser itself: tests/cli/test_denoise.py.
#include "octrad/image/denoise.h"

#include <gtest/gtest.h>
#include <stdlib.h>

#include "octrad/base/error.h"
#include "octrad/image/oidn_library.h"

namespace octrad {
namespace {

DenoiseLayers layers_of(std::vector<std::string> channels) {
  return find_denoise_layers(Image(1, 1, std::move(channels)));
}

TEST(DenoiseLayers, AreFoundByTheirNames) {
  DenoiseLayers layers =
      layers_of({"R", "G", "B", "albedo.R", "albedo.G", "albedo.B", "depth.Z", "normal.X", "normal.Y", "normal.Z"});
  EXPECT_EQ(layers.colour[0], 0);
  EXPECT_EQ(layers.albedo[2], 5);
  EXPECT_EQ(layers.normal[0], 7);
  layers = layers_of({"X", "Y", "Z"});  // vectors are no colour
  EXPECT_EQ(layers.colour[0], -1);
  layers = layers_of({"R", "G", "B", "albedo.R", "albedo.G", "N.X", "N.Y", "N.Z", "Ns.X", "Ns.Y", "Ns.Z"});
  EXPECT_EQ(layers.albedo[0], -1) << "it has no B";
  EXPECT_EQ(layers.normal[1], 9) << "shading normals before geometric ones";
  layers = layers_of({"Layer.Combined.B", "Layer.Combined.G", "Layer.Combined.R", "Layer.Denoising Albedo.B",
                      "Layer.Denoising Albedo.G", "Layer.Denoising Albedo.R"});
  EXPECT_EQ(layers.colour[0], 2);
  EXPECT_EQ(layers.albedo[0], 5);
}

TEST(OidnLibrary, RefusesWhatIsNone) {
  EXPECT_THROW(OidnLibrary("/nowhere/libOpenImageDenoise.so.2"), IoError);
  EXPECT_THROW(OidnLibrary("/proc/self/exe"), InputError);
  EXPECT_THROW(Denoiser({.library = "/nowhere"}), IoError);
  DenoiseOptions options;
  options.albedo = false;
  EXPECT_THROW(Denoiser{options}, UsageError) << "normals alone";
}

}  // namespace
}  // namespace octrad
