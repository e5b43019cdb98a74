#include "octrad/scene/load.h"

#include <algorithm>
#include <exception>
#include <memory>
#include <set>

#include "octrad/base/error.h"
#include "octrad/base/join.h"
#include "octrad/base/memory_limit.h"
#include "octrad/base/number_text.h"
#include "octrad/base/threads.h"
#include "octrad/scene/builder.h"
#include "octrad/scene/fingerprint.h"
#include "octrad/scene/make_element.h"
#include "octrad/scene/plugins.h"

namespace octrad {
namespace {

const std::vector<std::string> kSceneTags = {"integrator", "sensor", "bsdf", "texture", "shape", "emitter"};

// Names also the object that refers to the file.
[[noreturn]] void rethrow_at(const Location& where, const std::exception_ptr& error) {
  try {
    std::rethrow_exception(error);
  } catch (const Error& e) {
    const std::string message = e.what();
    const std::string prefix = where.text();
    if (message.rfind(prefix, 0) == 0) throw;
    if (e.code() == ExitCode::io) throw IoError(prefix + ": " + message);
    if (e.code() == ExitCode::out_of_memory) throw MemoryError(prefix + ": " + message);
    fail(where, message);
  }
}

// Integrators of Mitsuba that find what `path` finds, and those that hold another one.
const std::vector<std::string> kPathIntegrators = {"path", "moment", "aov"};

// The max_depth that Mitsuba 3's differentiable integrators have where a scene gives none (its ADIntegrator); -1 of
// others.
int default_depth(const std::string& integrator) {
  static const std::set<std::string> kinds = {"prb", "prb_basic", "prb_projective", "prb_reparam", "prbvolpath"};
  return kinds.count(integrator) > 0 ? 6 : -1;
}

// Light that is scattered once.
bool is_direct(const std::string& integrator) {
  return integrator == "direct" || integrator == "direct_projective" || integrator == "direct_reparam";
}

}  // namespace

std::vector<std::pair<std::string, std::vector<std::string>>> plugin_types() {
  return {{"shape", shape_types()},       {"bsdf", bsdf_types()},       {"texture", texture_types()},
          {"spectrum", spectrum_types()}, {"emitter", emitter_types()}, {"sensor", sensor_types()},
          {"film", film_types()},         {"rfilter", rfilter_types()}};
}

SceneBuilder::Mark SceneBuilder::mark() const {
  return {scene_.area_lights.size(), scene_.delta_lights.size(),
          projectors_.size(),        scene_.shapes.size(),
          scene_.placements.size(),  group_order_.size(),
          scene_.meshes.size(),      mesh_jobs_.size(),
          scene_.spheres.size(),     scene_.environments.size(),
          bitmaps_.size(),           open_materials_.size(),
          materials_.size(),         in_shape_};
}

void SceneBuilder::roll_back(const Mark& mark, const Element& element) {
  scene_.area_lights.resize(mark.lights);
  scene_.delta_lights.resize(mark.delta_lights);
  projectors_.resize(mark.projectors);
  scene_.shapes.resize(mark.shapes);
  scene_.placements.resize(mark.placements);
  placed_at_.resize(mark.placements);
  for (; group_order_.size() > mark.groups; group_order_.pop_back()) groups_.erase(group_order_.back());
  scene_.meshes.resize(mark.meshes);
  // Those with attributes of the meshes that are gone.
  if (materials_.size() > mark.materials)
    std::erase_if(materials_, [&](const auto& made) { return made.first.second >= static_cast<int>(mark.meshes); });
  mesh_jobs_.resize(mark.mesh_jobs);
  scene_.spheres.resize(mark.spheres);
  scene_.environments.resize(mark.environments);
  for (std::size_t i = mark.bitmaps; i < bitmaps_.size(); ++i) {
    if (bitmaps_[i].texture < 0) bitmaps_[i].path.clear();  // of the environment: not read
  }
  open_materials_.resize(mark.open);
  in_shape_ = mark.in_shape;
  if (description_.understood) description_.understood->left_out.insert(&element);
}

void SceneBuilder::check_complete() const {
  const Location& where = description_.root->location;
  const std::vector<float> weights = scene_.sampling_weights();
  if (!weights.empty() && *std::max_element(weights.begin(), weights.end()) == 0.0f)
    fail(where, "the sampling_weight of all emitters is 0: none could be picked");
}

Scene SceneBuilder::build() {
  Material standard;
  standard.id = "(default)";
  standard.reflectance = constant_texture(Vec3f(0.5f));
  scene_.materials.push_back(standard);
  const Element& root = *description_.root;
  for (const auto& child : root.children) add(*child, [&] { add_object(follow_reference(description_, *child)); });
  if (!report().collects()) check_complete();
  load_files();
  drop_failed_shapes();
  check_complete();
  aim_projectors();
  find_bounds();
  if (scene_.cameras.empty()) {
    const bool sensor = std::any_of(root.children.begin(), root.children.end(),
                                    [](const auto& child) { return child->tag == "sensor"; });
    if (scene_.shapes.empty()) {
      fail(root.location,
           report().refused().empty()
               ? "the scene has neither a shape with triangles nor a sensor"
               : "without what cannot be used the scene has neither a shape with triangles nor a sensor");
    }
    report().assume(root.location, std::string("the scene has no sensor") + (sensor ? " that can be used" : "") +
                                       ": one that looks at all of it from outside, with y up, is added");
    add_sensor(make_overview_sensor(*description_.root, root.location, scene_.bounds));
  }
  if (scene_.area_lights.empty() && scene_.delta_lights.empty() && scene_.environments.empty())
    scene_.warnings.push_back(root.location.text() + ": the scene has no emitter: everything is black");
  else if (scene_.shapes.empty())
    scene_.warnings.push_back(root.location.text() + ": the scene has no shape: " +
                              (scene_.environments.empty() ? "everything is black" : "only its environment is seen"));
  scene_.fingerprint = scene_fingerprint(scene_);
  return std::move(scene_);
}

void SceneBuilder::add_object(const Element& element) {
  const auto leave_out = [&](const std::string& what) {
    report().assume(element.location, what + " is not used");
    if (description_.understood) description_.understood->left_out.insert(&element);
  };
  if (element.tag == "shape") {
    add_shape(element);
  } else if (element.tag == "bsdf") {
    // Also when nothing uses it: mistakes are found now, not when it is first used.
    if ((texture_kinds(element) & kUsesAttributes) == 0) material(element);
  } else if (element.tag == "sensor") {
    add_sensor(element);
  } else if (element.tag == "integrator") {
    add_integrator(element);
  } else if (element.tag == "emitter") {
    // One with an id may be meant for shapes that refer to it.
    if (element.get("type") != "area" || !element.find("id")) add_emitter(element);
  } else if (element.tag == "texture" || element.tag == "spectrum" || element.tag == "film" ||
             element.tag == "sampler" || element.tag == "rfilter" || element.tag == "medium" ||
             element.tag == "phase" || element.tag == "volume") {
    // Those with an id are for what refers to them; a medium is refused where something uses it.
    if (element.find("id") == nullptr) leave_out("a <" + element.tag + "> at the top level without an id");
  } else if (element.old && element.find("name") && element.find("value")) {
    leave_out("parameter \"" + element.get("name") + "\" of the scene");
  } else if (element.tag == "boolean" && (element.get("name") == "embree_use_robust_intersections" ||
                                          element.get("name") == "allow_thread_reordering")) {
    // Of Mitsuba's ray tracers.
  } else {
    std::vector<std::string> known = kSceneTags;
    known.insert(known.end(), {"default", "include", "alias", "path", "ref"});
    const std::string now = renamed_tag(element.tag);
    fail(element.location, "unknown element <" + element.tag + "> at the top level" +
                               (now.empty() ? did_you_mean(element.tag, known) : now) + "; supported: " + join(known));
  }
}

// Shapes whose files could not be read or hold no triangle, after that was listed; and their meshes.
void SceneBuilder::drop_failed_shapes() {
  if (std::none_of(mesh_jobs_.begin(), mesh_jobs_.end(), [](const MeshJob& job) { return job.failed || job.empty; }))
    return;
  std::vector<int> kept(scene_.meshes.size());  // their new places; -1
  std::vector<TriangleMesh> meshes;
  for (const MeshJob& job : mesh_jobs_) {
    const auto mesh = static_cast<std::size_t>(job.mesh);
    if (job.failed || job.empty) {
      kept[mesh] = -1;
      if (description_.understood) description_.understood->left_out.insert(job.element);
    } else {
      kept[mesh] = static_cast<int>(meshes.size());
      meshes.push_back(std::move(scene_.meshes[mesh]));
    }
  }
  scene_.meshes = std::move(meshes);
  std::vector<Shape> shapes;
  std::vector<AreaLight> lights;
  for (Shape& shape : scene_.shapes) {
    if (shape.kind == Shape::Kind::mesh) {
      shape.geometry = kept[static_cast<std::size_t>(shape.geometry)];
      if (shape.geometry < 0) continue;
    }
    if (shape.emitter >= 0) {
      lights.push_back(scene_.area_lights[static_cast<std::size_t>(shape.emitter)]);
      lights.back().shape = static_cast<int>(shapes.size());
      shape.emitter = static_cast<int>(lights.size()) - 1;
    }
    shapes.push_back(std::move(shape));
  }
  scene_.shapes = std::move(shapes);
  scene_.area_lights = std::move(lights);
}

void SceneBuilder::add_integrator(const Element& element) {
  Params params(description_, element, scene_.warnings);
  if (has_integrator_) fail(element.location, "the scene has a second integrator");
  has_integrator_ = true;
  // moment and aov hold the integrator whose radiance they record.
  const std::vector<const Element*> nested = params.nested("integrator");
  // Of several the first that makes pictures.
  const auto pictures = [](const Element* e) {
    const std::string& type = e->get("type");
    return type != "depth" && type != "field" && type != "aov";
  };
  const auto chosen = std::find_if(nested.begin(), nested.end(), pictures);
  if (!nested.empty()) {
    const Element& inner = chosen != nested.end() ? **chosen : *nested[0];
    if (nested.size() > 1)
      report().assume(inner.location, "of several integrators in \"" + params.type() + "\" this one is read");
    has_integrator_ = false;
    add_integrator(inner);
  }
  const std::string& type = params.type();
  const int usual = default_depth(type), depth = params.int_in("max_depth", usual, -1, 1 << 30);
  if (is_direct(type)) {
    report().assume(element.location, "integrator \"" + type + "\" read as path of max_depth 2");
    scene_.max_depth = 2;
  } else {
    if (std::find(kPathIntegrators.begin(), kPathIntegrators.end(), type) == kPathIntegrators.end())
      report().assume(element.location, "integrator \"" + type + "\" read as path" +
                                            (usual > 0 && !params.given("max_depth")
                                                 ? ", of max_depth " + std::to_string(usual) + " as in Mitsuba"
                                                 : ""));
    if (nested.empty()) scene_.max_depth = depth;
  }
  const bool hide = params.get_bool("hide_emitters", false);
  if (nested.empty()) scene_.hide_emitters = hide;
  if (scene_.max_depth == 0) scene_.warnings.push_back(element.location.text() + ": max_depth 0 shows nothing");
  params.ignore_rest();  // the integrator is chosen on the command line
}

// Each job reads its file, or takes what another one has read.
void SceneBuilder::share_files() {
  for (const BitmapJob& job : bitmaps_) {
    if (!job.built && !job.path.empty()) picture_files_[job.path].expect();
  }
  for (MeshJob& job : mesh_jobs_) {
    if (job.path.empty()) continue;
    if (job.curve) {
      job.curve_file = &curve_files_[{job.path, *job.curve}];
      job.curve_file->expect();
      continue;
    }
    std::set<std::string> attributes;
    for (const AttributeUse& use : job.attributes) attributes.insert(use.name);
    job.file = &mesh_files_[{job.path, job.format, job.index, std::move(attributes)}];
    job.file->expect();
  }
}

void SceneBuilder::read_mesh(MeshJob& job) {
  const std::shared_ptr<RawMesh> content = job.file->take([&] {
    std::vector<std::string> wanted;
    for (const AttributeUse& use : job.attributes) wanted.push_back(use.name);
    return job.format == MeshJob::Format::ply   ? read_ply(job.path, wanted)
           : job.format == MeshJob::Format::obj ? read_obj(job.path)
                                                : read_serialized(job.path, job.index);
  });
  if (!job.file->is_shared()) {
    job.raw = std::move(*content);
    return;
  }
  ask_memory(content->bytes(), job.path);
  job.raw = *content;
}

void SceneBuilder::load_files() {
  share_files();
  // Large files first would balance better, but the order decides which of several errors is reported: keep it.
  const std::size_t jobs = bitmaps_.size() + mesh_jobs_.size();
  std::vector<std::exception_ptr> errors(jobs);
  parallel_for(jobs, [&](std::size_t i) {
    try {
      const MemoryScope scope;
      if (i < bitmaps_.size()) {
        if (!bitmaps_[i].path.empty()) load_bitmap(i);
        return;
      }
      MeshJob& job = mesh_jobs_[i - bitmaps_.size()];
      if (job.file) read_mesh(job);
      if (job.curve) {
        const auto curves =
            job.curve_file ? job.curve_file->take([&] { return read_curves(job.path, *job.curve); }) : nullptr;
        job.raw = make_curves(curves ? *curves : *job.built_curves, *job.curve, job.to_world);
        job.to_world = Transform();
      }
      job.empty = job.raw.triangles.empty();
      if (job.empty) {
        job.raw = {};
        return;
      }
      const std::vector<MeshAttribute> attributes = std::move(job.raw.attributes);
      // Normals as doubles, then as floats.
      if (!job.path.empty()) ask_memory(job.raw.positions.size() * (sizeof(Vec3d) + sizeof(Vec3f)), job.path);
      scene_.meshes[static_cast<std::size_t>(job.mesh)] = place_mesh(std::move(job.raw), job.to_world, job.options);
      if (!job.attributes.empty()) place_attributes(job, attributes);
    } catch (...) {
      errors[i] = std::current_exception();
    }
  });
  for (const BitmapJob& job : bitmaps_) {
    if (job.negative > 0)
      report().assume(job.where, "the picture " + job.path + " has " + std::to_string(job.negative) +
                                     " negative values, read as 0");
    if (job.beyond > 0)
      report().assume(job.where, "the picture " + job.path + " has " + std::to_string(job.beyond) +
                                     " values a little below 0 or above 1, read as 0 and 1");
    if (job.bright > 0)
      report().assume(job.where, "the picture " + job.path + " has " + std::to_string(job.bright) +
                                     " texels of reflectance above 1 (up to " + number_text(job.brightest) +
                                     "), read as 1: the cache needs surfaces that do not make energy. Mitsuba keeps "
                                     "such values");
  }
  for (const MeshJob& job : mesh_jobs_) {
    if (job.empty) report().assume(job.where, "the mesh " + job.path + " has no triangle: its shape is left out");
  }
  for (std::size_t i = 0; i < jobs; ++i) {
    if (!errors[i]) continue;
    const Location& where = i < bitmaps_.size() ? bitmaps_[i].where : mesh_jobs_[i - bitmaps_.size()].where;
    if (report().attempt(where, [&] { rethrow_at(where, errors[i]); })) continue;
    if (i < bitmaps_.size()) {
      fill_bitmap(bitmaps_[i], 1, 1, {stand_in(bitmaps_[i].roles.front())});
    } else {
      mesh_jobs_[i - bitmaps_.size()].failed = true;
    }
  }
}

Scene build_scene(const Description& description) {
  Scene scene = SceneBuilder(description).build();
  scene.file = description.root->location.file->name();
  scene.other_files = description.files;
  scene.warnings.insert(scene.warnings.begin(), description.warnings.begin(), description.warnings.end());
  scene.assumed = description.report->assumed();
  scene.refused = description.report->refused();
  return scene;
}

Scene load_scene(const std::string& file, const LoadOptions& options) {
  SceneReport report(options.permissive);
  return build_scene(read_description(file, options.definitions, report));
}

SceneCheck check_scene_file(const std::string& file, const LoadOptions& options) {
  SceneReport report(true);
  bool built = false;
  try {
    build_scene(read_description(file, options.definitions, report));
    built = true;
  } catch (const InputError& error) {  // what no stand-in helps
    report.collect({}, error);
  }
  return {report.refused(), report.assumed(), built};
}

}  // namespace octrad
