// Cameras: perspective, with a thin lens, orthographic. Mitsuba's convention: camera space looks along +z, +x to the
// left of the picture, +y up.
#pragma once

#include <string>
#include <vector>

#include "octrad/scene/camera_math.h"

namespace octrad {

struct Transform;

struct Camera {
  CameraKind kind = CameraKind::perspective;
  Vec3f origin{0, 0, 0};
  Vec3f right{-1, 0, 0}, up{0, 1, 0}, forward{0, 0, 1};  // unit; `right` points to the right of the picture
  float fov_degrees = 45.0f;                             // along fov_axis
  enum class FovAxis { x, y, diagonal, smaller, larger };
  FovAxis fov_axis = FovAxis::x;
  float near_clip = 0.01f, far_clip = 10000.0f;
  Vec2f principal_point_offset{0, 0};  // in the film's widths and heights, added to the position on it
  // The part of the film that the picture shows, in widths and heights of the whole film, to which the field of view
  // belongs.
  Vec2f crop_offset{0, 0}, crop_size{1, 1};
  float aperture_radius = 0.0f, focus_distance = 0.0f;  // thinlens; the distance is along `forward`
  Vec2f half_size{1, 1};                                // orthographic: of what a square film sees, world units
  int film_width = 0, film_height = 0;                  // of the picture: the part that is shown; 0: not given

  // Whether left and right are exchanged: by a to_world that mirrors, as that of most pbrt scenes.
  bool mirrored() const { return dot(cross(right, up), forward) > 0.0f; }
  void set_mirrored(bool mirror) {
    if (mirror != mirrored()) right = -right;
  }

  // Throws InputError where rays would begin too far away: a near plane far out, or a field of view close to 180
  // degrees.
  CameraView view(int width, int height) const;
  // That of a picture as large as the camera's own film; of one pixel where it has none.
  CameraView own_view() const;
};

// Axes and origin from a transform that rotates, moves and may mirror. Throws InputError for a place that is too far
// away (limits.h).
void set_frame(Camera& camera, const Transform& to_world);

// Camera at `origin` looking at `target`. Throws InputError when the points and `up` define no view, or one too far
// away.
Camera look_at(Vec3f origin, Vec3f target, Vec3f up, float fov_degrees, Camera::FovAxis axis);

// Cameras of a JSON file: one object or a list of objects with
//   {"origin": [x,y,z], "target": [x,y,z], "up": [x,y,z] (default 0,1,0), "fov": degrees, "fov_axis": "x"}   or
//   {"to_world": [16 numbers, row after row], "fov": degrees, ...}
// where "mirrored": true beside "origin" and "target" exchanges left and right, which a "to_world" says by itself,
// and optionally "near_clip", "far_clip", "width", "height" (film size; 0 where absent), "type": "perspective",
// "thinlens" (with "aperture_radius" and "focus_distance") or "orthographic" (with "view_width" instead of "fov").
// Throws IoError, or InputError naming the file and the camera.
std::vector<Camera> read_cameras(const std::string& json_file);

// Size of a picture: the film's; where only one of width and height is given (> 0), the other follows from the film's
// aspect ratio.
Vec2i picture_size(int film_width, int film_height, int width, int height);

// Names of each CameraKind: Mitsuba's plugins.
const std::vector<std::string>& camera_kind_names();

// "x", "y", "diagonal", "smaller", "larger": of each Camera::FovAxis. parse_fov_axis() throws InputError for others.
const std::vector<std::string>& fov_axis_names();
inline const std::string& fov_axis_name(Camera::FovAxis axis) {
  return fov_axis_names().at(static_cast<std::size_t>(axis));
}
Camera::FovAxis parse_fov_axis(const std::string& name);

}  // namespace octrad
