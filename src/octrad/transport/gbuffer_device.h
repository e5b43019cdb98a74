// What the samples of a picture see first, on a Stream: queries for a radiance field, and where asked for points to
// estimate the right-hand side at; afterwards the responses are added up (render/cache_integrators.cc does the same on
// the CPU).
#pragma once

#include "octrad/base/query_rays.h"
#include "octrad/base/surface_point.h"
#include "octrad/shading/device_world.h"
#include "octrad/transport/camera_job.h"
#include "octrad/transport/device_memory.h"
#include "octrad/transport/first_hit_math.h"
#include "octrad/transport/lobes_device.h"

namespace octrad {

// Everything is allocated by the constructor; run() and add() can be recorded.
class DeviceGBuffer {
 public:
  // For jobs of up to `capacity` samples. `bounces`: whether there will be right-hand-side points; `rays`: what is
  // traced from the queries; `split_coats`: whether a sample may have two queries (FirstHitOptions::split_coats).
  DeviceGBuffer(Stream& stream, const DeviceWorld& world, std::size_t capacity, bool bounces = false,
                const QueryRays& rays = {}, bool split_coats = false);

  // What the next run() sees; not while the stream records.
  void set(const CameraJob& job);
  // Traces the job's samples; a recorded run serves jobs of at most `samples` samples (0: the capacity).
  void run(const FirstHitOptions& options, std::size_t samples = 0);
  const CameraJob* job() const { return job_.data(); }

  SurfacePointArray queries() const {
    SurfacePointArray queries = queries_.points(query_rays_.offset);
    queries.lobe = lobes_.clusters();
    return queries;
  }
  const std::uint32_t* query_count() const { return sizes_.data() + kQueries; }
  const std::uint32_t* query_owners() const { return query_owner_.data(); }  // samples
  const ShadingPoint* bounce_points() const { return bounce_points_.data(); }
  const unsigned long long* bounce_keys() const { return bounce_keys_.data(); }  // of their samples
  const std::uint32_t* bounce_count() const { return sizes_.data() + kBounces; }

  // Adds the field's responses to the queries, and the right-hand sides of the bounce points (null: none), to the
  // samples. `samples` as for run().
  void add(const Vec3f* responses, const Vec3f* right_hand_sides, std::size_t samples = 0);
  // Emission known without the field, then complete radiance; attributes of the first hit.
  SamplePlanes samples() const { return {samples_.planes()}; }

  TraceCounts take_counts();  // since the last call
  std::size_t capacity() const { return capacity_; }
  // Most queries of so many samples.
  std::size_t queries_of(std::size_t samples) const { return split_ ? 2 * samples : samples; }
  static std::size_t bytes(std::size_t capacity, bool bounces, const QueryRays& rays, bool split_coats = false);

 private:
  enum { kChains, kFollowed, kQueries, kBounces, kTaken, kSizes };

  Stream* stream_;
  DeviceWorld world_;
  std::size_t capacity_;
  QueryRays query_rays_;
  bool split_;
  DeviceArray<CameraJob> job_;
  DeviceArray<TraceCounts> counts_;
  DeviceArray<std::uint32_t> sizes_, chains_, followed_, query_owner_, bounce_owner_;
  DeviceArray<Hit> hits_;
  DeviceArray<ShadingPoint> bounce_points_;
  DeviceArray<unsigned long long> bounce_keys_;
  PlaneArray samples_, queries_, query_weight_, bounce_weight_, normals_;
  DeviceLobes lobes_;
};

}  // namespace octrad
