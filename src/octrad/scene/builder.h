// Turns a Description into a Scene. Internal to the module; see load.h.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "octrad/base/memory_limit.h"
#include "octrad/scene/description.h"
#include "octrad/scene/mesh.h"
#include "octrad/scene/params.h"
#include "octrad/scene/scene.h"
#include "octrad/scene/spectrum.h"
#include "octrad/scene/texture_roles.h"

namespace octrad {

class SceneBuilder {
 public:
  explicit SceneBuilder(const Description& description) : description_(description) {}
  Scene build();

 private:
  SceneReport& report() const { return *description_.report; }
  // Adds an object to the scene; where a mistake is collected, what it left behind is taken out again.
  template <typename Add>
  void add(const Element& element, Add&& add) {
    const Mark before = mark();
    if (!report().attempt(element.location, add)) roll_back(before, element);
  }
  struct Mark {
    std::size_t lights, meshes, mesh_jobs, spheres, environments, bitmaps, open;
    bool in_shape;
  };
  Mark mark() const;
  void roll_back(const Mark& mark, const Element& element);

  // load.cc
  void add_object(const Element& element);
  void drop_failed_shapes();
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
  Material flatten(const Element& element);  // with wrappers folded in; a stand-in where it cannot be used
  Material read_bsdf(const Element& element);
  Material scattering_model(Params& params);
#define OCTRAD_READ(name, Model, transmits) void read_##name(Params& params, Material& m);
  OCTRAD_BSDF_LIST(OCTRAD_READ)  // the parameters of each model
#undef OCTRAD_READ
  void microfacets(Params& params, Material& m);
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
  struct BitmapJob;
  void fill_bitmap(const BitmapJob& job, int width, int height, std::vector<Vec3f> pixels);

  // load_spectra.cc
  Vec3f spectrum_value(const Element& element, TextureRole role);
  Vec3f rgb_of(const Spectrum& spectrum, TextureRole role, const Location& where);

  // load_attributes.cc
  struct MeshJob;
  int attribute_texture(const Element& element, TextureRole role);
  // What kinds of textures an object or what it refers to holds; bits.
  enum : unsigned { kUsesAttributes = 1, kUsesUv = 2 };
  unsigned texture_kinds(const Element& element);
  void check_attribute_use(const Element& shape, bool mesh);
  void place_attributes(MeshJob& job, const std::vector<MeshAttribute>& attributes);

  struct BitmapJob {
    int texture = -1;  // or -1: the environment
    std::string path;
    bool raw = false, scalar = false;
    std::vector<TextureRole> roles;  // what its values must do for
    float scale = 1.0f;
    Location where;
  };
  // A texture that shows an attribute of a mesh.
  struct AttributeUse {
    int texture = -1;
    std::string name;  // vertex_... or face_...
    float scale = 1.0f;
    TextureRole role = TextureRole::reflectance;
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
    std::vector<AttributeUse> attributes;
    bool failed = false;
  };

  const Description& description_;
  Scene scene_;
  // By element, and the shape for which it was made where it shows attributes of the shape's mesh (else -1).
  std::map<std::pair<const Element*, int>, int> materials_;
  std::vector<const Element*> open_materials_;
  std::map<std::pair<const Element*, bool>, int> textures_;  // by element, and whether it is reduced to a scalar
  std::map<int, std::size_t> bitmap_of_;                     // texture -> bitmaps_
  std::map<std::tuple<float, float, float>, int> constants_;
  std::map<const Element*, unsigned> texture_kinds_;
  std::vector<AttributeUse> attribute_uses_;  // of the shape that is being added
  bool in_shape_ = false;
  int black_material_ = -1;
  bool has_integrator_ = false;
  MemoryMeter shape_meter_{"the shapes of the scene"};
  std::vector<BitmapJob> bitmaps_;
  std::vector<MeshJob> mesh_jobs_;
};

// The scene of a whole description, with what its report says.
Scene build_scene(const Description& description);

}  // namespace octrad
