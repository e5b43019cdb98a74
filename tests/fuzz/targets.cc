#include "targets.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <vector>

#include "app/cli/query_points.h"
#include "octrad/base/bytes.h"
#include "octrad/base/error.h"
#include "octrad/base/json_file.h"
#include "octrad/base/memory_limit.h"
#include "octrad/geometry/voxelize.h"
#include "octrad/image/io.h"
#include "octrad/model/config.h"
#include "octrad/model/model_file.h"
#include "octrad/scene/camera.h"
#include "octrad/scene/camera_path.h"
#include "octrad/scene/load.h"
#include "octrad/scene/mesh.h"

namespace octrad::fuzz {
namespace {

// For readers that take a name.
std::string write_input(const std::string& bytes, const char* name) {
  std::ofstream(name, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  return name;
}

void read_scene(const std::string& bytes) {
  const Scene scene = load_scene(write_input(bytes, "in.xml"));
  for (const Camera& camera : scene.cameras) camera.generate({0.5f, 0.5f}, 1, 1);
  occupied_cells(scene, scene_domain(scene.bounds, true), 2);
}

void read_gltf_scene(const std::string& bytes) {
  LoadOptions options;
  options.permissive = true;  // goes on after a mistake: more of the file is read
  const Scene scene = load_scene(write_input(bytes, bytes.starts_with("glTF") ? "in.glb" : "in.gltf"), options);
  occupied_cells(scene, scene_domain(scene.bounds, true), 2);
}

void read_mesh(RawMesh mesh) { place_mesh(std::move(mesh), Transform(), {}); }

void read_picture(const std::string& bytes) { parse_image("in", bytes); }

void read_model(const std::string& bytes) {
  const Model model = load_model(write_input(bytes, "in.octrad"), true);
  SurfacePoint point;
  point.n = point.wo = {0, 0, 1};
  point.albedo = Vec3f(0.5f);
  Vec3f radiance;
  model.field->radiance(std::span(&point, 1), std::span(&radiance, 1));
}

void read_config(const std::string& bytes) {
  Config config;
  apply(config, parse_json(bytes, "in.json"), "in.json");
  to_json(config).dump();
}

void read_camera(const std::string& bytes) {
  for (const Camera& camera : read_cameras(write_input(bytes, "in.json"))) camera.generate({0.5f, 0.5f}, 3, 2);
}

void read_path(const std::string& bytes) {
  const CameraPath path(write_input(bytes, "in.json"));
  for (int frame = 0; frame < std::min(path.frames(), 10); ++frame) path.camera(frame);
}

void read_points(const std::string& bytes) {
  cli::parse_points("in.csv", bytes, {});
  QueryRays rays;
  rays.lobe = rays.clusters = 2;
  cli::parse_points("in.csv", bytes, rays);
}

template <void (*read)(const std::string&)>
void guarded(const std::string& bytes) {
  try {
    read(bytes);
  } catch (const Error&) {
  }
}

constexpr Target kTargets[] = {
    {"scene", guarded<read_scene>},
    {"ply", guarded<[](const std::string& bytes) {
       read_mesh(parse_ply("in.ply", bytes, {"vertex_color", "face_color", "vertex_w", "face_w"}));
     }>},
    {"obj", guarded<[](const std::string& bytes) { read_mesh(parse_obj("in.obj", bytes)); }>},
    {"serialized", guarded<[](const std::string& bytes) {
       for (const int index : {0, 1}) read_mesh(parse_serialized("in.serialized", bytes, index));
     }>},
    {"png", guarded<read_picture>},
    {"jpeg", guarded<read_picture>},
    {"exr", guarded<read_picture>},
    {"hdr", guarded<read_picture>},
    {"pfm", guarded<read_picture>},
    {"bmp", guarded<read_picture>},
    {"tga", guarded<[](const std::string& bytes) { parse_image("in.tga", bytes); }>},
    {"gltf", guarded<read_gltf_scene>},
    {"old_scene", guarded<[](const std::string& bytes) { check_scene_file(write_input(bytes, "in.xml")); }>},
    {"model", guarded<read_model>},
    {"config", guarded<read_config>},
    {"camera", guarded<read_camera>},
    {"path", guarded<read_path>},
    {"points", guarded<read_points>},
};

}  // namespace

std::span<const Target> targets() { return kTargets; }

const Target& find_target(const std::string& name) {
  std::string names;
  for (const Target& target : kTargets) {
    if (name == target.name) return target;
    names += std::string(" ") + target.name;
  }
  throw std::runtime_error("no target \"" + name + "\"; there are" + names);
}

void prepare() {
  namespace fs = std::filesystem;
  static std::string folder = (fs::temp_directory_path() / "octrad_fuzz_XXXXXX").string();
  if (mkdtemp(folder.data()) == nullptr) throw std::runtime_error("no temporary folder");
  fs::current_path(folder);
  std::atexit([] {
    std::error_code ignored;
    fs::remove_all(folder, ignored);
  });
  std::ofstream("t.obj") << "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  Image8 picture(2, 2, 3);
  picture.data[0] = 200;
  write_image("t.png", picture);
  set_memory_limit(resident_bytes() + (std::uint64_t{400} << 20));
}

}  // namespace octrad::fuzz
