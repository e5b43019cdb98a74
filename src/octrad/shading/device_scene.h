// A scene in the memory of a Stream, for kernels.
#pragma once

#include "octrad/device/array.h"
#include "octrad/geometry/bvh8.h"
#include "octrad/geometry/surface_sampling.h"
#include "octrad/scene/scene.h"
#include "octrad/shading/device_world.h"
#include "octrad/shading/lights.h"
#include "octrad/shading/materials.h"

namespace octrad {

// What is uploaded; all made from the same scene. Not needed any more once DeviceScene is constructed.
struct SceneTables {
  const Scene& scene;
  const Materials& materials;
  const Lights& lights;
  const Bvh8& bvh;
  const SurfaceSampler* surfaces = nullptr;  // null: sample_surface() cannot be used
};

class DeviceScene {
 public:
  // One allocation of bytes(tables). Throws MemoryError, DeviceError. The stream must outlive this object.
  DeviceScene(Stream& stream, const SceneTables& tables);
  static std::size_t bytes(const SceneTables& tables);

  // Uploads materials and lights anew: those of the same scene, changed in place (PreparedScene::edit). Not while work
  // on the stream uses them.
  void update(const SceneTables& tables);

  std::size_t bytes() const { return memory_.bytes(); }
  // Valid as long as this object, also when it is moved.
  const DeviceWorld& world() const { return world_; }

 private:
  Stream* stream_;
  DeviceArray<unsigned char> memory_;
  DeviceWorld world_;
};

}  // namespace octrad
