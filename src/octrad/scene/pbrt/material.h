// Materials, textures and colours of pbrt in the terms of Mitsuba's objects. Internal to pbrt*.cc.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "octrad/scene/built_files.h"
#include "octrad/scene/description.h"
#include "octrad/scene/make_element.h"
#include "octrad/scene/pbrt/file.h"
#include "octrad/scene/spectrum.h"

namespace octrad {

// What is done with the values of a texture: of roughnesses pbrt makes the alpha of microfacets.
enum class PbrtMap {
  none,
  root,            // alpha of a roughness, pbrt-v4
  fourth_root,     // the roughness of principled, whose square is alpha
  old_alpha,       // alpha of a roughness, pbrt-v3
  old_alpha_root,  // and the roughness of principled
  old_cut          // what pbrt-v3 cuts out: where alpha is 0
};
double pbrt_map(PbrtMap map, double value);

inline double channel_mean(Vec3d v) { return (v.x + v.y + v.z) / 3.0; }

struct PbrtMix;

struct PbrtTexture {
  enum class Kind { constant, picture, checkerboard } kind = Kind::constant;
  Vec3d value{1, 1, 1};  // the constant, the factor of a picture, the first colour of a checkerboard
  Vec3d other{1, 1, 1};  // the second
  std::string file;      // of a picture
  double gamma = 0.0;    // by which its values are encoded; 0: as the file's format says
  double gain = 1.0;     // of its values before they are inverted
  bool invert = false, nearest = false;
  // One number of each of its pixels: their alpha where not all are opaque, else the mean of their colour (pbrt-v4).
  bool number = false;
  std::string wrap = "repeat";
  double scale[2] = {1, 1}, offset[2] = {0, 0};  // of the texture coordinates
  std::shared_ptr<const PbrtMix> mix;            // of which the picture is made instead of a file
  int files = 0;                                 // that it is made of
  int repeats[2] = {1, 1};                       // of its files, in it

  bool operator==(const PbrtTexture&) const = default;
  bool is_constant() const { return kind == Kind::constant; }
};

// The product of two textures, or the second in the share `amount` and the first in the rest. A picture that is made of
// it shows its pictures so often in both directions; the fields of its checkerboards are so many of it.
struct PbrtMix {
  PbrtTexture a, b, amount;
  bool product = false;
  int repeats[2] = {1, 1}, fields[2] = {1, 1};
};

class PbrtMaterials {
 public:
  // `old`: the file is one of pbrt-v3. Adds to the root of `description`.
  PbrtMaterials(bool old, Description& description, SceneReport& report)
      : old_(old),
        description_(description),
        report_(report) {}

  void set_version(bool old) { old_ = old; }

  using Object = std::shared_ptr<const PbrtObject>;
  // `number`: a float texture, otherwise one of colours.
  void add_texture(bool number, const std::string& name, Object texture) {
    objects_[{number, name}].emplace_back(serial_++, std::move(texture));
  }
  void add_named(const std::string& name, Object material) {
    named_[name].emplace_back(serial_++, std::move(material));
  }
  // How many of both there are. Names of version 3 stand for what was defined before they were used.
  std::size_t serial() const { return serial_; }
  Object named(const std::string& name, const Location& where, std::size_t serial) const;
  // The same for shapes: a name of version 4 may be defined later, and then this stands for it.
  Object named_for_shapes(const std::string& name, const Location& where);
  // What stands for a name that was not defined yet: what has it now.
  bool is_promise(const Object& material) const { return promised_.count(material.get()) > 0; }
  Object resolved(const Object& material) const;

  // What the film makes of radiance: all lights are multiplied by it.
  double exposure = 1.0;

  // The id of a bsdf for a shape of that material, which may have an alpha; null: what pbrt takes where a file says
  // nothing. It is added by add_bsdfs(), when all names are known.
  std::string bsdf(const Object& material, const PbrtObject& shape);
  void add_bsdfs();

  // A constant colour; nullopt where the object has no such parameter. Emission: spectra have a luminance of 1, as in
  // pbrt-v4.
  std::optional<Vec3d> color(const PbrtObject& object, std::string_view name, SpectrumUse use) const;
  // L, I ... of a light with its scale and the exposure.
  Vec3d strength(const PbrtObject& light, const char* name) const;
  // An area light on a shape; `area`: of the shape in the scene, for a light that has a power. A light on both sides
  // has another shape for the other side.
  void add_emitter(Element& shape, const Object& light, double area);
  // A picture that is made, under a name of its own for each `key`.
  std::string build_picture(const std::string& key, BuiltPicture picture);

 private:
  PbrtTexture texture(const PbrtObject& object, std::string_view name, bool number, Vec3d fallback);
  // Where the file has a texture, the fallback with a note.
  double constant_number(const PbrtObject& object, std::string_view name, double fallback);
  bool has_texture(const PbrtObject& object, std::string_view name, bool number) const;
  PbrtTexture named_texture(const std::string& name, bool number, const PbrtParameter& user);
  PbrtTexture evaluate(const PbrtObject& object, bool number);
  PbrtTexture picture(const PbrtObject& object);
  PbrtTexture mixed(const PbrtObject& object, PbrtMix mix) const;
  std::optional<Vec3d> named_spectrum(const std::string& name, SpectrumUse use) const;

  // A number of a picture is at least 0, a share from 0 to 1, a height any.
  enum class Role { color, number, share, height, radiance };
  void add(Element& parent, const Location& where, const std::string& name, const PbrtTexture& t, Role role,
           PbrtMap map = PbrtMap::none);
  void add_color(Element& bsdf, const std::string& name, const PbrtObject& m, std::string_view parameter,
                 double fallback);
  void add_value(Element& bsdf, const std::string& name, const PbrtObject& m, std::string_view parameter,
                 double fallback);
  void add_number(Element& parent, const Location& where, const std::string& name, double value) const;

  // The two roughnesses of a material.
  struct Roughness {
    PbrtTexture u, v;
    bool remap = true;
    bool smooth = false;  // as pbrt counts it: alpha below .001
  };
  Roughness roughness(const PbrtObject& m, const std::string& prefix, double fallback);
  PbrtMap alpha_map(const Roughness& r) const;
  void add_alpha(Element& bsdf, const PbrtObject& m, const Roughness& r);

  void add_bsdf(const std::string& id, const Object& material, const PbrtTexture& alpha, const Location& where);
  Element& nest(Element& parent, const Location& where, const std::string& type, Attributes labels);
  void add_model(Element& parent, const PbrtObject& m, const Attributes& labels);
  void add_coat(Element& parent, const PbrtObject& m, const Attributes& labels);
  void add_conductor(Element& parent, const PbrtObject& m, const Attributes& labels, const std::string& prefix);
  void add_dielectric(Element& parent, const PbrtObject& m, const Attributes& labels);
  void add_translucent(Element& parent, const PbrtObject& m, const Attributes& labels);
  void add_hair(Element& parent, const PbrtObject& m, const Attributes& labels);
  void add_disney(Element& parent, const PbrtObject& m, const Attributes& labels);
  void add_mix(Element& parent, const PbrtObject& m, const Attributes& labels);
  void add_part(Element& mix, const PbrtObject& m);
  int leaves(const PbrtObject& m, int depth) const;  // of mixes in mixes
  bool is_opaque(const PbrtObject& m) const;
  static bool transmits(const PbrtObject& disney);
  Vec3d light_color(const Object& light);
  std::pair<Object, Object> parts(const PbrtObject& mix) const;
  double eta(const PbrtObject& m, double fallback) const;

  bool old_;
  Description& description_;
  SceneReport& report_;
  using Definitions = std::vector<std::pair<std::size_t, Object>>;
  const Object* defined(const Definitions& all, std::size_t serial) const;
  std::map<std::pair<bool, std::string>, Definitions> objects_;  // textures, by whether they are numbers, and name
  std::map<const PbrtObject*, PbrtTexture> values_;              // of textures
  int open_ = 0;                                                 // textures that are being looked into
  std::map<std::string, Definitions> named_;                     // materials
  std::size_t serial_ = 0;
  std::map<Object, Vec3d> lights_;                                          // what area lights shine
  mutable std::map<std::pair<std::string, SpectrumUse>, Vec3d> spectra_;    // of files
  std::map<std::pair<const PbrtObject*, std::string>, std::string> bsdfs_;  // by material and alpha
  struct Wanted {
    std::string id;
    Object material;
    std::string alpha_key;
    double alpha = 1.0;
    std::optional<PbrtParameter> alpha_texture;
    Location where;
  };
  std::vector<Wanted> wanted_;                         // bsdfs, in the order of the shapes
  std::map<std::string, Object> promises_;             // by name
  std::map<const PbrtObject*, std::string> promised_;  // the names of these
  bool parts_turn_ = false;                            // the opaque parts of the mix that is added have two sides each
  std::map<std::string, std::string> textures_, pictures_;  // by what they are made of: ids, names
};

}  // namespace octrad
