#include "octrad/transport/prepared_scene.h"

#include <map>
#include <mutex>
#include <optional>

#include "octrad/base/error.h"
#include "octrad/shading/device_scene.h"

namespace octrad {

struct PreparedScene::Impl {
  const Scene scene;
  const CpuTree tree;
  const Materials materials{scene};
  const Lights lights{scene};

  std::recursive_mutex building;  // one part may ask for another
  std::unique_ptr<Tracer> tracer;
  std::optional<Bvh8> bvh8;
  std::optional<SurfaceSampler> surfaces;
  std::map<const Stream*, DeviceScene> copies;

  Impl(Scene s, CpuTree t) : scene(std::move(s)), tree(t) {}
};

PreparedScene::PreparedScene(Scene scene, CpuTree tree) : impl_(std::make_unique<Impl>(std::move(scene), tree)) {}
PreparedScene::PreparedScene(PreparedScene&&) noexcept = default;
PreparedScene& PreparedScene::operator=(PreparedScene&&) noexcept = default;
PreparedScene::~PreparedScene() = default;

const Scene& PreparedScene::scene() const { return impl_->scene; }
const Materials& PreparedScene::materials() const { return impl_->materials; }
const Lights& PreparedScene::lights() const { return impl_->lights; }

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
  if (!impl_->surfaces) impl_->surfaces.emplace(impl_->scene);
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
