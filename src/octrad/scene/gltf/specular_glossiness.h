// KHR_materials_pbrSpecularGlossiness, which glTF files had before the material's other extensions, in the terms of
// metallic-roughness. Internal to gltf*.cc.
#pragma once

#include <functional>

#include "octrad/base/vec.h"
#include "octrad/image/image.h"

namespace octrad {

// What a dielectric of glTF reflects straight on.
inline constexpr double kGltfDielectric = 0.04;

// A surface that is metallic by a share.
struct GltfMetal {
  Vec3d base;  // colour
  double metallic;
};

// The surface that scatters as much as one of a `diffuse` colour under a coat of a `specular` one, both in [0, 1].
//
// Specular-glossiness reflects `specular` straight on, and diffusely `diffuse` (1 - the largest of `specular`);
// metallic-roughness `dielectric` (1 - metallic) + base metallic and base (1 - metallic) (1 - dielectric). Of a grey
// surface both are met: with d = diffuse (1 - specular) / (1 - dielectric), metallic solves
//   dielectric metallic^2 + (d + specular - 2 dielectric) metallic + dielectric - specular = 0.
// Of colours the brightness, sqrt(.299 r^2 + .587 g^2 + .114 b^2), stands for the grey, and the base colour is between
// those that either equation gives, at metallic^2. This is how Khronos' own example converts
// (KhronosGroup/glTF, extensions/2.0/Archived/KHR_materials_pbrSpecularGlossiness, convert-between-workflows).
GltfMetal metal_of_specular(Vec3d diffuse, Vec3d specular);

// Pictures of that, linear. Colours are those of a picture times the factor, or the factor where there is none; both
// pictures lie on the surface in the same way.
struct GltfSpecularPictures {
  Vec3d diffuse, specular;                                   // factors
  std::function<Image()> diffuse_picture, specular_picture;  // one at least
  bool repeats = true;                                       // else the edges go on
  std::string name;                                          // of one, for errors
};
// In the size of the one with more pixels: the base colour, or the metallic share.
Image picture_of_metal(const GltfSpecularPictures& pictures, bool metallic);

}  // namespace octrad
