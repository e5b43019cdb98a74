// A camera that moves through key poses.
#pragma once

#include <array>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "octrad/scene/camera.h"

namespace octrad {

// A curve through points at increasing knots: the non-uniform Catmull-Rom spline by the recursion of Barry and Goldman
// (1988), a cubic between two knots with a continuous first derivative. Before the first and after the last point it
// goes on as its mirror image. Two points give a straight line of constant speed.
using SplinePoint = std::array<double, 10>;
SplinePoint evaluate_spline(const std::vector<SplinePoint>& points, const std::vector<double>& knots, double t);

class CameraPath {
 public:
  // A JSON object with
  //   "keys":   two cameras or more, each as read_cameras() describes them, all or none with a "time" in seconds
  //   "frames": how many, or "duration": in seconds; neither where keys have times
  //   "fps":    frames a second, 24 where absent
  // Without times the knots are centripetal: their distance is the root of that of the poses (Yuksel et al. 2011),
  // where a turn by a radian, or a change of the field of view by one, counts as much as the mean way between two keys.
  // Origin, target, up and field of view are splined, so that a target that all keys share stays in the centre; of a
  // key with "to_world" the target is one unit ahead. Near and far clip, fov_axis and film size are the first key's.
  // Throws IoError, or InputError naming the file and the key; also where the view turns by more than 120 degrees from
  // a key to the next, between which it would be anything.
  explicit CameraPath(const std::string& json_file);
  // The same of parsed JSON; `name` is for messages.
  CameraPath(const nlohmann::json& document, const std::string& name);

  int frames() const { return frames_; }
  double fps() const { return fps_; }
  // The camera of frame 0 ... frames() - 1: the first is the first key, the last the last. Throws InputError where the
  // spline gives no view.
  Camera camera(int frame) const;

 private:
  std::string file_;
  Camera first_;
  std::vector<SplinePoint> points_;  // origin, target, up, field of view
  std::vector<double> knots_;        // seconds, or without a unit
  int frames_ = 0;
  double fps_ = 24.0;
};

}  // namespace octrad
