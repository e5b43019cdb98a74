// Turns a Description into a Scene. Internal to the module; see load.h.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "octrad/base/memory_limit.h"
#include "octrad/image/image.h"
#include "octrad/scene/curves.h"
#include "octrad/scene/description.h"
#include "octrad/scene/mesh.h"
#include "octrad/scene/params.h"
#include "octrad/scene/scene.h"
#include "octrad/scene/shared_file.h"
#include "octrad/scene/spectrum.h"
#include "octrad/scene/texture_roles.h"

namespace octrad {

class SceneBuilder {
 public:
  explicit SceneBuilder(const Description& description)
      : description_(description),
        shape_meter_(description.root->location.text() + ": the list of shapes") {}
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
    std::size_t lights, delta_lights, projectors, shapes, placements, groups, meshes, mesh_jobs, spheres, environments,
        bitmaps, open, materials;
    bool in_shape;
  };
  Mark mark() const;
  void roll_back(const Mark& mark, const Element& element);

  // load.cc
  void add_object(const Element& element);
  void drop_failed_shapes();
  void check_complete() const;
  void add_integrator(const Element& element);
  void load_files();
  void share_files();

  // load_sensors.cc
  void add_sensor(const Element& element);
  Film read_film(const Element& element, Camera& camera);  // sets the camera's picture and crop window
  void read_filter(const Element& element, Film& film);
  void field_of_view(Params& params, float& degrees, Camera::FovAxis& fov_axis);

  // load_emitters.cc
  void add_emitter(const Element& element);
  void add_environment(Params& params);
  float sampling_weight(Params& params);
  void add_delta_light(Params& params);
  void aim_projectors();

  // A texture that shows an attribute of a mesh.
  struct AttributeUse {
    int texture = -1;
    std::string name;  // vertex_... or face_...
    float scale = 1.0f;
    TextureRole role = TextureRole::reflectance;
    bool srgb = false;  // colours of Mitsuba 0.6 (vertexcolors): bytes are shares of 255, and all are encoded
    Location where;
  };
  struct MeshJob {
    int mesh = -1;
    const Element* element = nullptr;  // of the shape
    std::string path;                  // empty: `raw` is filled already
    enum class Format { obj, ply, serialized } format = Format::obj;
    std::optional<CurveKind> curve;  // the file holds such curves instead
    int index = 0;                   // of the mesh in a serialized file
    RawMesh raw;
    Transform to_world;
    MeshOptions options;
    Location where;
    std::vector<AttributeUse> attributes;
    bool failed = false, empty = false;   // could not be read; holds no triangle
    SharedFile<RawMesh>* file = nullptr;  // of `path`; of curves:
    SharedFile<Curves>* curve_file = nullptr;
    const Curves* built_curves = nullptr;  // or those that are in no file
  };
  static void read_mesh(MeshJob& job);  // load.cc

  // load_shapes.cc
  // A sphere as its file gives it.
  struct SphereJob {
    Transform to_world;
    Vec3d center;
    float radius = 1.0f;
    bool flip_normals = false;
    Location where;  // of to_world
  };
  // What a shape group holds: meshes, which all instances share, and spheres, of which each has its own.
  struct Group {
    std::vector<Shape> meshes;
    std::vector<std::pair<Shape, SphereJob>> spheres;
  };
  void add_shape(const Element& element);
  // A shape that has its mesh and material but is not in the scene yet; spheres are described by `sphere`.
  Shape read_shape(Params& params, SphereJob& sphere, bool in_group);
  void read_mesh_source(Params& params, MeshJob& job);
  void add_sphere(Shape shape, const SphereJob& job, const Transform& placement, bool shape_in_group);
  int shape_material(Params& params, bool emits);
  const Group& group(const Element& element);
  void add_instance(Params& params);
  void find_bounds();

  // load_materials.cc
  int material(const Element& element);      // index, building it on first use
  Material flatten(const Element& element);  // with wrappers folded in; a stand-in where it cannot be used
  Material read_bsdf(const Element& element);
  Material scattering_model(Params& params);
  void map_normals(Material& m, const Material& map, const Location& where);
  bool transmits(const Material& m) const;
  // Models in a blend and in the blends that it holds, seen from the front or from behind.
  int blended_count(const Material& m, bool behind) const;
  void read_extra(Params& params, Material& m, int parameter, const std::string& name, TextureRole role,
                  float fallback);
  void read_principled_base(Params& params, Material& m);
#define OCTRAD_READ(name, Model, transmits) void read_##name(Params& params, Material& m);
  OCTRAD_BSDF_LIST(OCTRAD_READ)  // the parameters of each model
#undef OCTRAD_READ
  void microfacets(Params& params, Material& m);
  void anisotropic_microfacets(Params& params, Material& m);
  void conductor_index(Params& params, Material& m);
  Vec3f constant_color(Params& params, const std::string& name, TextureRole role, Vec3f fallback);
  float index_of_refraction(Params& params, const std::string& name, const std::string& fallback);

  // load_textures.cc. `name` is a parameter of several permitted types; -1 where absent.
  int texture(Params& params, const std::string& name, TextureRole role);
  int texture_or(Params& params, const std::string& name, TextureRole role, float fallback);
  int texture_object(const Element& element, TextureRole role);
  int constant_texture(Vec3f value);
  // Of two textures of numbers; -1 where neither is constant.
  int product_texture(int a, int b);
  // Value of <float>, <integer>, <rgb> or <spectrum>; nullopt for other elements.
  std::optional<Vec3f> constant_value(const Element& element, TextureRole role);
  void load_bitmap(std::size_t job);
  struct BitmapJob;
  void fill_bitmap(const BitmapJob& job, int width, int height, std::vector<Vec3f> pixels);

  // load_spectra.cc
  Vec3f spectrum_value(const Element& element, TextureRole role);
  Vec3f rgb_of(const Spectrum& spectrum, TextureRole role, const Location& where);

  // load_attributes.cc
  int attribute_texture(const Element& element, TextureRole role);
  // What kinds of textures an object or what it refers to holds; bits.
  enum : unsigned { kUsesAttributes = 1, kUsesUv = 2 };
  unsigned texture_kinds(const Element& element, int depth = 0);
  void check_attribute_use(const Element& shape, bool mesh);
  void place_attributes(MeshJob& job, const std::vector<MeshAttribute>& attributes);

  struct BitmapJob {
    int texture = -1;  // or -1: the environment
    std::string path;
    const BuiltPicture* built = nullptr;  // instead of a file
    bool raw = false, scalar = false;
    std::vector<TextureRole> roles;  // what its values must do for
    float scale = 1.0f;
    float factor = 1.0f;       // of numbers, at most 1: of what their role permits
    std::size_t negative = 0;  // values of radiance that were read as 0
    std::size_t beyond = 0;    // values a little outside of [0, 1] that were read as its nearer end
    std::size_t bright = 0;    // texels of a reflectance that are far above 1, read as 1
    float brightest = 0.0f;    // and the largest value of these
    Location where;
  };
  struct Projector {
    std::size_t light;
    float fov_degrees;
    Camera::FovAxis fov_axis;
  };

  const Description& description_;
  Scene scene_;
  // By element, and the mesh for which it was made where it shows attributes of that (else -1).
  std::map<std::pair<const Element*, int>, int> materials_;
  std::vector<const Element*> open_materials_;
  // By element and role; bitmaps are one for all that shines, one for other colours, and one for all scalars.
  std::map<std::pair<const Element*, TextureRole>, int> textures_;
  std::map<int, std::size_t> bitmap_of_;  // texture -> bitmaps_
  std::map<std::tuple<float, float, float>, int> constants_;
  std::map<std::pair<int, float>, int> products_;  // of a texture and a constant
  // Colours of spectra, which may be long and be referred to often: by element, and by file.
  std::map<std::pair<const Element*, SpectrumUse>, Vec3f> spectra_;
  std::map<std::pair<std::string, SpectrumUse>, Vec3f> spectrum_files_;
  // Files of Scene::measured; each file is read once, also a broken one.
  struct MeasuredFile {
    int index = -1;
    std::exception_ptr mistake;
  };
  std::map<std::string, MeasuredFile> measured_files_;  // by canonical path
  std::map<const Element*, unsigned> texture_kinds_;
  std::vector<AttributeUse> attribute_uses_;  // of the shape that is being added
  bool in_shape_ = false;
  int black_material_ = -1;
  bool has_integrator_ = false;
  MemoryMeter shape_meter_;
  std::vector<BitmapJob> bitmaps_;
  std::vector<MeshJob> mesh_jobs_;
  // What load_files() reads: by path, and of meshes what else decides their content.
  std::map<std::string, SharedFile<Image>> picture_files_;
  std::map<std::tuple<std::string, MeshJob::Format, int, std::set<std::string>>, SharedFile<RawMesh>> mesh_files_;
  std::map<std::pair<std::string, CurveKind>, SharedFile<Curves>> curve_files_;
  std::vector<Projector> projectors_;
  std::map<const Element*, Group> groups_;
  std::vector<const Element*> group_order_;  // in which they were made
  std::vector<Location> placed_at_;          // of each placement
};

// The scene of a whole description, with what its report says.
Scene build_scene(const Description& description);

}  // namespace octrad
