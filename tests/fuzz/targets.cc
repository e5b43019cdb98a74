#include "targets.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <vector>

#include "app/cli/query_points.h"
#include "app/paper/matrix.h"
#include "app/view/protocol.h"
#include "octrad/base/bytes.h"
#include "octrad/base/error.h"
#include "octrad/base/json_file.h"
#include "octrad/base/memory_limit.h"
#include "octrad/geometry/voxelize.h"
#include "octrad/image/io.h"
#include "octrad/model/config.h"
#include "octrad/model/model_file.h"
#include "octrad/render/film_state.h"
#include "octrad/scene/camera.h"
#include "octrad/scene/camera_path.h"
#include "octrad/scene/curves.h"
#include "octrad/scene/load.h"
#include "octrad/scene/measured.h"
#include "octrad/scene/mesh.h"
#include "octrad/scene/sample_measured.h"
#include "octrad/scene/spectrum.h"
#include "octrad/shading/measured_summary.h"
#include "octrad/transport/path.h"
#include "octrad/transport/prepared_scene.h"

namespace octrad::fuzz {
namespace {

// For readers that take a name.
std::string write_input(const std::string& bytes, const char* name) {
  std::ofstream(name, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  return name;
}

// What is made of a scene: cells, trees, tables of materials and lights, and a few paths from each sensor.
void use_scene(Scene scene) {
  occupied_cells(scene, scene_domain(scene.bounds, true), 2);
  constexpr std::size_t kMost = 1000;  // a larger one takes too long
  if (scene.triangle_count() > kMost || scene.shapes.size() > kMost || scene.cameras.size() > 10) return;
  const PreparedScene prepared(std::move(scene));
  std::vector<PathSample> paths;
  for (const Camera& camera : prepared.scene().cameras) {
    for (std::uint64_t i = 0; i < 8; ++i) {
      const float at = (static_cast<float>(i) + 0.5f) / 8.0f;
      paths.push_back({camera_ray(camera.view(2, 3), {2.0f * at, 3.0f * at}), Rng(1, RngPurpose::test, i), {}, {}});
    }
  }
  PathCounters counters;
  trace_paths(prepared.context(), {6, 5}, paths, counters);
}

void read_scene(const std::string& bytes) { use_scene(load_scene(write_input(bytes, "in.xml"))); }

void read_gltf_scene(const std::string& bytes) {
  LoadOptions options;
  options.permissive = true;  // goes on after a mistake: more of the file is read
  use_scene(load_scene(write_input(bytes, bytes.starts_with("glTF") ? "in.glb" : "in.gltf"), options));
}

void read_pbrt_scene(const std::string& bytes) {
  LoadOptions options;
  options.permissive = true;
  use_scene(load_scene(write_input(bytes, "in.pbrt"), options));
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
  for (const Camera& camera : read_cameras(write_input(bytes, "in.json"))) camera_ray(camera.view(3, 2), {0.5f, 0.5f});
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
  rays.offset.traced = true;
  cli::parse_points("in.csv", bytes, rays);
}

void read_spectrum_file(const std::string& bytes) {
  const Spectrum spectrum = read_spectrum(write_input(bytes, "in.spd"));
  for (const SpectrumUse use : {SpectrumUse::reflectance, SpectrumUse::emission, SpectrumUse::index})
    spectrum_rgb(spectrum, use);
}

// What a viewer sends, after a first message that every state comes from.
void read_message(const std::string& bytes) {
  viewer::Catalogue catalogue;
  catalogue.plain = {"path", "ambient"};
  catalogue.models = {{"a.octrad", {"lhs", "rhs"}}, {"b.octrad", {"lhs"}}};
  catalogue.layers = {"normal", "albedo"};
  catalogue.stored = true;
  viewer::ViewState state;
  viewer::set_pose(state, {{"origin", {0, 0, 4}}, {"target", {0, 0, 0}}});
  state.width = state.height = 16;
  state.a.integrator = "path";
  const nlohmann::json message = parse_json(bytes, "message");
  if (!message.is_object()) return;
  state = viewer::apply_set(state, message, catalogue);
  viewer::apply_set(state, viewer::to_json(state), catalogue);
  viewer::pose_json(state.camera);
}

template <void (*read)(const std::string&)>
void guarded(const std::string& bytes) {
  // Beside what the fuzzer and the sanitizers keep, which grows with every run.
  set_memory_limit(resident_bytes() + (std::uint64_t{400} << 20));
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
    {"curves", guarded<[](const std::string& bytes) {
       for (const CurveKind kind : {CurveKind::linear, CurveKind::bspline})
         read_mesh(make_curves(parse_curves("in.txt", bytes, kind), kind, Transform()));
     }>},
    {"measured", guarded<[](const std::string& bytes) {
       const MeasuredSummary summary = summarize(parse_measured("in.bsdf", bytes));
       if (!(max_component(summary.albedo) <= 1.0f && summary.roughness > 0.0f)) std::abort();
     }>},
    {"png", guarded<read_picture>},
    {"jpeg", guarded<read_picture>},
    {"webp", guarded<read_picture>},
    {"exr", guarded<read_picture>},
    {"hdr", guarded<read_picture>},
    {"pfm", guarded<read_picture>},
    {"bmp", guarded<read_picture>},
    {"tga", guarded<[](const std::string& bytes) { parse_image("in.tga", bytes); }>},
    {"gltf", guarded<read_gltf_scene>},
    {"pbrt", guarded<read_pbrt_scene>},
    {"old_scene", guarded<[](const std::string& bytes) { check_scene_file(write_input(bytes, "in.xml")); }>},
    {"model", guarded<read_model>},
    {"config", guarded<read_config>},
    {"camera", guarded<read_camera>},
    {"path", guarded<read_path>},
    {"points", guarded<read_points>},
    {"spectrum", guarded<read_spectrum_file>},
    {"matrix", guarded<[](const std::string& bytes) { paper::parse_matrix(bytes, "in.json"); }>},
    {"message", guarded<read_message>},
    {"state", guarded<[](const std::string& bytes) {
       read_film_state(write_input(bytes, "in.state"), {{"scene", "0"}});
     }>},
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
  std::ofstream("t.bsdf", std::ios::binary) << testing::measured_sample_file(0);
  std::ofstream("t.obj") << "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  std::ofstream("t.ply")
      << "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
         "property float r\nproperty float g\nproperty float b\nelement face 1\n"
         "property list uchar int vertex_indices\nproperty float r\nproperty float g\nproperty float b\n"
         "end_header\n0 0 0 1 0 0\n1 0 0 0 1 0\n0 1 0 0 0 1\n3 0 1 2 0.1 0.2 0.3\n";
  std::ofstream("t.pbrt") << "Translate 0 0 1\nShape \"sphere\"\n";
  std::ofstream("t.spd") << "400 0.5\n700 0.25\n";
  std::ofstream("t.xml") << "<scene version=\"2.0.0\"><bsdf type=\"plastic\" id=\"included\"/></scene>\n";
  Image8 picture(2, 2, 3);
  picture.data[0] = 200;
  write_image("t.png", picture);
}

}  // namespace octrad::fuzz
