// Rays, scenes and estimators on a device against the CPU, ray by ray and sample by sample. The scenes should be
// prepared with CpuTree::bvh8, so that the CPU traverses the tree that the device traverses.
#pragma once

#include <utility>
#include <vector>

#include "octrad/base/follow_rules.h"
#include "octrad/base/query_rays.h"
#include "octrad/device/array.h"
#include "octrad/device/check.h"
#include "octrad/transport/camera_job.h"
#include "octrad/transport/first_hit_math.h"
#include "octrad/transport/lhs_math.h"
#include "octrad/transport/path_math.h"
#include "octrad/transport/prepared_scene.h"

namespace octrad {

// Errors of estimates that hang on decisions by chance: where rounding decides one differently, an item goes its own
// way. A small share may, but means and counts must agree. Exact on the host stream.
class EstimateErrors {
 public:
  void add(Vec3f found, Vec3f expected);
  // What was counted on both sides: rays, queries.
  void add_counts(unsigned long long found, unsigned long long expected) { counts_.emplace_back(found, expected); }
  // `allowed_share` is that of infinitely many items; few may by chance have more.
  CheckResult result(const Stream& stream, std::string what, double tolerance, double allowed_share);

 private:
  CheckErrors errors_;
  std::size_t items_ = 0;
  double sum_ = 0.0, square_ = 0.0, size_ = 0.0;
  std::vector<std::pair<unsigned long long, unsigned long long>> counts_;
};

// A ray from 0 to t_max as the stream reads it: 32 bytes.
struct alignas(16) DeviceRay {
  Vec3f origin;
  float t_max;
  Vec3f direction;
  float unused;
};

// Rays in the memory of a stream, and their way through the scene's tree: by warps that take new rays (cast.h), or by a
// thread for each ray, which delta chains, the ends of long paths and traced disparities take.
class RayBatch {
 public:
  enum class Traversal { warps, threads };

  RayBatch(Stream& stream, const PreparedScene& scene, std::span<const RayQuery> rays);
  void closest(Traversal traversal, Hit* hits) const;
  void occluded(Traversal traversal, std::uint32_t* blocked) const;

 private:
  Stream* stream_;
  Bvh8View tree_;
  DeviceArray<DeviceRay> rays_;
};

// Rays between surfaces: uniform points, uniform directions, off the surface as everywhere. `finite`: they end
// somewhere within the scene's size.
std::vector<RayQuery> incoherent_rays(const PreparedScene& scene, std::size_t n, bool finite, std::uint64_t seed);
// As training casts them: from points that are seen from another surface, around the normal on the side that is seen,
// denser towards it (by the cosine). Rays that leave a room through the back of its walls would flatter.
std::vector<RayQuery> training_rays(const PreparedScene& scene, std::size_t n, bool finite, std::uint64_t seed);
// Against `other`, or where that is null against the same tree on the CPU.
CheckResult check_closest(Stream& stream, const PreparedScene& scene, std::span<const RayQuery> rays,
                          RayBatch::Traversal traversal, const Tracer* other = nullptr);
CheckResult check_occluded(Stream& stream, const PreparedScene& scene, std::span<const RayQuery> rays,
                           RayBatch::Traversal traversal, const Tracer* other = nullptr);

// Everything that the scene in the stream's memory says about n rays and their ends: hits, geometry, materials, lights
// and samples of all of them, number by number.
CheckResult check_world(Stream& stream, const PreparedScene& scene, std::size_t n, std::uint64_t seed);

// Points of the steps from `first` to the first one of the next group of `group` steps (DeviceLhs::draw).
CheckResult check_left_hand_sides(Stream& stream, const PreparedScene& scene, const LhsOptions& options, std::size_t n,
                                  unsigned long long first, int group, int rounds = -1);

// Clusters of hits (DeviceLobes) of left-hand-side points and of what camera rays see.
CheckResult check_lobes(Stream& stream, const PreparedScene& scene, std::size_t n, const QueryRays& rays,
                        std::uint64_t seed);

// A cache is imitated by a function of the query, some of whose responses are no numbers.
struct RhsCase {
  int directions;
  bool emission_inside, traced_disparity;
  bool keys;           // every point has a random stream of its own
  bool ask;            // false: a black cache
  bool lobes = false;  // queries have rays of the BSDF traced
  float follow_below = kFollowDelta;
  bool split_coats = false;
  bool guided = false;  // by tables of chance, which learn
};
CheckResult check_right_hand_sides(Stream& stream, const PreparedScene& scene, std::span<const RhsCase> cases,
                                   std::size_t n, std::uint64_t seed);

struct FirstHitCase {
  FirstHitOptions options;
  bool traced_disparity;
  bool lobes = false;
};
CheckResult check_first_hits(Stream& stream, const PreparedScene& scene, const CameraJob& job,
                             std::span<const FirstHitCase> cases);

// One recorded run for each of `limits`, replayed for each job. wave_bounces: as in DevicePathTracer.
CheckResult check_paths(Stream& stream, const PreparedScene& scene, std::span<const CameraJob> jobs,
                        std::span<const PathLimits> limits, int wave_bounces);

// All pixels of the scene's first camera, `count` samples each.
CameraJob camera_job(const PreparedScene& scene, int width, int height, int count, std::uint64_t seed);

}  // namespace octrad
