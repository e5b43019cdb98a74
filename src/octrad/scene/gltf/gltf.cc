#include "octrad/scene/gltf/gltf.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <numbers>
#include <set>
#include <span>

#include "octrad/base/lower_case.h"
#include "octrad/base/memory_limit.h"
#include "octrad/base/number_text.h"
#include "octrad/scene/gltf/reader.h"
#include "octrad/scene/limits.h"

namespace octrad {
namespace {

constexpr double kDegrees = 180.0 / std::numbers::pi;
constexpr std::size_t kMaxPlaced = 4'000'000;
constexpr std::uint64_t kPlacedBytes = 3000;  // of the elements of one, about

// Extensions that are read. Others are refused where the file requires them, else noted.
const std::set<std::string> kExtensions = {"EXT_mesh_gpu_instancing",
                                           "EXT_meshopt_compression",
                                           "EXT_texture_webp",
                                           "KHR_lights_punctual",
                                           "KHR_materials_pbrSpecularGlossiness",
                                           "KHR_materials_anisotropy",
                                           "KHR_materials_clearcoat",
                                           "KHR_materials_diffuse_transmission",
                                           "KHR_materials_emissive_strength",
                                           "KHR_materials_ior",
                                           "KHR_materials_sheen",
                                           "KHR_materials_specular",
                                           "KHR_materials_transmission",
                                           "KHR_materials_unlit",
                                           "KHR_materials_volume",
                                           "KHR_mesh_quantization",
                                           "KHR_node_visibility",
                                           "KHR_texture_transform"};

std::string extension_advice(const std::string& extension) {
  static const std::pair<const char*, const char*> ways[] = {
      {"KHR_draco_mesh_compression", "; decompress it, as by \"gltf-transform copy\""},
      {"KHR_meshopt_compression", "; decompress it, as by \"gltf-transform copy\""},
      {"KHR_texture_basisu", "; save the pictures as PNG or JPEG"},
      {"EXT_texture_avif", "; save the pictures as PNG or JPEG"},
      {"MSFT_texture_dds", "; save the pictures as PNG or JPEG"},
  };
  for (const auto& [name, way] : ways) {
    if (extension == name) return way;
  }
  return "";
}

Transform rotation(const std::vector<double>& q) {
  const double x = q[0], y = q[1], z = q[2], w = q[3];
  Transform t;
  t.m = {1 - 2 * (y * y + z * z),
         2 * (x * y - z * w),
         2 * (x * z + y * w),
         0,
         2 * (x * y + z * w),
         1 - 2 * (x * x + z * z),
         2 * (y * z - x * w),
         0,
         2 * (x * z - y * w),
         2 * (y * z + x * w),
         1 - 2 * (x * x + y * y),
         0,
         0,
         0,
         0,
         1};
  return t;
}

// What a scale of 0 along one axis makes flat is seen (shadows that are drawn, writing): it stays a millionth thick.
// Only where all three are 0 does a node show nothing.
Vec3d not_flat(Vec3d scale) {
  const double largest = std::max({std::fabs(scale.x), std::fabs(scale.y), std::fabs(scale.z)});
  for (int i = 0; i < 3; ++i) {
    if (scale[i] == 0.0) scale[i] = 1e-6 * largest;
  }
  return scale;
}

Transform of_parts(Vec3d translation, std::vector<double> quaternion, Vec3d scale, const GltfObject& user) {
  double l = 0.0;
  for (const double v : quaternion) l += v * v;
  if (!(l > 0.0) || !std::isfinite(l)) user.fail("the rotation must be a quaternion of length 1");
  for (double& v : quaternion) v /= std::sqrt(l);
  return Transform::translate(translation) * rotation(quaternion) * Transform::scale(not_flat(scale));
}

Vec3d vec(const std::vector<double>& v) { return {v[0], v[1], v[2]}; }

// Cameras and lights of glTF look along -z with x to the right; those of Mitsuba along +z with x to the left.
std::optional<Transform> view_of(const Transform& node) {
  return Transform::look_at(node.column(3), node.column(3) - node.column(2), node.column(1));
}

class GltfReader {
 public:
  GltfReader(const std::string& file, std::string bytes, Description& description, SceneReport& report)
      : file_(std::make_shared<const GltfFile>(file, std::move(bytes), description)),
        description_(description),
        report_(report),
        materials_(file_, description, report),
        meter_(file + ": the tree of the scene") {}

  void read() {
    check_extensions();
    const Location here = file_->root().location();
    if (file_->count("animations") > 0)
      report_.assume(here, "animations are left out: everything stands as it is without them");
    place_nodes();
    for (auto& [index, places] : placed_) add_placed(file_->item("meshes", index), places);
    for (const auto& [index, to_world] : posed_) add_posed(file_->item("nodes", index), to_world);
    if (materials_.has_masks()) {
      for (Element* light : lights_)
        add_element(*light, light->location, "boolean", {{"name", "through_masks"}, {"value", "true"}});
    }
    if (!has_light_ && lamp_ >= 0) {
      report_.assume(
          file_->item("materials", lamp_).location(),
          "no light from all sides is added, because a lamp lights the scene: an emissive material without a texture "
          "that is no dimmer than 0.5, or one brighter than 1. To have one, convert the file to XML and add "
          "<emitter type=\"constant\"/>");
    } else if (!has_light_) {
      report_.assume(here,
                     "the file has no light: one that is the same from all sides is added. Punctual lights and lamps "
                     "keep it away: emissive materials without a texture that are no dimmer than 0.5, or brighter "
                     "than 1");
      Element& light = add_element(root(), here, "emitter", {{"type", "constant"}});
      add_element(light, here, "float", {{"name", "radiance"}, {"value", "1"}});
    }
  }

 private:
  Element& root() { return *description_.root; }

  void check_extensions() {
    const GltfObject file = file_->root();
    const std::vector<std::string> listed = file.texts("extensionsRequired");
    const std::set<std::string> required(listed.begin(), listed.end());
    for (const std::string& name : listed) {
      if (kExtensions.count(name) == 0)
        report_.refuse(file.location(),
                       "the file requires the extension " + name + ", which is not supported" + extension_advice(name));
    }
    for (const std::string& name : file.texts("extensionsUsed")) {
      if (kExtensions.count(name) == 0 && !name.starts_with("KHR_materials_") && required.count(name) == 0)
        report_.assume(file.location(), "the extension " + name + " is left out");
    }
  }

  Transform local(const GltfObject& node) const {
    if (node.has("matrix")) {
      const std::vector<double> m = node.numbers("matrix", std::vector<double>(16, 0.0));
      Transform t;
      for (int row = 0; row < 4; ++row) {
        for (int column = 0; column < 4; ++column) t(row, column) = m[static_cast<std::size_t>(4 * column + row)];
      }
      // Products of matrices in float are off by a few roundings.
      constexpr double kRounding = 1e-5;
      const double w = t(3, 3);
      if (std::fabs(w - 1.0) < kRounding) {
        for (int row = 0; row < 3; ++row) {
          if (std::fabs(t(3, row)) < kRounding) t(3, row) = 0.0;
          for (int column = 0; column < 4; ++column) t(row, column) /= w;
        }
        t(3, 3) = 1.0;
      }
      if (!t.is_affine()) node.fail("the last row of the matrix must be 0 0 0 1");
      return t;
    }
    return of_parts(vec(node.numbers("translation", {0, 0, 0})), node.numbers("rotation", {0, 0, 0, 1}, -2.0, 2.0),
                    vec(node.numbers("scale", {1, 1, 1})), node);
  }

  // Walks the tree of the scene without calling itself: it may be as deep as the file has nodes.
  void place_nodes() {
    const int scene = file_->root().index("scene", "scenes");
    struct Open {
      int node;
      Transform parent;
      bool hidden;  // by KHR_node_visibility of a node above
    };
    std::vector<Open> open;
    const auto push = [&](const std::vector<std::uint64_t>& nodes, const GltfObject& owner, const Transform& parent,
                          bool hidden = false) {
      for (auto at = nodes.rbegin(); at != nodes.rend(); ++at) {
        if (*at >= file_->count("nodes")) owner.fail("node " + std::to_string(*at) + " does not exist");
        open.push_back({static_cast<int>(*at), parent, hidden});
      }
    };
    if (file_->count("scenes") > 0) {
      const GltfObject chosen = file_->item("scenes", std::max(scene, 0));
      if (file_->count("scenes") > 1)
        report_.assume(chosen.location(), "of " + std::to_string(file_->count("scenes")) + " scenes this one is read");
      push(chosen.sizes("nodes"), chosen, Transform());
    } else {
      // Without scenes: everything that is no child.
      std::set<std::uint64_t> children;
      for (std::size_t i = 0; i < file_->count("nodes"); ++i) {
        for (const std::uint64_t child : file_->item("nodes", static_cast<int>(i)).sizes("children"))
          children.insert(child);
      }
      std::vector<std::uint64_t> roots;
      for (std::uint64_t i = 0; i < file_->count("nodes"); ++i) {
        if (children.count(i) == 0) roots.push_back(i);
      }
      push(roots, file_->root(), Transform());
    }
    std::set<int> seen;
    while (!open.empty()) {
      const auto [index, parent, above] = open.back();
      open.pop_back();
      const GltfObject node = file_->item("nodes", index);
      if (!seen.insert(index).second) node.fail("the node stands in the tree twice, or contains itself");
      const Transform to_world = parent * local(node);
      if (!to_world.is_affine()) node.fail("the transform of the node is not finite");
      world_.emplace(index, to_world);
      const GltfObject visibility = node.extension("KHR_node_visibility");
      const bool hidden = above || (visibility.exists() && visibility.has("visible") && !visibility.flag("visible"));
      add_node(index, node, to_world, hidden);
      push(node.sizes("children"), node, to_world, hidden);
    }
  }

  // Of a hidden node its camera alone.
  void add_node(int index, const GltfObject& node, const Transform& to_world, bool hidden) {
    if (const int mesh = node.index("mesh", "meshes"); mesh >= 0 && !hidden) {
      const GltfObject instancing = node.extension("EXT_mesh_gpu_instancing");
      if (node.has("skin") || node.has("weights")) posed_.emplace_back(index, to_world);
      else if (instancing.exists()) add_instances(mesh, instancing.object("attributes"), to_world);
      else place(mesh, to_world, node);
    }
    if (const int camera = node.index("camera", "cameras"); camera >= 0)
      add_camera(file_->item("cameras", camera), node, to_world);
    const GltfObject light = node.extension("KHR_lights_punctual");
    if (light.exists() && !hidden) add_light(light, to_world);
  }

  // A mesh in a pose of its own. A skin stands where its joints are, wherever the node is.
  void add_posed(const GltfObject& node, const Transform& to_world) {
    const GltfObject mesh = file_->item("meshes", node.index("mesh", "meshes"));
    report_.attempt(node.location(), [&] {
      GltfPose pose{node.has("weights") ? node : mesh};
      const int skin_index = node.index("skin", "skins");
      if (skin_index < 0) return add_mesh(mesh, {&to_world, 1}, pose);
      const auto [skin, inserted] = skins_.try_emplace(skin_index);
      if (inserted) skin->second = read_skin(file_->item("skins", skin_index));  // where it fails it stays empty
      if (skin->second.joints.empty()) file_->item("skins", skin_index).fail("has no joints that can be used");
      pose.skin = &skin->second;
      const Transform in_place;
      add_mesh(mesh, {&in_place, 1}, pose);
    });
  }

  GltfSkin read_skin(const GltfObject& skin) {
    GltfSkin result;
    const int accessor = skin.index("inverseBindMatrices", "accessors");
    const GltfValues bound = accessor >= 0 ? file_->values(accessor, {16}) : GltfValues();
    for (const std::uint64_t joint : skin.sizes("joints")) {
      const std::size_t k = result.joints.size();
      Transform inverse;
      for (std::size_t i = 0; i < 16 && k < bound.count; ++i)
        inverse.m[4 * (i % 4) + i / 4] = static_cast<double>(bound.values[16 * k + i]);
      const auto found = world_.find(static_cast<int>(std::min<std::uint64_t>(joint, file_->count("nodes"))));
      if (found == world_.end() || (accessor >= 0 && k >= bound.count) || !inverse.is_affine())
        skin.fail("joint " + std::to_string(k) + " is not in the scene, or has no inverse bind matrix");
      meter_.add(2 * (sizeof(Transform) + sizeof(GltfNormalMatrix)));
      result.joints.push_back(found->second * inverse);
      result.normals.push_back(result.joints.back().normal_matrix());
    }
    return result;
  }

  void place(int mesh, const Transform& to_world, const GltfObject& node) {
    if (to_world.is_singular(1e-18)) {
      report_.assume(node.location(), "a node that is scaled to nothing shows nothing");
      return;
    }
    if (++placed_count_ > kMaxPlaced) node.fail("the scene has more than 4 million placed meshes");
    meter_.add(kPlacedBytes);
    placed_[mesh].push_back(to_world);
  }

  void add_instances(int mesh, const GltfObject& attributes, const Transform& to_world) {
    const auto read = [&](const char* name, int components) {
      const int accessor = attributes.index(name, "accessors");
      return accessor >= 0 ? file_->values(accessor, {components}) : GltfValues();
    };
    const GltfValues translation = read("TRANSLATION", 3), turn = read("ROTATION", 4), scale = read("SCALE", 3);
    const std::size_t count = std::max({translation.count, turn.count, scale.count});
    for (const GltfValues* v : {&translation, &turn, &scale}) {
      if (v->count != 0 && v->count != count) attributes.fail("has accessors of different counts");
    }
    const auto value = [](const GltfValues& v, std::size_t i, std::vector<double> fallback) {
      for (std::size_t k = 0; i < v.count && k < fallback.size(); ++k)
        fallback[k] = static_cast<double>(v.values[i * fallback.size() + k]);
      return fallback;
    };
    for (std::size_t i = 0; i < count; ++i) {
      const Transform own = of_parts(vec(value(translation, i, {0, 0, 0})), value(turn, i, {0, 0, 0, 1}),
                                     vec(value(scale, i, {1, 1, 1})), attributes);
      place(mesh, to_world * own, attributes);
    }
  }

  // A mesh in all its places. Those that mirror it need other normal maps, and are taken apart.
  void add_placed(const GltfObject& mesh, std::vector<Transform>& places) {
    const std::vector<GltfObject> primitives = mesh.objects("primitives");
    const bool mapped = std::any_of(primitives.begin(), primitives.end(), [this](const GltfObject& primitive) {
      return materials_.has_normal_map(primitive.index("material", "materials"));
    });
    const auto mirrored = mapped ? std::stable_partition(places.begin(), places.end(),
                                                         [](const Transform& t) { return t.determinant() >= 0.0; })
                                 : places.end();
    const std::span<const Transform> kept(places.begin(), mirrored), turned(mirrored, places.end());
    for (const auto& some : {kept, turned}) {
      if (!some.empty()) add_mesh(mesh, some, {mesh});
    }
  }

  // The primitives of a mesh in all its places: as shapes, or, where there are several places, in a group of which
  // there are instances. Lights cannot be in groups.
  void add_mesh(const GltfObject& mesh, std::span<const Transform> places, const GltfPose& pose) {
    Element* group = nullptr;
    const std::string id = mesh.path() + (places.front().determinant() < 0.0 ? "-mirrored" : "");
    for (const GltfObject& primitive : mesh.objects("primitives")) {
      report_.attempt(primitive.location(), [&] {
        for (const auto& [name, surface, back] : build(primitive, pose, places.front())) {
          const bool emits = materials_.emits(surface.material);
          if (places.size() == 1 || emits) {
            for (const Transform& to_world : places) {
              Element& shape = add_shape(root(), primitive, name, surface);
              add_matrix(shape, primitive.location(), "to_world", to_world);
              // What mirrors turns the front with it. Normals of the file do so by themselves.
              const bool turned = to_world.determinant() < 0.0 && description_.built_mesh(name)->normals.empty();
              if (turned != back)
                add_element(shape, primitive.location(), "boolean", {{"name", "flip_normals"}, {"value", "true"}});
            }
            continue;
          }
          if (!group) {
            group = &add_element(root(), mesh.location(), "shape", {{"type", "shapegroup"}, {"id", id}});
            description_.ids.emplace(id, group);
          }
          add_shape(*group, primitive, name, surface);
        }
      });
    }
    if (!group) return;
    for (const Transform& to_world : places) {
      Element& instance = add_element(root(), mesh.location(), "shape", {{"type", "instance"}});
      add_element(instance, mesh.location(), "ref", {{"id", id}});
      add_matrix(instance, mesh.location(), "to_world", to_world);
    }
  }

  struct BuiltMesh {
    std::string name;
    GltfSurface surface;
    bool back = false;  // its front is where the triangles' back is
  };
  // The meshes of a primitive: one, or two where the normal map is seen mirrored on some triangles. Lights have one
  // side: of those that shine from both there are two, a little apart.
  std::vector<BuiltMesh> build(const GltfObject& primitive, const GltfPose& pose, const Transform& first_place) {
    const int positions = primitive.object("attributes").index("POSITION", "accessors");
    if (primitive.extension("KHR_draco_mesh_compression").exists() && positions >= 0 &&
        !file_->item("accessors", positions).has("bufferView"))  // else the mesh is there without compression too
      primitive.fail("KHR_draco_mesh_compression is not supported" + extension_advice("KHR_draco_mesh_compression"));
    GltfSurface surface;
    surface.material = primitive.index("material", "materials");
    const GltfObject attributes = primitive.object("attributes");
    const int uv_set = materials_.uv_set(surface.material, attributes);
    surface.uvs = attributes.has("TEXCOORD_" + std::to_string(uv_set));
    if (!surface.uvs && materials_.has_textures(surface.material))
      report_.assume(primitive.location(), "textures are left out on a mesh without their texture coordinates");
    if (attributes.has("JOINTS_1"))
      report_.assume(primitive.location(), "JOINTS_1 is left out: four joints at most move a vertex");
    const bool mapped = surface.uvs && materials_.has_normal_map(surface.material);
    std::optional<GltfMesh> read = gltf_mesh(*file_, primitive, uv_set, pose, mapped);
    if (read && read->other_tangents > 0.1) {
      report_.assume(primitive.location(),
                     "TANGENT is left out: a normal map follows the texture coordinates; the "
                     "tangents differ on " +
                         number_text(std::round(100.0 * read->other_tangents)) + " % of the triangles");
    }
    std::vector<BuiltMesh> result;
    if (!read) {
      report_.assume(primitive.location(), "points and lines are left out");
      return result;
    }
    if (read->mesh.triangles.empty()) {
      report_.assume(primitive.location(), "primitives without positions or without a whole triangle are left out");
      return result;
    }
    if (materials_.absorbs(surface.material)) {
      const double scale = std::cbrt(std::fabs(first_place.determinant()));
      if (std::isfinite(scale)) surface.scale = static_cast<float>(std::min(scale, 1e30));
    }
    RawMesh& mesh = read->mesh;
    add_colors(*read, surface, primitive);
    const bool both = materials_.emits_from_both_sides(surface.material) && !is_closed(mesh);
    const auto keep = [&](RawMesh&& m, bool back) {
      const std::string name = "mesh" + std::to_string(description_.built->meshes.size());
      description_.built->meshes.emplace(name, std::move(m));
      result.push_back({name, surface, back});
    };
    const auto keep_sides = [&](RawMesh&& m) {
      if (m.triangles.empty()) return;
      if (!both) return keep(std::move(m), false);
      const double front = front_share(m);
      ask_memory(m.bytes(), primitive.location().text());
      keep(moved_along_normals(m, -front), true);
      keep(moved_along_normals(std::move(m), front), false);
    };
    if (!mapped) {
      keep_sides(std::move(mesh));
      return result;
    }
    RawMesh mirrored = take_mirrored(mesh);
    surface.mirrored = first_place.determinant() < 0.0;
    keep_sides(std::move(mesh));
    surface.mirrored = !surface.mirrored;
    keep_sides(std::move(mirrored));
    return result;
  }

  // One colour of all vertices is a factor of the material. Others become a picture with texture coordinates of its own
  // (load_attributes.cc), of which a mesh has one set.
  void add_colors(GltfMesh& read, GltfSurface& surface, const GltfObject& primitive) {
    const auto channels = static_cast<std::size_t>(read.color_channels);
    if (read.one_color()) {
      auto tint = surface.tint;
      std::copy_n(read.colors.begin(), channels, tint.begin());
      // Each makes a picture of its own of a texture.
      constexpr std::size_t kMostTints = 16;
      auto& tints = tints_[surface.material];
      if (materials_.has_textures(surface.material) && tints.size() >= kMostTints && !tints.count(tint)) {
        report_.assume(primitive.location(),
                       "colours of vertices beyond the 16th for one material with textures are left out. Bake them "
                       "into the texture of the base colour");
        return;
      }
      tints.insert(tint);
      surface.tint = tint;
      return;
    }
    if (read.colors.empty()) return;
    surface.colors = materials_.shows_colors(surface.material, surface.uvs);
    if (!surface.colors) {
      report_.assume(
          primitive.location(),
          "colours of vertices that differ are left out beside textures, and specular colours above 0.04: a mesh has "
          "one set of texture coordinates. Bake them into the texture of the base colour");
      return;
    }
    const Vec3f factor = materials_.base_color(surface);
    MeshAttribute attribute{"vertex_color", 3, {}};
    attribute.values.reserve(read.mesh.positions.size() * 3);
    for (std::size_t i = 0; i < read.mesh.positions.size(); ++i) {
      for (std::size_t c = 0; c < 3; ++c)
        attribute.values.push_back(read.colors[channels * i + c] * factor[static_cast<int>(c)]);
    }
    read.mesh.attributes.push_back(std::move(attribute));
  }

  Element& add_shape(Element& parent, const GltfObject& primitive, const std::string& mesh,
                     const GltfSurface& surface) {
    meter_.add(kPlacedBytes);
    const Location where = primitive.location();
    const std::string bsdf = materials_.bsdf(surface);
    Element& shape = add_element(parent, where, "shape", {{"type", "ply"}});
    add_element(shape, where, "string", {{"name", "filename"}, {"value", mesh}});
    if (description_.built->meshes.at(mesh).normals.empty())
      add_element(shape, where, "boolean", {{"name", "face_normals"}, {"value", "true"}});
    add_element(shape, where, "ref", {{"id", bsdf}});
    if (materials_.emits(surface.material)) {
      materials_.add_emitter(shape, surface);
      if (materials_.is_lamp(surface.material)) lamp_ = surface.material;
    }
    return shape;
  }

  void add_camera(const GltfObject& camera, const GltfObject& node, const Transform& to_world) {
    const std::string type = camera.text("type", "");
    const std::optional<Transform> view = view_of(to_world);
    if (!view) node.fail("the camera looks nowhere: its node is scaled to nothing");
    if (type != "perspective" && type != "orthographic")
      camera.fail("the type must be perspective or orthographic, not \"" + type + "\"");
    const GltfObject p = camera.object(type);
    const double near_clip = p.number("znear", 0.01, 0.0, 1e12), far_clip = p.number("zfar", 1e9, 0.0, 1e12);
    MadeSensor sensor{type};
    sensor.near_clip = std::max(near_clip, 1e-6);
    sensor.far_clip = std::max(far_clip, 2e-6);
    sensor.aspect = p.number("aspectRatio", 16.0 / 9.0, 1e-3, 1e3);
    Transform t = *view;
    if (type == "perspective") {
      sensor.fov_degrees = p.number("yfov", 0.0, 1e-6, 3.1415) * kDegrees;
      if (!p.has("yfov")) p.fail("needs yfov");
    } else {
      const double x = p.number("xmag", 1.0, 1e-9, 1e9), y = p.number("ymag", 1.0, 1e-9, 1e9);
      sensor.aspect = std::clamp(x / y, 1e-3, 1e3);
      t = t * Transform::scale({x, x, 1.0});
    }
    meter_.add(kPlacedBytes);
    make_sensor(root(), camera.location(), t, sensor);
  }

  void add_light(const GltfObject& reference, const Transform& to_world) {
    const std::uint64_t index = reference.size("light", 0);
    const GltfObject light = file_->root().extension("KHR_lights_punctual").object_at("lights", index);
    if (!light.exists()) reference.fail("light " + std::to_string(index) + " does not exist");
    meter_.add(kPlacedBytes);
    const std::string type = light.text("type", "");
    const Location where = light.location();
    if (type != "point" && type != "spot" && type != "directional")
      light.fail("the type must be point, spot or directional, not \"" + type + "\"");
    const std::optional<Transform> view = view_of(to_world);
    if (!view && type != "point") {
      report_.assume(reference.location(), "a light whose node is scaled to nothing shines nowhere");
      return;
    }
    const Vec3d color = vec(light.numbers("color", {1, 1, 1}, 0.0, 1e12));
    const Vec3d intensity = color * light.number("intensity", 1.0, 0.0, 1e15);
    has_light_ = true;
    Element& emitter = add_element(root(), where, "emitter", {{"type", type}});
    lights_.push_back(&emitter);
    add_element(emitter, where, "rgb",
                {{"name", type == "directional" ? "irradiance" : "intensity"}, {"value", three_numbers(intensity)}});
    if (light.has("range")) report_.assume(where, "the range of lights is left out: they shine as far as light does");
    add_matrix(emitter, where, "to_world", type == "point" ? Transform::translate(to_world.column(3)) : *view);
    if (type != "spot") return;
    const GltfObject spot = light.object("spot");
    const double outer = spot.number("outerConeAngle", std::numbers::pi / 4.0, 1e-4, 1.5708),
                 inner = spot.number("innerConeAngle", 0.0, 0.0, outer);
    add_element(emitter, where, "float", {{"name", "cutoff_angle"}, {"value", number_text(outer * kDegrees)}});
    add_element(emitter, where, "float",
                {{"name", "beam_width"}, {"value", number_text(std::min(inner, 0.999 * outer) * kDegrees)}});
    report_.assume(where, "the light of a spot falls linearly with the angle between its cones, as in Mitsuba");
  }

  std::shared_ptr<const GltfFile> file_;
  Description& description_;
  SceneReport& report_;
  GltfMaterials materials_;
  std::map<int, std::set<std::array<float, 4>>> tints_;  // of each material
  std::map<int, std::vector<Transform>> placed_;         // where each mesh stands
  std::map<int, Transform> world_;                       // of every node
  std::vector<std::pair<int, Transform>> posed_;         // nodes whose mesh has a skin or weights of its own
  std::map<int, GltfSkin> skins_;                        // that were used
  std::size_t placed_count_ = 0;
  MemoryMeter meter_;
  bool has_light_ = false;        // punctual
  int lamp_ = -1;                 // a material
  std::vector<Element*> lights_;  // punctual
};

}  // namespace

bool is_gltf(const std::string& file, const std::string& bytes) {
  const std::string ending = ending_of(file);
  const std::size_t first = bytes.find_first_not_of(" \t\r\n");
  return ending == ".gltf" || ending == ".glb" || bytes.starts_with("glTF") ||
         (first != std::string::npos && bytes[first] == '{');
}

void read_gltf(const std::string& file, std::string bytes, Description& description, SceneReport& report) {
  description.root = std::make_unique<Element>();
  description.root->tag = "scene";
  description.root->location = {std::make_shared<const SourceFile>(file, ""), 0};
  description.built = std::make_shared<BuiltFiles>();
  GltfReader(file, std::move(bytes), description, report).read();
}

}  // namespace octrad
