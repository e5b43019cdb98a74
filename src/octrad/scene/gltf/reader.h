// Turns a glTF file into elements; see gltf.h. Internal to gltf*.cc.
#pragma once

#include <array>
#include <compare>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "octrad/scene/built_files.h"
#include "octrad/scene/description.h"
#include "octrad/scene/gltf/file.h"
#include "octrad/scene/gltf/specular_glossiness.h"
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

// A primitive as a mesh: its triangles, with normals, the coordinates of `uv_set` and, where it has them, the colours
// of its vertices, within [0, 1]. nullopt for points and lines; without triangles where it has no positions or too few.
struct GltfMesh {
  RawMesh mesh;
  int color_channels = 0;     // of `colors`: 3, 4 with alpha, 0 without colours
  std::vector<float> colors;  // [vertices][channels]
  // Where normals are mapped: share of the triangles whose TANGENT leads elsewhere than the texture coordinates.
  double other_tangents = 0.0;
  // Whether the colours are the same everywhere.
  bool one_color() const;
};
std::optional<GltfMesh> gltf_mesh(const GltfFile& file, const GltfObject& primitive, int uv_set, const GltfPose& pose,
                                  bool mapped);
// Takes out the triangles whose texture is seen mirrored: v, which runs down the picture, up beside u to the right.
RawMesh take_mirrored(RawMesh& mesh);

// Whether each edge of the triangles is that of another one the other way round: then nothing of the back is seen.
bool is_closed(const RawMesh& mesh);

// What a material shows depends on what the primitive has.
struct GltfSurface {
  int material = -1;
  bool uvs = false, colors = false, mirrored = false;
  std::array<float, 4> tint{1, 1, 1, 1};  // the one colour of its vertices, with alpha
  float scale = 1;                        // of the mesh's lengths, where the material absorbs
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
  // Whether it shines from the back as from the front, and is thought of as open.
  bool emits_from_both_sides(int material) const;
  // Whether its emission is meant to light the scene, and not to be seen in it: it has no texture and half of the
  // brightness of white at least, or is brighter than what a picture shows, 1. Emissive textures of that brightness
  // paint displays and glowing parts of models, as dim materials do.
  bool is_lamp(int material) const;
  void add_emitter(Element& shape, const GltfSurface& surface);
  // The set of texture coordinates that the material's textures use.
  // `attributes`: of the mesh; sets that are one accessor are one.
  int uv_set(int material, const GltfObject& attributes) const;
  bool has_normal_map(int material) const;
  bool has_textures(int material) const;
  // Whether colours of vertices that differ can be shown, and by what they are multiplied.
  bool shows_colors(int material, bool uvs) const;
  Vec3f base_color(const GltfSurface& surface) const;
  bool absorbs(int material) const;
  // Of any bsdf so far.
  bool has_masks() const { return has_masks_; }

 private:
  // What of a picture counts.
  struct Recipe {
    enum class What { color, channel, normal, alpha, glossiness } what = What::color;
    int channel = 0;
    Vec3d factor{1, 1, 1};  // normal: of x and y
    double cutoff = -1.0;   // alpha: 1 from it on, 0 below; < 0: alpha itself
    double alpha = -1.0;    // color: times the alpha of the picture times this; < 0: without
    bool mirrored = false;  // normal
  };
  // How a texture lies on the surface.
  struct Placing {
    std::string wrap = "repeat";
    bool nearest = false, moved = false, turned = false;  // by KHR_texture_transform
    Transform to_uv;
    bool lies_like(const Placing& other) const { return wrap == other.wrap && to_uv.m == other.to_uv.m; }
  };
  // Where a picture comes from.
  struct Source {
    std::string place;  // for errors
    std::string file;   // outside of the glTF file; else empty
    std::function<std::string()> bytes;
    std::function<Image()> read;
  };
  // How much of the surface there is, by alphaMode.
  struct Coverage {
    double factor = 1.0;   // of alpha
    double cutoff = -1.0;  // as that of Recipe
    double plain = 1.0;    // where no texture says more
  };
  GltfObject material(int index) const;
  std::vector<GltfObject> texture_infos(const GltfObject& m) const;
  bool textured(const GltfObject& info, const GltfSurface& s) const { return info.exists() && s.uvs; }
  // The parameter `name` of `parent` as a picture; false where it cannot be used.
  bool add_texture(Element& parent, const std::string& name, const GltfObject& info, const Recipe& recipe);
  GltfObject texture_of(const GltfObject& info) const;
  // The index of a texture's picture; -1 where it cannot be used.
  int image_of(const GltfObject& info);
  Placing placing(const GltfObject& info);
  void add_bitmap(Element& parent, const std::string& name, const GltfObject& info, const Placing& place,
                  const std::string& file, bool raw);
  Coverage coverage(const GltfObject& m, const GltfSurface& s) const;
  void add_unlit(Element& emitter, const GltfObject& m, const GltfSurface& s);
  void add_attribute(Element& parent, const std::string& name, const GltfObject& where, double scale);
  void add_value(Element& parent, const std::string& name, const GltfObject& where, double value);
  // A scalar: a factor times one channel of a picture.
  void add_scalar(Element& parent, const std::string& name, const GltfObject& owner, const GltfSurface& s,
                  double factor, const GltfObject& info, int channel);
  void add_bsdf(const std::string& id, const GltfObject& m, const GltfSurface& s);
  void add_model(Element& parent, const GltfObject& m, const GltfSurface& s);
  void add_base_color(Element& bsdf, const GltfObject& m, const GltfSurface& s);
  void add_ior(Element& bsdf, const GltfObject& m);
  // base_color, roughness, metallic and eta by pbrMetallicRoughness; by KHR_materials_pbrSpecularGlossiness.
  void add_metallic_roughness(Element& bsdf, const GltfObject& m, const GltfSurface& s);
  bool add_anisotropy(Element& bsdf, const GltfObject& m, bool rough_picture);
  void add_specular_glossiness(Element& bsdf, const GltfObject& m, const GltfSurface& s);
  void note_shares(const GltfObject& m);
  void note_extensions(const GltfObject& m);
  Source source_of(const GltfObject& image) const;
  std::string picture(const GltfObject& image, const Recipe& recipe, bool& encoded);
  // The name of a picture of the base colour, or of the metallic share, made of images; -1: none.
  std::string metal_picture(int diffuse_image, int specular_image, GltfSpecularPictures pictures, bool metallic);

  std::shared_ptr<const GltfFile> file_;
  Description& description_;
  SceneReport& report_;
  std::map<GltfSurface, std::string> bsdfs_;
  std::map<std::string, std::string> textures_, pictures_;  // by what they are made of: ids, names
  std::set<int> noted_;
  bool has_masks_ = false;
};

}  // namespace octrad
