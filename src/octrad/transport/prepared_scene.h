// A scene with everything that tracing light in it needs, owned in one place.
#pragma once

#include <memory>

#include "octrad/device/stream.h"
#include "octrad/geometry/bvh8.h"
#include "octrad/geometry/surface_sampling.h"
#include "octrad/shading/device_world.h"
#include "octrad/transport/context.h"

namespace octrad {

// Materials and lights are prepared by the constructor. Acceleration structures, the surface sampler and a stream's
// copy are built when they are first asked for, once each, whoever asks. Thread-safe. What it hands out lives as long
// as it does, also when it is moved.
class PreparedScene {
 public:
  // What rays of the CPU traverse. Hits agree up to rounding; `bvh8` is the tree that devices traverse.
  enum class CpuTree { embree, bvh8 };

  explicit PreparedScene(Scene scene, CpuTree tree = CpuTree::embree);
  PreparedScene(PreparedScene&&) noexcept;
  PreparedScene& operator=(PreparedScene&&) noexcept;
  ~PreparedScene();

  const Scene& scene() const;
  const Materials& materials() const;
  const Lights& lights() const;
  const Tracer& tracer() const;
  const Bvh8& bvh8() const;
  // Throws InputError for a scene without surfaces.
  const SurfaceSampler& surfaces() const;
  // What estimators on the CPU take.
  TransportContext context() const;

  // The scene in the memory of `stream`, which must outlive this object or be released before. Throws MemoryError,
  // DeviceError.
  const DeviceWorld& world(Stream& stream) const;
  // Bytes that world() has yet to allocate on `stream`: 0 once the scene is there.
  std::size_t bytes_to_upload(const Stream& stream) const;
  // Frees the copy on `stream`, if there is one. Nothing may use it any more.
  void release(const Stream& stream) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace octrad
