#include "octrad/scene/plugin_help.h"

namespace octrad {
namespace {

const std::vector<PluginKindHelp> kPluginHelp = {
    {"shape",
     "`bsdf` and `emitter` nested or referred to; `to_world`; `flip_normals`, but for curves",
     {
         {{"obj", "ply"}, "`filename`, `face_normals` (false), `flip_tex_coords` (true for obj, false for ply)"},
         {{"serialized"},
          "`filename`, `shape_index` (0), `face_normals`; versions 3 and 4, both precisions; vertex colours are "
          "skipped"},
         {{"rectangle"}, "[−1, 1]² facing +z"},
         {{"cube"}, "[−1, 1]³"},
         {{"disk"}, "radius 1 in the xy-plane, facing +z; 256 triangles of the same area"},
         {{"cylinder"},
          "`p0` (0, 0, 0), `p1` (0, 0, 1), `radius` (1); open, facing outwards; 256 facets of the same area"},
         {{"linearcurve", "bsplinecurve"},
          "`filename`: text with a control point a line, x y z radius, and empty lines between curves. Radii do not "
          "follow the transform. Tubes of 48 sides, fewer in files of many points: cones between spheres "
          "(`linearcurve`), or cubic B-splines that are open at their ends (`bsplinecurve`). Rays from inside pass "
          "them"},
         {{"sphere"},
          "`center`, `radius`; `to_world` may rotate, move, mirror and scale; where it scales the axes differently, "
          "the first one's scale counts, as in Mitsuba"},
         {{"shapegroup"},
          "shapes without emitters, which are seen only where an instance puts them; no groups or instances inside"},
         {{"merge"}, "its shapes, each by itself"},
         {{"instance"},
          "a `<ref>` to a shapegroup, `to_world` (any; with a sphere in the group it may scale only all axes alike)"},
     }},
    {"bsdf",
     "",
     {
         {{"diffuse"}, "`reflectance` (0.5)"},
         {{"roughdiffuse"},
          "`reflectance` (0.5), `alpha` (0.2): Oren and Nayar's model, of Mitsuba 0.6 (Mitsuba 3 has none)"},
         {{"plastic"},
          "`diffuse_reflectance` (0.5), `specular_reflectance` (1), `int_ior` (polypropylene; must be above the "
          "other), `ext_ior` (air), `nonlinear` (false)"},
         {{"roughplastic"}, "`alpha` (0.1), `distribution` (beckmann; ggx), `sample_visible` (true)", "plastic"},
         {{"conductor"}, "`material` (none), or `eta` and `k`; `specular_reflectance` (1)"},
         {{"roughconductor"},
          "`alpha` (0.1), or `alpha_u` and `alpha_v`, `distribution` (beckmann; ggx), `sample_visible` (true)",
          "conductor"},
         {{"dielectric", "thindielectric"},
          "`int_ior` (bk7), `ext_ior` (air), `specular_reflectance` (1), `specular_transmittance` (1)"},
         {{"roughdielectric"},
          "`alpha` (0.1), or `alpha_u` and `alpha_v`, `distribution` (beckmann; ggx), `sample_visible` (true); the "
          "indices must differ",
          "dielectric"},
         {{"principled"},
          "`base_color` (0.5), `roughness` (0.5), `metallic`, `anisotropic`, `spec_trans`, `spec_tint`, `sheen`, "
          "`sheen_tint`, `flatness`, `clearcoat`, `clearcoat_gloss` (0 each), `eta` or `specular` (0.5), "
          "`main_specular_sampling_rate`, `clearcoat_sampling_rate`, `diffuse_reflectance_sampling_rate` (1 each)"},
         {{"principledthin"},
          "`base_color` (0.5), `roughness` (0.5), `anisotropic`, `spec_trans`, `spec_tint`, `sheen`, `sheen_tint`, "
          "`flatness`, `diff_trans` (0 each; `diff_trans` up to 2), `eta` (1.5), "
          "`specular_reflectance_sampling_rate`, `specular_transmittance_sampling_rate`, "
          "`diffuse_reflectance_sampling_rate`, `diffuse_transmittance_sampling_rate` (1 each)"},
         {{"hair"},
          "`eumelanin` (1.3) and `pheomelanin` (0.2), concentrations of pigments; or, instead of both, `sigma_a`: "
          "absorption in one radius of the fibre, a constant colour, times `scale` (1); `longitudinal_roughness`, "
          "`azimuthal_roughness` (0.3 each), `scale_tilt` (2; degrees), `int_ior` (amber), `ext_ior` (air); "
          "roughnesses between 0 and 1, the tilt within ±90, the indices must differ; for curves"},
         {{"measured"},
          "`filename`: of the [RGL material database](https://rgl.epfl.ch/materials), the file whose name ends in "
          "`_rgb.bsdf` or `_spec.bsdf`, whose spectra become colours under D65; light from the front is reflected, the back is black"},
         {{"null"}, "none: light passes"},
         {{"blendbsdf"}, "`weight` of the second (to be given), two bsdfs, which may be blends: eight in all"},
         {{"twosided"}, "one bsdf, or two for front and back; nothing that lets light through"},
         {{"mask"},
          "`opacity` (0.5), one bsdf; around `twosided`, not inside it; inside another `mask` the opacities multiply, "
          "of which one may be a texture"},
         {{"bumpmap"},
          "one `bitmap` texture, `scale` (1), one bsdf, `flip_invalid_normals` (true), `use_shadowing_function` "
          "(true); around a `blendbsdf`, not inside it"},
         {{"normalmap"},
          "`normalmap` (texture of normals), one bsdf, `flip_invalid_normals` (true), `use_shadowing_function` (true); "
          "around one part of a `blendbsdf` or all of it"},
     }},
    {"texture",
     "",
     {
         {{"bitmap"},
          "`filename`, `filter_type` (bilinear; nearest), `wrap_mode` (repeat; mirror, clamp), `raw` (false), "
          "`to_uv`"},
         {{"checkerboard"},
          "`color0` (0.4), `color1` (0.2), both constants, `to_uv`; where it serves as a number, the two are "
          "exchanged, as in Mitsuba"},
         {{"mesh_attribute"},
          "`name` (vertex_… or face_…), `scale` (1): one or three channels of a `ply` file, named as in Mitsuba: "
          "properties weight_0 or weight_x … make weight; r, g, b or red … make color; integers but bytes (uchar) are "
          "shares of their type's largest, encoded as sRGB, as in Mitsuba 3.9. Not on one shape with textures over "
          "uv"},
     }},
    {"spectrum",
     "",
     {
         {{"uniform"}, "`value` (1): the same in all channels"},
         {{"d65"}, "`scale` (1), `color` (an `<rgb>`; 1): white light"},
         {{"srgb"}, "`color`, an `<rgb>`"},
         {{"rawconstant"}, "`value` (a `<float>` or `<vector>`)"},
         {{"regular"}, "`wavelength_min` (360), `wavelength_max` (830), or `range`, both; `values`"},
         {{"irregular"}, "`wavelengths`, `values`"},
         {{"blackbody"},
          "`temperature` (5000), in kelvin, `scale` (1): radiance by Planck's law, W m⁻² sr⁻¹ nm⁻¹; emitters only"},
     }},
    {"emitter",
     "`sampling_weight`, from 0 to 1e6",
     {
         {{"area"}, "inside a shape: `radiance` (1), also a texture"},
         {{"envmap"}, "`filename`, `scale` (1), `to_world`: any linear map of directions; moves change nothing"},
         {{"constant"}, "`radiance` (1)"},
         {{"point"}, "`intensity` (1), `position` or `to_world`, `through_masks` (false)"},
         {{"spot"},
          "`intensity` (1), `cutoff_angle` (20), `beam_width` (three quarters of that; as wide or wider: a sharp edge), "
          "`texture` over the square of the cutoff angle, `to_world` (looks along +z), `through_masks` (false)"},
         {{"directional"}, "`irradiance` (1), `direction` or `to_world` (shines along +z), `through_masks` (false)"},
         {{"projector"},
          "`irradiance` (1; a picture), `scale` (1), `fov` and `fov_axis` or `focal_length`, as sensors, `to_world`, "
          "`through_masks` (false)"},
     }},
    {"sensor",
     "",
     {
         {{"perspective"},
          "`fov` and `fov_axis` (x; y, diagonal, smaller, larger) or `focal_length` (50mm), "
          "`principal_point_offset_x` (0), `principal_point_offset_y` (0), `near_clip` (0.01), `far_clip` (10000), "
          "`to_world`"},
         {{"thinlens"},
          "`fov` and `fov_axis` or `focal_length` (50mm), `aperture_radius` (to be given; 0: a pinhole), "
          "`focus_distance` (that of the far plane), `near_clip` (0.01), `far_clip` (10000), `to_world`"},
         {{"orthographic"}, "sees [−1, 1] across, which `to_world` scales; `near_clip` (0.01), `far_clip` (10000)"},
     }},
    {"film",
     "",
     {
         {{"hdrfilm"},
          "`width` (768), `height` (576), the window `crop_offset_x` (0), `crop_offset_y` (0), `crop_width` (the "
          "width), `crop_height` (the height); a filter"},
     }},
    {"rfilter",
     "",
     {
         {{"box", "catmullrom"}, "none"},
         {{"tent"}, "`radius` (1)"},
         {{"gaussian"}, "`stddev` (0.5); films without a filter have this one"},
         {{"mitchell"}, "`B`, `C` (1/3 each)"},
         {{"lanczos"}, "`lobes` (3)"},
     }},
};

}  // namespace

const std::vector<PluginKindHelp>& plugin_help() { return kPluginHelp; }

}  // namespace octrad
