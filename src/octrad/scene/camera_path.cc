#include "octrad/scene/camera_path.h"

#include <algorithm>
#include <cmath>

#include "octrad/base/error.h"
#include "octrad/base/join.h"
#include "octrad/base/json_file.h"
#include "octrad/scene/camera_json.h"

namespace octrad {
namespace {

constexpr int kMaxFrames = 1'000'000;
constexpr double kWidestTurn = 120.0;  // degrees between two keys

Vec3d vector_at(const SplinePoint& p, std::size_t i) { return {p[i], p[i + 1], p[i + 2]}; }

double angle(Vec3d a, Vec3d b) { return std::acos(std::clamp(dot(normalize(a), normalize(b)), -1.0, 1.0)); }

SplinePoint mix(const SplinePoint& a, const SplinePoint& b, double ta, double tb, double t) {
  SplinePoint out;
  const double w = (t - ta) / (tb - ta);
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = (1.0 - w) * a[i] + w * b[i];
  return out;
}

SplinePoint spline_point(const Camera& camera, const nlohmann::json& key, const std::string& where) {
  Vec3d origin(camera.origin), target = origin + Vec3d(camera.forward), up(camera.up);
  if (key.contains("target")) {  // in full precision
    const std::vector<double> o = read_array(key, "origin", 3, where), at = read_array(key, "target", 3, where);
    origin = {o[0], o[1], o[2]};
    target = {at[0], at[1], at[2]};
  }
  return {origin.x, origin.y, origin.z, target.x, target.y,
          target.z, up.x,     up.y,     up.z,     static_cast<double>(camera.fov_degrees)};
}

// Distances of poses, each from the one before, and their knots.
std::vector<double> centripetal_knots(const std::vector<SplinePoint>& points) {
  double way = 0.0;
  int moves = 0;
  for (std::size_t i = 1; i < points.size(); ++i) {
    const double d = length(vector_at(points[i], 0) - vector_at(points[i - 1], 0));
    way += d;
    moves += d > 0.0 ? 1 : 0;
  }
  const double unit = moves > 0 ? way / moves : 1.0;
  std::vector<double> knots = {0.0};
  for (std::size_t i = 1; i < points.size(); ++i) {
    const SplinePoint &a = points[i - 1], &b = points[i];
    const double turn = angle(vector_at(a, 3) - vector_at(a, 0), vector_at(b, 3) - vector_at(b, 0)) +
                        angle(vector_at(a, 6), vector_at(b, 6)) + std::fabs(a[9] - b[9]) * kPi / 180.0;
    const double distance = length(vector_at(b, 0) - vector_at(a, 0)) / unit + turn;
    knots.push_back(knots.back() + std::sqrt(std::max(distance, 1e-6)));  // equal keys: a moment
  }
  return knots;
}

}  // namespace

SplinePoint evaluate_spline(const std::vector<SplinePoint>& points, const std::vector<double>& knots, double t) {
  const std::size_t n = points.size();
  if (n == 1) return points.front();
  const auto after = static_cast<std::size_t>(std::upper_bound(knots.begin(), knots.end(), t) - knots.begin());
  const std::size_t i = std::clamp<std::size_t>(after, 1, n - 1) - 1;  // between the knots i and i + 1
  const SplinePoint &p1 = points[i], &p2 = points[i + 1];
  const double t1 = knots[i], t2 = knots[i + 1];
  const double t0 = i > 0 ? knots[i - 1] : 2.0 * t1 - t2, t3 = i + 2 < n ? knots[i + 2] : 2.0 * t2 - t1;
  const SplinePoint p0 = i > 0 ? points[i - 1] : mix(p1, p2, t1, t2, t0),
                    p3 = i + 2 < n ? points[i + 2] : mix(p1, p2, t1, t2, t3);
  const SplinePoint a1 = mix(p0, p1, t0, t1, t), a2 = mix(p1, p2, t1, t2, t), a3 = mix(p2, p3, t2, t3, t);
  const SplinePoint b1 = mix(a1, a2, t0, t2, t), b2 = mix(a2, a3, t1, t3, t);
  return mix(b1, b2, t1, t2, t);
}

CameraPath::CameraPath(const std::string& json_file) : CameraPath(read_json_file(json_file), json_file) {}

CameraPath::CameraPath(const nlohmann::json& document, const std::string& name) : file_(name) {
  const std::string where = name + ": ";
  if (!document.is_object() || !document.contains("keys") || !document["keys"].is_array() ||
      document["keys"].size() < 2)
    throw InputError(where +
                     "expected an object with \"keys\": a list of two cameras or more, and \"frames\" or \"duration\"");
  const std::vector<std::string> known = {"keys", "frames", "duration", "fps"};
  for (const auto& [key, value] : document.items()) {
    if (std::find(known.begin(), known.end(), key) == known.end())
      throw InputError(where + "unknown key \"" + key + "\"" + did_you_mean(key, known) +
                       "; supported: " + join(known));
  }
  const nlohmann::json& keys = document["keys"];
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const std::string here = where + "key " + std::to_string(i + 1) + ": ";
    nlohmann::json key = keys[i];
    if (key.is_object() && key.contains("time")) {
      const double time = read_number(key, "time", 0.0, -1e9, 1e9, here);
      if (knots_.size() != i) throw InputError(here + "either all keys have a \"time\" or none");
      if (i > 0 && !(time > knots_.back()))
        throw InputError(here + "\"time\" must be later than that of the key before");
      knots_.push_back(time);
      key.erase("time");
    } else if (!knots_.empty()) {
      throw InputError(here + "either all keys have a \"time\" or none");
    }
    const Camera camera = read_camera(key, here);
    if (i == 0) first_ = camera;
    if (camera.fov_axis != first_.fov_axis) throw InputError(here + "\"fov_axis\" must be that of the first key");
    if (camera.kind != first_.kind) throw InputError(here + "\"type\" must be that of the first key");
    if (camera.mirrored() != first_.mirrored()) throw InputError(here + "all keys are mirrored, or none is");
    points_.push_back(spline_point(camera, key, here));
    if (i == 0) continue;
    const SplinePoint &a = points_[i - 1], &b = points_[i];
    if (angle(vector_at(a, 3) - vector_at(a, 0), vector_at(b, 3) - vector_at(b, 0)) > kWidestTurn * kPi / 180.0)
      throw InputError(here +
                       "the view turns by more than 120 degrees from the key before: put another key between them");
  }
  fps_ = read_number(document, "fps", 24.0, 1e-3, 1e5, where);
  const bool timed = !knots_.empty(), frames = document.contains("frames"), duration = document.contains("duration");
  if (timed ? frames || duration : frames == duration)
    throw InputError(where + (timed ? "the keys have times: \"frames\" and \"duration\" follow from them"
                                    : "needs \"frames\", or \"duration\" (seconds) and \"fps\""));
  if (!timed) knots_ = centripetal_knots(points_);
  double count = read_integer(document, "frames", 0, 1, kMaxFrames, where);
  if (!frames) {
    const double seconds =
        timed ? knots_.back() - knots_.front() : read_number(document, "duration", 0.0, 1e-3, 1e9, where);
    count = std::floor(seconds * fps_ + 1e-6) + 1.0;
  }
  if (count > kMaxFrames) throw InputError(where + "more than " + std::to_string(kMaxFrames) + " frames");
  frames_ = static_cast<int>(count);
}

Camera CameraPath::camera(int frame) const {
  const double share = frames_ > 1 ? static_cast<double>(frame) / (frames_ - 1) : 0.0;
  const SplinePoint p = evaluate_spline(points_, knots_, knots_.front() + share * (knots_.back() - knots_.front()));
  try {
    Camera camera = look_at(Vec3f(vector_at(p, 0)), Vec3f(vector_at(p, 3)), Vec3f(vector_at(p, 6)),
                            static_cast<float>(std::clamp(p[9], 1e-3, 179.0)), first_.fov_axis);
    camera.set_mirrored(first_.mirrored());
    camera.near_clip = first_.near_clip;
    camera.far_clip = first_.far_clip;
    camera.kind = first_.kind;
    camera.aperture_radius = first_.aperture_radius;
    camera.focus_distance = first_.focus_distance;
    camera.half_size = first_.half_size;
    camera.film_width = first_.film_width;
    camera.film_height = first_.film_height;
    return camera;
  } catch (const InputError& error) {
    throw InputError(file_ + ": frame " + std::to_string(frame) + ": " + error.what());
  }
}

}  // namespace octrad
