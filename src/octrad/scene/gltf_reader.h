// Turns a glTF file into elements; see gltf.h. Internal to gltf*.cc.
#pragma once

#include <array>
#include <compare>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "octrad/scene/built_files.h"
#include "octrad/scene/description.h"
#include "octrad/scene/gltf_file.h"
#include "octrad/scene/make_element.h"
#include "octrad/scene/transform.h"

namespace octrad {

// For each joint what takes vertices, and normals, as they were bound to where the joint has them.
using GltfNormalMatrix = std::array<double, 9>;
struct GltfSkin {
  std::vector<Transform> joints;
  std::vector<GltfNormalMatrix> normals;
};

// How a mesh stands: the object that may have `weights` of its morph targets, and its skin; null: none.
struct GltfPose {
  GltfObject weights;
  const GltfSkin* skin = nullptr;
};

// A primitive as a mesh: its triangles, with normals, the coordinates of `uv_set` and, as "vertex_color", the colours
// of its vertices times `color`, where it has them. nullopt for points and lines.
std::optional<RawMesh> gltf_mesh(const GltfFile& file, const GltfObject& primitive, int uv_set, const Vec3f* color,
                                 const GltfPose& pose);
// Takes out the triangles whose texture is seen mirrored: v, which runs down the picture, up beside u to the right.
RawMesh take_mirrored(RawMesh& mesh);

// What a material shows depends on what the primitive has.
struct GltfSurface {
  int material = -1;
  bool uvs = false, colors = false, mirrored = false;
  auto operator<=>(const GltfSurface&) const = default;
};

class GltfMaterials {
 public:
  // Adds to the root of `description`.
  GltfMaterials(std::shared_ptr<const GltfFile> file, Description& description, SceneReport& report)
      : file_(std::move(file)),
        description_(description),
        report_(report) {}
  // The id of a bsdf.
  std::string bsdf(const GltfSurface& surface);
  bool emits(int material) const;
  // Whether its emission is meant to light the scene, and not to be seen in it: it has no texture, or is brighter than
  // what a picture shows, 1. Emissive textures of that brightness paint displays and glowing parts of models.
  bool is_lamp(int material) const;
  void add_emitter(Element& shape, const GltfSurface& surface);
  // The set of texture coordinates that the material's textures use.
  int uv_set(int material) const;
  bool has_normal_map(int material) const;
  bool has_textures(int material) const;
  // Whether colours of vertices can be shown, and by what they are multiplied.
  bool shows_colors(int material, bool uvs) const;
  Vec3f base_color(int material) const;
  // Of any bsdf so far.
  bool has_masks() const { return has_masks_; }

 private:
  // What of a picture counts.
  struct Recipe {
    enum class What { color, channel, normal, alpha } what = What::color;
    int channel = 0;
    Vec3d factor{1, 1, 1};  // normal: of x and y
    double cutoff = -1.0;   // alpha: 1 from it on, 0 below; < 0: alpha itself
    bool mirrored = false;  // normal
  };
  GltfObject material(int index) const;
  std::vector<GltfObject> texture_infos(const GltfObject& m) const;
  bool textured(const GltfObject& info, const GltfSurface& s) const { return info.exists() && s.uvs; }
  // The parameter `name` of `parent` as a picture; false where it cannot be used.
  bool add_texture(Element& parent, const std::string& name, const GltfObject& info, const Recipe& recipe);
  void add_value(Element& parent, const std::string& name, const GltfObject& where, double value);
  // A scalar: a factor times one channel of a picture.
  void add_scalar(Element& parent, const std::string& name, const GltfObject& owner, const GltfSurface& s,
                  double factor, const GltfObject& info, int channel);
  void add_bsdf(const std::string& id, const GltfObject& m, const GltfSurface& s);
  void add_model(Element& parent, const GltfObject& m, const GltfSurface& s);
  void add_ior(Element& bsdf, const GltfObject& m);
  void note_extensions(const GltfObject& m);
  std::string picture(const GltfObject& image, const Recipe& recipe, bool& encoded);

  std::shared_ptr<const GltfFile> file_;
  Description& description_;
  SceneReport& report_;
  std::map<GltfSurface, std::string> bsdfs_;
  std::map<std::string, std::string> textures_, pictures_;  // by what they are made of: ids, names
  std::set<int> noted_;
  bool has_masks_ = false;
};

}  // namespace octrad
