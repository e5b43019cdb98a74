// A scene with everything that tracing light in it needs, owned in one place.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "octrad/device/stream.h"
#include "octrad/geometry/bvh8.h"
#include "octrad/geometry/surface_sampling.h"
#include "octrad/shading/device_world.h"
#include "octrad/transport/context.h"

namespace octrad {

// What an edit made different, for those who learn the scene (Trainer::scene_changed).
struct SceneChange {
  std::vector<int> shapes;    // that emit or scatter otherwise
  std::vector<Vec3f> lights;  // places of lights without extent that do
  bool materials = false;     // not only emission
  SceneChange& operator+=(const SceneChange& other);
};

// Whether material `of` is `material`, has it on its back, or blends it.
bool uses_material(const Scene& scene, int of, int material);

// Materials and lights are prepared by the constructor. Probabilities of picking emitters and directions of
// the environment (light_weights.h), acceleration structures, the surface sampler and a stream's copy are built when
// they are first asked for, once each, whoever asks. Thread-safe. What it hands out lives as long as it does, also when
// it is moved.
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

  // Edits: the emission of lights, times a factor, and colour and roughness of materials. Geometry stays as it is, and
  // so does scene(). Not while anything else uses this object; what was made from it goes on with the scene as it is
  // now, and so do the copies on streams. Lights are numbered as Lights::set_factor() numbers them, factors are >= 0.
  // Throws InputError for the environment where there is a copy on a stream, whose users hold its factor.
  int light_count() const;
  Vec3f light_factor(int light) const;
  SceneChange set_light_factor(int light, Vec3f factor);
  const MaterialEdit& material_edit(int material) const;
  SceneChange set_material_edit(int material, const MaterialEdit& edit);
  // That of the scene, and another one while there are edits.
  std::string fingerprint() const;

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
