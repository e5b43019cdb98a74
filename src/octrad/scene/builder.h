// Turns a Description into a Scene. Internal to the module; see load.h.
#pragma once

#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "octrad/base/memory_limit.h"
#include "octrad/scene/description.h"
#include "octrad/scene/mesh.h"
#include "octrad/scene/params.h"
#include "octrad/scene/scene.h"

namespace octrad {

// What a texture's values mean: decides the permitted range and whether colours are reduced to luminance.
enum class TextureRole {
  reflectance,  // colour in [0, 1]
  radiance,     // colour >= 0
  opacity,      // scalar in [0, 1]
  roughness,    // scalar in [0, 10]
  index,        // of refraction and absorption: scalar in [0, 1000]
  fraction,     // scalar in [0, 1]
  two_sides,    // scalar in [0, 2]
  normal,       // colour in [0, 1] that stands for a direction
  height,       // any scalar
};

class SceneBuilder {
 public:
  explicit SceneBuilder(const Description& description) : description_(description) {}
  Scene build();

 private:
  // load.cc
  void add_integrator(const Element& element);
  void add_sensor(const Element& element);
  void add_film(const Element& element, Camera& camera, bool first);
  void add_environment(const Element& element);
  void load_files();

  // load_shapes.cc
  void add_shape(const Element& element);
  void add_sphere(Params& params, Shape& shape, const Transform& to_world, bool flip_normals);
  int shape_material(Params& params, bool emits);

  // load_materials.cc
  int material(const Element& element);      // index, building it on first use
  Material flatten(const Element& element);  // with wrappers folded in
  Material scattering_model(Params& params);
  void map_normals(Material& m, const Material& map, const Location& where);
  bool transmits(const Material& m) const;
  int blended_count(const Material& m) const;  // models in a blend and in the blends that it holds
  void read_extra(Params& params, Material& m, int parameter, const std::string& name, TextureRole role,
                  float fallback);
  void read_principled_base(Params& params, Material& m);
#define OCTRAD_READ(name, Model, transmits) void read_##name(Params& params, Material& m);
  OCTRAD_BSDF_LIST(OCTRAD_READ)  // the parameters of each model
#undef OCTRAD_READ
  void microfacets(Params& params, Material& m);
  void anisotropic_microfacets(Params& params, Material& m);
  void conductor_index(Params& params, Material& m);
  Vec3f constant_color(Params& params, const std::string& name, Vec3f fallback);
  float index_of_refraction(Params& params, const std::string& name, const std::string& fallback);

  // load_textures.cc. `name` is a parameter of several permitted types; -1 where absent.
  int texture(Params& params, const std::string& name, TextureRole role);
  int texture_or(Params& params, const std::string& name, TextureRole role, float fallback);
  int texture_object(const Element& element, TextureRole role);
  int constant_texture(Vec3f value);
  // Value of <float>, <integer>, <rgb> or <spectrum>; nullopt for other elements.
  std::optional<Vec3f> constant_value(const Element& element, TextureRole role);
  void load_bitmap(std::size_t job);

  struct BitmapJob {
    int texture = -1;  // or -1: the environment
    std::string path;
    bool raw = false, scalar = false;
    std::vector<TextureRole> roles;  // what its values must do for
    float scale = 1.0f;
    Location where;
  };
  struct MeshJob {
    int mesh = -1;
    std::string path;  // empty: `raw` is filled already
    bool ply = false;
    RawMesh raw;
    Transform to_world;
    MeshOptions options;
    Location where;
  };

  const Description& description_;
  Scene scene_;
  std::map<const Element*, int> materials_;
  std::vector<const Element*> open_materials_;
  std::map<std::pair<const Element*, bool>, int> textures_;  // by element, and whether it is reduced to a scalar
  std::map<int, std::size_t> bitmap_of_;                     // texture -> bitmaps_
  std::map<std::tuple<float, float, float>, int> constants_;
  int black_material_ = -1;
  bool has_integrator_ = false;
  MemoryMeter shape_meter_{"the shapes of the scene"};
  std::vector<BitmapJob> bitmaps_;
  std::vector<MeshJob> mesh_jobs_;
};

}  // namespace octrad
