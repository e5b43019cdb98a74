// Parameters of a surface's scattering. Wrappers (twosided, mask, bumpmap, normalmap) are flattened into fields; nested
// bsdfs keep one scattering model a record, and a blend refers to the materials that it mixes. The models themselves
// are in shading/bsdf/.
#pragma once

#include <string>

#include "octrad/base/vec.h"
#include "octrad/scene/material_types.h"

namespace octrad {

struct Material {
  std::string id;
  BsdfType type = BsdfType::diffuse;
  bool two_sided = false;  // wrapped in `twosided`: the back scatters like the front (or like `back`)
  int back = -1;           // material of the back side when twosided holds two bsdfs
  int opacity = -1;        // `mask`: scalar texture, 1 opaque
  int bump = -1;           // `bumpmap`: scalar displacement texture; `normalmap`: normals, as colours
  float bump_scale = 1.0f;

  int reflectance = -1;             // texture index: `reflectance`, `diffuse_reflectance` or `base_color`
  int specular_reflectance = -1;    // texture index, -1: 1
  int specular_transmittance = -1;  // texture index, -1: 1
  int alpha_u = -1, alpha_v = -1;   // scalar textures; roughness as GGX/Beckmann alpha
  MicrofacetDistribution distribution = MicrofacetDistribution::beckmann;
  bool sample_visible = true;
  bool nonlinear = false;  // plastic: colour shift by internal scattering
  float int_ior = 1.5046f, ext_ior = 1.000277f;
  Vec3f eta{0, 0, 0}, k{1, 1, 1};  // conductor: complex index; eta = 0, k = 1 is Mitsuba's "none" (100 % mirror)

  // Bump and normal maps: what the texture holds, whether they stand inside `twosided`, Mitsuba's remedies against
  // black spots.
  bool normal_map = false, bump_mirrored = false, bump_flips = true, bump_shadows = true;
  int blended[2] = {-1, -1};         // blendbsdf: materials
  int measured = -1;                 // index into Scene::measured
  int extra[ExtraParameter::count];  // scalar textures of OCTRAD_EXTRA_PARAMETERS, -1: 0
  Material() {
    for (int& texture : extra) texture = -1;
  }
};

}  // namespace octrad
