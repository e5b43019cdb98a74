#include "octrad/scene/load.h"

#include <algorithm>
#include <cmath>
#include <exception>

#include "octrad/base/error.h"
#include "octrad/base/join.h"
#include "octrad/base/memory_limit.h"
#include "octrad/base/threads.h"
#include "octrad/scene/builder.h"
#include "octrad/scene/fingerprint.h"

namespace octrad {
namespace {

const std::vector<std::string> kSceneTags = {"integrator", "sensor", "bsdf", "texture", "shape", "emitter"};

}  // namespace

Scene SceneBuilder::build() {
  Material standard;
  standard.id = "(default)";
  standard.reflectance = constant_texture(Vec3f(0.5f));
  scene_.materials.push_back(standard);
  const Element& root = *description_.root;
  for (const auto& child : root.children) {
    const Element& element = follow_reference(description_, *child);
    if (element.tag == "shape") {
      add_shape(element);
    } else if (element.tag == "bsdf") {
      material(element);  // also when nothing uses it: mistakes are found now, not when it is first used
    } else if (element.tag == "sensor") {
      add_sensor(element);
    } else if (element.tag == "integrator") {
      add_integrator(element);
    } else if (element.tag == "emitter") {
      add_emitter(element);
    } else if (element.tag == "texture") {
      if (element.find("id") == nullptr)
        fail(element.location, "a <texture> at the top level needs an id, to be referred to");
    } else {
      std::vector<std::string> known = kSceneTags;
      known.insert(known.end(), {"default", "include", "alias", "path", "ref"});
      fail(element.location, "unknown element <" + element.tag + "> at the top level" +
                                 did_you_mean(element.tag, known) + "; supported: " + join(known));
    }
  }
  if (scene_.cameras.empty()) fail(root.location, "the scene has no sensor; add <sensor type=\"perspective\">");
  if (scene_.shapes.empty()) fail(root.location, "the scene has no shape");
  load_files();
  aim_projectors();
  find_bounds();
  scene_.fingerprint = scene_fingerprint(scene_);
  return std::move(scene_);
}

void SceneBuilder::add_integrator(const Element& element) {
  Params params(description_, element, scene_.warnings);
  if (has_integrator_) fail(element.location, "the scene has a second integrator");
  has_integrator_ = true;
  scene_.max_depth = params.int_in("max_depth", -1, -1, 1 << 30);
  if (scene_.max_depth == 0) scene_.warnings.push_back(element.location.text() + ": max_depth 0 shows nothing");
  if (params.get_bool("hide_emitters", false)) {
    scene_.warnings.push_back(element.location.text() + ": hide_emitters is not supported; emitters are shown");
  }
  params.ignore_rest();  // the integrator is chosen on the command line
}

void SceneBuilder::load_files() {
  // Large files first would balance better, but the order decides which of several errors is reported: keep it.
  const std::size_t jobs = bitmaps_.size() + mesh_jobs_.size();
  std::vector<std::exception_ptr> errors(jobs);
  parallel_for(jobs, [&](std::size_t i) {
    try {
      const MemoryScope scope;
      if (i < bitmaps_.size()) {
        load_bitmap(i);
        return;
      }
      MeshJob& job = mesh_jobs_[i - bitmaps_.size()];
      if (!job.path.empty()) {
        job.raw = job.format == MeshJob::Format::ply   ? read_ply(job.path)
                  : job.format == MeshJob::Format::obj ? read_obj(job.path)
                                                       : read_serialized(job.path, job.index);
      }
      // Normals as doubles, then as floats.
      if (!job.path.empty()) ask_memory(job.raw.positions.size() * (sizeof(Vec3d) + sizeof(Vec3f)), job.path);
      scene_.meshes[static_cast<std::size_t>(job.mesh)] = place_mesh(std::move(job.raw), job.to_world, job.options);
    } catch (...) {
      errors[i] = std::current_exception();
    }
  });
  for (std::size_t i = 0; i < jobs; ++i) {
    if (!errors[i]) continue;
    // Name also the object that refers to the file.
    const Location& where = i < bitmaps_.size() ? bitmaps_[i].where : mesh_jobs_[i - bitmaps_.size()].where;
    try {
      std::rethrow_exception(errors[i]);
    } catch (const Error& error) {
      const std::string message = error.what();
      const std::string prefix = where.text();
      if (message.rfind(prefix, 0) == 0) throw;
      if (error.code() == ExitCode::io) throw IoError(prefix + ": " + message);
      if (error.code() == ExitCode::out_of_memory) throw MemoryError(prefix + ": " + message);
      throw InputError(prefix + ": " + message);
    }
  }
}

Scene load_scene(const std::string& file, const LoadOptions& options) {
  const Description description = read_description(file, options.definitions);
  Scene scene = SceneBuilder(description).build();
  scene.file = file;
  scene.other_files = description.files;
  scene.warnings.insert(scene.warnings.begin(), description.warnings.begin(), description.warnings.end());
  return scene;
}

}  // namespace octrad
