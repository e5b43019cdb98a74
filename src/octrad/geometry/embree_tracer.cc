// The Tracer over Embree 3.13; the only file that includes it.
#include <embree3/rtcore.h>
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "octrad/base/bytes.h"
#include "octrad/base/error.h"
#include "octrad/base/memory_limit.h"
#include "octrad/geometry/sphere_math.h"
#include "octrad/geometry/tracer.h"

namespace octrad {
namespace {

static_assert(sizeof(Vec3f) == 12 && sizeof(Vec3i) == 12, "buffers are shared with Embree");

[[noreturn]] void fail(RTCError code, const char* text) {
  const std::string message = fmt::format("ray tracing (Embree): {}", text ? text : "unknown error");
  if (code == RTC_ERROR_OUT_OF_MEMORY)
    throw MemoryError(
        message + fmt::format("; the budget is {} (--max-memory)", format_bytes(static_cast<double>(memory_limit()))));
  throw Error(ExitCode::device, message);
}

struct DeviceRelease {
  void operator()(RTCDevice d) const { rtcReleaseDevice(d); }
};
struct SceneRelease {
  void operator()(RTCScene s) const { rtcReleaseScene(s); }
};
using DevicePtr = std::unique_ptr<std::remove_pointer_t<RTCDevice>, DeviceRelease>;
using ScenePtr = std::unique_ptr<std::remove_pointer_t<RTCScene>, SceneRelease>;

// Spheres are user geometry: Embree's own sphere points report distances that are too coarse to start new rays from.
struct SphereSet {
  const Scene* scene;
  std::vector<int> shapes;  // primitive -> shape
};

const Sphere& sphere_of(const SphereSet& set, unsigned primitive) {
  const Shape& shape = set.scene->shapes[static_cast<std::size_t>(set.shapes[primitive])];
  return set.scene->spheres[static_cast<std::size_t>(shape.geometry)];
}

void set_bounds(const RTCBoundsFunctionArguments* args) {
  const Sphere& s = sphere_of(*static_cast<const SphereSet*>(args->geometryUserPtr), args->primID);
  const Bounds3f box = sphere_bounds(s.center, s.radius);
  RTCBounds& b = *args->bounds_o;
  b.lower_x = box.lower.x;
  b.lower_y = box.lower.y;
  b.lower_z = box.lower.z;
  b.upper_x = box.upper.x;
  b.upper_y = box.upper.y;
  b.upper_z = box.upper.z;
}

// Of ray `i` of a packet of `n`; negative: missed.
double distance_to(const Sphere& sphere, RTCRayN* ray, unsigned n, unsigned i) {
  return intersect_sphere(sphere.center, sphere.radius,
                          {RTCRayN_org_x(ray, n, i), RTCRayN_org_y(ray, n, i), RTCRayN_org_z(ray, n, i)},
                          {RTCRayN_dir_x(ray, n, i), RTCRayN_dir_y(ray, n, i), RTCRayN_dir_z(ray, n, i)},
                          RTCRayN_tnear(ray, n, i), RTCRayN_tfar(ray, n, i));
}

// Embree calls these with single rays and with packets of any width.
void sphere_intersect(const RTCIntersectFunctionNArguments* args) {
  const unsigned n = args->N;
  RTCRayN* ray = RTCRayHitN_RayN(args->rayhit, n);
  RTCHitN* hit = RTCRayHitN_HitN(args->rayhit, n);
  const Sphere& sphere = sphere_of(*static_cast<const SphereSet*>(args->geometryUserPtr), args->primID);
  for (unsigned i = 0; i < n; ++i) {
    if (!args->valid[i]) continue;
    const double t = distance_to(sphere, ray, n, i);
    if (t < 0.0) continue;
    RTCRayN_tfar(ray, n, i) = static_cast<float>(t);
    RTCHitN_geomID(hit, n, i) = args->geomID;
    RTCHitN_primID(hit, n, i) = args->primID;
    RTCHitN_instID(hit, n, i, 0) = args->context->instID[0];
    RTCHitN_u(hit, n, i) = RTCHitN_v(hit, n, i) = 0.0f;
  }
}

void sphere_occluded(const RTCOccludedFunctionNArguments* args) {
  const unsigned n = args->N;
  RTCRayN* ray = args->ray;
  const Sphere& sphere = sphere_of(*static_cast<const SphereSet*>(args->geometryUserPtr), args->primID);
  for (unsigned i = 0; i < n; ++i) {
    if (!args->valid[i]) continue;
    const double t = distance_to(sphere, ray, n, i);
    if (t >= 0.0) RTCRayN_tfar(ray, n, i) = -std::numeric_limits<float>::infinity();
  }
}

// Rays from inside pass a mesh that is one-sided.
void pass_from_inside(const RTCFilterFunctionNArguments* args) {
  const unsigned n = args->N;
  for (unsigned i = 0; i < n; ++i) {
    if (args->valid[i] == 0) continue;
    const float along = RTCRayN_dir_x(args->ray, n, i) * RTCHitN_Ng_x(args->hit, n, i) +
                        RTCRayN_dir_y(args->ray, n, i) * RTCHitN_Ng_y(args->hit, n, i) +
                        RTCRayN_dir_z(args->ray, n, i) * RTCHitN_Ng_z(args->hit, n, i);
    if (along > 0.0f) args->valid[i] = 0;
  }
}

class EmbreeTracer final : public Tracer {
 public:
  EmbreeTracer(const Scene& scene, const std::string& config) {
    device_.reset(rtcNewDevice(config.c_str()));
    if (!device_) fail(rtcGetDeviceError(nullptr), "cannot create a device");
    if (rtcGetDeviceProperty(device_.get(), RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED)) packet_ = 16;
    else if (rtcGetDeviceProperty(device_.get(), RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED)) packet_ = 8;
    before_ = resident_bytes();
    rtcSetDeviceMemoryMonitorFunction(device_.get(), watch_memory, this);
    scene_.reset(rtcNewScene(device_.get()));
    rtcSetSceneFlags(scene_.get(), RTC_SCENE_FLAG_ROBUST);
    rtcSetSceneBuildQuality(scene_.get(), RTC_BUILD_QUALITY_HIGH);
    spheres_.scene = &scene;
    for (std::size_t i = 0; i < scene.shapes.size(); ++i) {
      const Shape& shape = scene.shapes[i];
      if (shape.kind == Shape::Kind::sphere) {
        spheres_.shapes.push_back(static_cast<int>(i));
      } else if (shape.placement < 0) {
        const TriangleMesh& mesh = scene.meshes[static_cast<std::size_t>(shape.geometry)];
        if (mesh.triangles.empty()) continue;
        const unsigned id = geometries_++;
        add_mesh(scene_.get(), mesh, id);
        set_shape(id, static_cast<int>(i));
      } else {
        i = add_instance(scene, i);
      }
    }
    if (!spheres_.shapes.empty()) add_spheres();
    rtcCommitScene(scene_.get());
    check();
  }

  Hit intersect(Vec3f origin, Vec3f direction, float t_min, float t_max) const override {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    RTCRayHit rh;
    set_ray(rh.ray, origin, direction, t_min, t_max);
    rh.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    rh.hit.primID = RTC_INVALID_GEOMETRY_ID;
    rh.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(scene_.get(), &context, &rh);
    return make_hit(rh.hit.instID[0], rh.hit.geomID, rh.hit.primID, rh.ray.tfar, rh.hit.u, rh.hit.v);
  }

  bool occluded(Vec3f origin, Vec3f direction, float t_min, float t_max) const override {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    RTCRay ray;
    set_ray(ray, origin, direction, t_min, t_max);
    rtcOccluded1(scene_.get(), &context, &ray);
    return ray.tfar < 0.0f;
  }

  void intersect(std::span<const RayQuery> rays, Hit* hits) const override {
    switch (packet_) {
      case 16: return intersect_packets<16, RTCRayHit16>(rays, hits, rtcIntersect16);
      case 8: return intersect_packets<8, RTCRayHit8>(rays, hits, rtcIntersect8);
      default: return Tracer::intersect(rays, hits);
    }
  }

  void occluded(std::span<const RayQuery> rays, unsigned char* blocked) const override {
    switch (packet_) {
      case 16: return occluded_packets<16, RTCRay16>(rays, blocked, rtcOccluded16);
      case 8: return occluded_packets<8, RTCRay8>(rays, blocked, rtcOccluded8);
      default: return Tracer::occluded(rays, blocked);
    }
  }

 private:
  Hit make_hit(unsigned instance, unsigned geometry, unsigned primitive, float t, float u, float v) const {
    Hit hit;
    if (geometry == RTC_INVALID_GEOMETRY_ID) return hit;
    hit.t = t;
    if (instance != RTC_INVALID_GEOMETRY_ID) {
      hit.shape = shape_of_[instance] + static_cast<int>(geometry);
      hit.primitive = static_cast<int>(primitive);
      hit.u = u;
      hit.v = v;
    } else if (geometry == sphere_geometry_) {
      hit.shape = spheres_.shapes[primitive];
      hit.primitive = 0;
    } else {
      hit.shape = shape_of_[geometry];
      hit.primitive = static_cast<int>(primitive);
      hit.u = u;
      hit.v = v;
    }
    return hit;
  }

  template <std::size_t N, typename RayHit, typename Function>
  void intersect_packets(std::span<const RayQuery> rays, Hit* hits, Function trace) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    for (std::size_t first = 0; first < rays.size(); first += N) {
      const std::size_t n = std::min(N, rays.size() - first);
      alignas(64) int valid[N];
      RayHit rh;
      set_packet<N>(rh.ray, valid, rays.subspan(first, n));
      for (std::size_t i = 0; i < N; ++i) rh.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
      for (std::size_t i = 0; i < N; ++i) rh.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
      trace(valid, scene_.get(), &context, &rh);
      for (std::size_t i = 0; i < n; ++i) {
        hits[first + i] =
            make_hit(rh.hit.instID[0][i], rh.hit.geomID[i], rh.hit.primID[i], rh.ray.tfar[i], rh.hit.u[i], rh.hit.v[i]);
      }
    }
  }

  template <std::size_t N, typename Ray, typename Function>
  void occluded_packets(std::span<const RayQuery> rays, unsigned char* blocked, Function trace) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    for (std::size_t first = 0; first < rays.size(); first += N) {
      const std::size_t n = std::min(N, rays.size() - first);
      alignas(64) int valid[N];
      Ray ray;
      set_packet<N>(ray, valid, rays.subspan(first, n));
      trace(valid, scene_.get(), &context, &ray);
      for (std::size_t i = 0; i < n; ++i) blocked[first + i] = ray.tfar[i] < 0.0f ? 1 : 0;
    }
  }

  template <std::size_t N, typename Ray>
  static void set_packet(Ray& ray, int* valid, std::span<const RayQuery> rays) {
    for (std::size_t i = 0; i < N; ++i) {
      const RayQuery& q = rays[i < rays.size() ? i : 0];
      valid[i] = i < rays.size() ? -1 : 0;
      ray.org_x[i] = q.origin.x;
      ray.org_y[i] = q.origin.y;
      ray.org_z[i] = q.origin.z;
      ray.dir_x[i] = q.direction.x;
      ray.dir_y[i] = q.direction.y;
      ray.dir_z[i] = q.direction.z;
      ray.tnear[i] = 0.0f;
      ray.tfar[i] = q.t_max;
      ray.time[i] = 0.0f;
      ray.mask[i] = ~0u;
      ray.id[i] = 0;
      ray.flags[i] = 0;
    }
  }

  static void set_ray(RTCRay& ray, Vec3f o, Vec3f d, float t_min, float t_max) {
    ray.org_x = o.x;
    ray.org_y = o.y;
    ray.org_z = o.z;
    ray.dir_x = d.x;
    ray.dir_y = d.y;
    ray.dir_z = d.z;
    ray.tnear = t_min;
    ray.tfar = t_max;
    ray.time = 0.0f;
    ray.mask = ~0u;
    ray.id = 0;
    ray.flags = 0;
  }

  void add_mesh(RTCScene scene, const TriangleMesh& mesh, unsigned id) const {
    RTCGeometry geometry = rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_TRIANGLE);
    // Embree may read up to 16 bytes at the last vertex, which a shared vector of 12-byte vertices does not have.
    void* vertices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(Vec3f),
                                             mesh.positions.size());
    if (!vertices) fail(RTC_ERROR_OUT_OF_MEMORY, "no memory for vertices");
    std::memcpy(vertices, mesh.positions.data(), mesh.positions.size() * sizeof(Vec3f));
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, mesh.triangles.data(), 0,
                               sizeof(Vec3i), mesh.triangles.size());
    if (mesh.one_sided) {
      rtcSetGeometryIntersectFilterFunction(geometry, pass_from_inside);
      rtcSetGeometryOccludedFilterFunction(geometry, pass_from_inside);
    }
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(scene, geometry, id);
    rtcReleaseGeometry(geometry);
  }

  void set_shape(unsigned geometry, int shape) {
    if (shape_of_.size() <= geometry) shape_of_.resize(geometry + 1, -1);
    shape_of_[geometry] = shape;
  }

  // The shapes from `first` on that have its placement, which are those of one instance; returns the last. Instances of
  // the same meshes share a tree, whose geometries are numbered like the shapes.
  std::size_t add_instance(const Scene& scene, std::size_t first) {
    const int placement = scene.shapes[first].placement;
    std::vector<int> meshes;
    std::size_t i = first;
    for (; i < scene.shapes.size() && scene.shapes[i].placement == placement; ++i)
      meshes.push_back(scene.shapes[i].geometry);
    ScenePtr& group = groups_[meshes];
    if (!group) {
      group.reset(rtcNewScene(device_.get()));
      rtcSetSceneFlags(group.get(), RTC_SCENE_FLAG_ROBUST);
      rtcSetSceneBuildQuality(group.get(), RTC_BUILD_QUALITY_HIGH);
      for (unsigned k = 0; k < meshes.size(); ++k) {
        const TriangleMesh& mesh = scene.meshes[static_cast<std::size_t>(meshes[k])];
        if (!mesh.triangles.empty()) add_mesh(group.get(), mesh, k);
      }
      rtcCommitScene(group.get());
      check();
    }
    RTCGeometry geometry = rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_INSTANCE);
    rtcSetGeometryInstancedScene(geometry, group.get());
    rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_ROW_MAJOR,
                            scene.placements[static_cast<std::size_t>(placement)].to_world);
    rtcCommitGeometry(geometry);
    const unsigned id = geometries_++;
    rtcAttachGeometryByID(scene_.get(), geometry, id);
    set_shape(id, static_cast<int>(first));
    rtcReleaseGeometry(geometry);
    return i - 1;
  }

  void add_spheres() {
    RTCGeometry geometry = rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_USER);
    rtcSetGeometryUserPrimitiveCount(geometry, static_cast<unsigned>(spheres_.shapes.size()));
    rtcSetGeometryUserData(geometry, &spheres_);
    rtcSetGeometryBoundsFunction(
        geometry, [](const RTCBoundsFunctionArguments* args) { set_bounds(args); }, nullptr);
    rtcSetGeometryIntersectFunction(geometry, sphere_intersect);
    rtcSetGeometryOccludedFunction(geometry, sphere_occluded);
    rtcCommitGeometry(geometry);
    sphere_geometry_ = geometries_++;
    rtcAttachGeometryByID(scene_.get(), geometry, sphere_geometry_);
    rtcReleaseGeometry(geometry);
  }

  // What Embree has allocated, or is about to. Refusing ends the build with RTC_ERROR_OUT_OF_MEMORY.
  static bool watch_memory(void* self, ssize_t bytes, bool) {
    auto* tracer = static_cast<EmbreeTracer*>(self);
    const auto total = static_cast<std::uint64_t>(tracer->allocated_.fetch_add(bytes) + bytes);
    return bytes <= 0 || memory_limit() == 0 || tracer->before_ + total <= memory_limit();
  }

  void check() const {
    const RTCError code = rtcGetDeviceError(device_.get());
    if (code != RTC_ERROR_NONE) fail(code, "building the acceleration structure failed");
  }

  std::uint64_t before_ = 0;  // memory in use before anything was built
  std::atomic<ssize_t> allocated_{0};
  DevicePtr device_;
  std::map<std::vector<int>, ScenePtr> groups_;  // meshes of instances -> their tree
  ScenePtr scene_;
  SphereSet spheres_;
  std::vector<int> shape_of_;  // Embree geometry -> shape, of an instance its first
  unsigned geometries_ = 0;    // in the scene
  unsigned sphere_geometry_ = RTC_INVALID_GEOMETRY_ID;
  int packet_ = 1;  // rays that the machine traces at once
};

}  // namespace

std::unique_ptr<Tracer> make_embree_tracer(const Scene& scene, const std::string& device_config) {
  return std::make_unique<EmbreeTracer>(scene, device_config);
}

}  // namespace octrad
