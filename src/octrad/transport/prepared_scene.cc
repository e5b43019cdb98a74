#include "octrad/transport/prepared_scene.h"

#include <bit>
#include <cstdio>
#include <map>
#include <mutex>
#include <optional>
#include <utility>

#include "octrad/base/error.h"
#include "octrad/base/rng.h"
#include "octrad/shading/device_scene.h"
#include "octrad/transport/light_weights.h"

namespace octrad {

SceneChange& SceneChange::operator+=(const SceneChange& other) {
  shapes.insert(shapes.end(), other.shapes.begin(), other.shapes.end());
  lights.insert(lights.end(), other.lights.begin(), other.lights.end());
  materials = materials || other.materials;
  return *this;
}

bool uses_material(const Scene& scene, int of, int material) {
  if (of < 0 || of == material) return of == material;
  const Material& m = scene.materials[static_cast<std::size_t>(of)];
  return uses_material(scene, m.back, material) || uses_material(scene, m.blended[0], material) ||
         uses_material(scene, m.blended[1], material);
}

struct PreparedScene::Impl {
  const Scene scene;
  const CpuTree tree;
  Materials materials{scene};
  Lights lights{scene};
  bool lights_are_measured;         // or need not be
  std::vector<Vec3f> factors;       // of the lights
  std::vector<MaterialEdit> edits;  // of the materials

  std::recursive_mutex building;  // one part may ask for another
  std::unique_ptr<Tracer> tracer;
  std::optional<Bvh8> bvh8;
  std::optional<SurfaceSampler> surfaces;
  std::map<const Stream*, DeviceScene> copies;

  Impl(Scene s, CpuTree t) : scene(std::move(s)), tree(t) {
    factors.resize(static_cast<std::size_t>(lights.view().count), Vec3f(1.0f));
    edits.resize(scene.materials.size());
    const LightsView& view = lights.view();
    const bool needed = view.count > 1 || (view.has_environment() && view.environment.height > 1);
    lights_are_measured = !needed || scene.cameras.empty() || !scene.sampling_weights().empty();
  }
};

PreparedScene::PreparedScene(Scene scene, CpuTree tree) : impl_(std::make_unique<Impl>(std::move(scene), tree)) {}
PreparedScene::PreparedScene(PreparedScene&&) noexcept = default;
PreparedScene& PreparedScene::operator=(PreparedScene&&) noexcept = default;
PreparedScene::~PreparedScene() = default;

const Scene& PreparedScene::scene() const { return impl_->scene; }
const Materials& PreparedScene::materials() const { return impl_->materials; }
const Lights& PreparedScene::lights() const {
  const std::lock_guard lock(impl_->building);
  if (!std::exchange(impl_->lights_are_measured, true)) {
    const TransportContext world{scene(), tracer(), materials(), impl_->lights};
    if (const auto places = environment_places(world)) impl_->lights.set_environment_places(*places);
    if (impl_->lights.view().count > 1) impl_->lights.set_weights(light_weights(world));
  }
  return impl_->lights;
}

const Tracer& PreparedScene::tracer() const {
  const std::lock_guard lock(impl_->building);
  if (!impl_->tracer) {
    impl_->tracer = impl_->tree == CpuTree::embree ? make_embree_tracer(impl_->scene) : make_bvh8_tracer(bvh8().view());
  }
  return *impl_->tracer;
}

const Bvh8& PreparedScene::bvh8() const {
  const std::lock_guard lock(impl_->building);
  if (!impl_->bvh8) impl_->bvh8 = build_bvh8(impl_->scene);
  return *impl_->bvh8;
}

const SurfaceSampler& PreparedScene::surfaces() const {
  const std::lock_guard lock(impl_->building);
  if (!impl_->surfaces) {
    const Scene& scene = impl_->scene;
    std::vector<int> scattering;  // none of `null`, which nothing is learnt of: a sky dome may have most of the area
    for (std::size_t s = 0; s < scene.shapes.size(); ++s) {
      if (scene.materials[static_cast<std::size_t>(scene.shapes[s].material)].type != BsdfType::null)
        scattering.push_back(static_cast<int>(s));
    }
    impl_->surfaces.emplace(scene, scattering);
  }
  return *impl_->surfaces;
}

TransportContext PreparedScene::context() const { return {scene(), tracer(), materials(), lights()}; }

namespace {

SceneTables tables_of(const PreparedScene& scene) {
  const SurfaceSampler* surfaces = nullptr;
  try {
    surfaces = &scene.surfaces();
  } catch (const InputError&) {  // a scene without surfaces can be rendered: its environment
  }
  return {scene.scene(), scene.materials(), scene.lights(), scene.bvh8(), surfaces};
}

}  // namespace

int PreparedScene::light_count() const { return static_cast<int>(impl_->factors.size()); }
Vec3f PreparedScene::light_factor(int light) const { return impl_->factors.at(static_cast<std::size_t>(light)); }
const MaterialEdit& PreparedScene::material_edit(int material) const {
  return impl_->edits.at(static_cast<std::size_t>(material));
}

SceneChange PreparedScene::set_light_factor(int light, Vec3f factor) {
  const std::lock_guard lock(impl_->building);
  const Scene& s = impl_->scene;
  const std::size_t delta = s.area_lights.size(), environment = delta + s.delta_lights.size();
  const auto i = static_cast<std::size_t>(light);
  if (i >= environment && !impl_->copies.empty())
    throw InputError("the environment cannot be changed while the scene is on a GPU");
  impl_->factors.at(i) = factor;
  lights();  // what is picked how often is measured in the scene as it was loaded
  impl_->lights.set_factor(light, factor);
  for (auto& [stream, copy] : impl_->copies) copy.update(tables_of(*this));
  SceneChange change;
  if (i < delta) {
    change.shapes.push_back(s.area_lights[i].shape);
  } else if (i < environment && s.delta_lights[i - delta].kind != DeltaLight::Kind::directional) {
    change.lights.push_back(s.delta_lights[i - delta].position);
  }
  return change;
}

SceneChange PreparedScene::set_material_edit(int material, const MaterialEdit& edit) {
  const std::lock_guard lock(impl_->building);
  lights();  // measured in the scene as it was loaded, as in set_light_factor()
  impl_->edits.at(static_cast<std::size_t>(material)) = edit;
  impl_->materials.set_edit(material, edit);
  for (auto& [stream, copy] : impl_->copies) copy.update(tables_of(*this));
  SceneChange change;
  change.materials = true;
  for (std::size_t i = 0; i < impl_->scene.shapes.size(); ++i) {
    if (uses_material(impl_->scene, impl_->scene.shapes[i].material, material))
      change.shapes.push_back(static_cast<int>(i));
  }
  return change;
}

std::string PreparedScene::fingerprint() const {
  std::uint64_t hash = 0;
  const auto add = [&hash](float v) { hash = mix64(hash + 0x9e3779b97f4a7c15ull) ^ std::bit_cast<std::uint32_t>(v); };
  bool edited = false;
  for (const Vec3f& f : impl_->factors) {
    edited = edited || !(f == Vec3f(1.0f));
    for (int c = 0; c < 3; ++c) add(f[c]);
  }
  for (const MaterialEdit& e : impl_->edits) {
    edited = edited || e.color || e.roughness;
    const Vec3f color = e.color.value_or(Vec3f(-1.0f));
    for (int c = 0; c < 3; ++c) add(color[c]);
    add(e.roughness.value_or(-1.0f));
  }
  if (!edited) return impl_->scene.fingerprint;
  for (const char c : impl_->scene.fingerprint)
    hash = mix64(hash + 0x9e3779b97f4a7c15ull) ^ static_cast<std::uint8_t>(c);
  char text[17];
  std::snprintf(text, sizeof(text), "%016llx", static_cast<unsigned long long>(hash));
  return text;
}

const DeviceWorld& PreparedScene::world(Stream& stream) const {
  const std::lock_guard lock(impl_->building);
  const auto found = impl_->copies.find(&stream);
  if (found != impl_->copies.end()) return found->second.world();
  return impl_->copies.emplace(&stream, DeviceScene(stream, tables_of(*this))).first->second.world();
}

std::size_t PreparedScene::bytes_to_upload(const Stream& stream) const {
  const std::lock_guard lock(impl_->building);
  return impl_->copies.count(&stream) > 0 ? 0 : DeviceScene::bytes(tables_of(*this));
}

void PreparedScene::release(const Stream& stream) const {
  const std::lock_guard lock(impl_->building);
  impl_->copies.erase(&stream);
}

}  // namespace octrad
