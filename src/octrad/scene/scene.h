// The immutable, index-based scene that everything downstream reads. Built by scene/load.h.
//
// Units: world units for positions, linear Rec. 709 RGB for colours and radiance. Indices are -1 where absent.
#pragma once

#include <string>
#include <vector>

#include "octrad/base/vec.h"
#include "octrad/scene/camera.h"
#include "octrad/scene/delta_light.h"
#include "octrad/scene/material.h"
#include "octrad/scene/measured.h"
#include "octrad/scene/placement.h"
#include "octrad/scene/report.h"
#include "octrad/scene/sphere.h"
#include "octrad/scene/texture.h"

namespace octrad {

// An indexed triangle mesh, in world space where its shapes have no placement. All shapes but spheres become meshes;
// those stay analytic.
struct TriangleMesh {
  std::vector<Vec3f> positions;
  std::vector<Vec3f> normals;    // per vertex, unit, world space; empty: face normals
  std::vector<Vec2f> uvs;        // per vertex; empty: barycentric coordinates as Mitsuba does
  std::vector<Vec3i> triangles;  // vertex indices
  bool flip_normals = false;     // geometric normal is -(p1-p0)x(p2-p0)
  bool one_sided = false;        // rays along (p1-p0)x(p2-p0) pass: they are inside a curve
  bool flat = false;             // normals are those of the faces, so that hit points need not look them up
};

struct Shape {
  enum class Kind { mesh, sphere };
  Kind kind = Kind::mesh;
  int geometry = -1;  // index into Scene::meshes or Scene::spheres
  int material = -1;  // index into Scene::materials
  int emitter = -1;   // index into Scene::area_lights
  std::string id;
  int placement = -1;  // index into Scene::placements, of a mesh in an instance; such shapes emit nothing
};

// Area light over one whole shape, emitting from the side of the geometric normal.
struct AreaLight {
  int shape = -1;
  int radiance = -1;  // texture index (colour, not clamped)
  float sampling_weight = kNoSamplingWeight;
};

// Environment map: latitude-longitude, radiance in `image`, row 0 at the zenith (+Y of its own space), u and
// orientation as in Mitsuba 3's `envmap`. A constant environment is a 1x1 image.
struct Environment {
  int width = 0, height = 0;
  std::vector<Vec3f> pixels;  // [height][width], scale applied
  // Row-major linear part, object -> world. The radiance along a direction d is that of the map along the inverse of d.
  float to_world[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  float sampling_weight = kNoSamplingWeight;
};

struct Film {
  enum class Filter { box, tent, gaussian, mitchell, catmullrom, lanczos };
  int width = 768, height = 576;
  Filter filter = Filter::gaussian;
  // Mitsuba's conventions: box .5, tent: radius, gaussian: 4 stddev, mitchell and catmullrom 2, lanczos: lobes.
  float filter_radius = 0.0f;
  float filter_stddev = 0.5f;
  float filter_b = 1.0f / 3.0f, filter_c = 1.0f / 3.0f;  // mitchell
};

struct Scene {
  std::string file;                      // as given
  std::vector<std::string> other_files;  // that it refers to: meshes, pictures, included scenes
  std::string fingerprint;               // 16 hex digits: hash of geometry, materials, textures and lights
  std::vector<TriangleMesh> meshes;
  std::vector<Sphere> spheres;
  std::vector<Shape> shapes;
  std::vector<Material> materials;  // index 0 is the default material
  std::vector<Texture> textures;
  std::vector<MeasuredMaterial> measured;
  std::vector<Placement> placements;  // of instances
  std::vector<AreaLight> area_lights;
  std::vector<DeltaLight> delta_lights;
  std::vector<Environment> environments;  // none or one
  std::vector<Camera> cameras;            // the scene's sensors, in file order (at least one)
  Film film;                              // of the first sensor
  std::vector<Film> films;                // of each sensor; empty: all have that of the first
  int max_depth = -1;                     // the file's integrator setting, Mitsuba's meaning
  bool hide_emitters = false;             // likewise: cameras do not see emitters (transport/camera_hit_math.h)
  Bounds3f bounds;                        // of all surfaces
  std::vector<std::string> warnings;
  std::vector<std::string> assumed;  // what the file leaves open or means otherwise than Mitsuba 3
  std::vector<SceneIssue> refused;   // what a stand-in was taken for, where that was asked for

  // How likely each emitter is to be picked, relative to the others: area lights, lights without extent, the
  // environment; 1 where the file does not say. Empty where it does not for any.
  std::vector<float> sampling_weights() const {
    std::vector<float> weights;
    for (const AreaLight& l : area_lights) weights.push_back(l.sampling_weight);
    for (const DeltaLight& l : delta_lights) weights.push_back(l.sampling_weight);
    for (const Environment& e : environments) weights.push_back(e.sampling_weight);
    bool given = false;
    for (float& w : weights) {
      given = given || w >= 0.0f;
      if (w < 0.0f) w = 1.0f;
    }
    if (!given) weights.clear();
    return weights;
  }
  const Film& film_of(std::size_t sensor) const { return sensor < films.size() ? films[sensor] : film; }
  // Triangles of all meshes, however many instances share one.
  std::size_t triangle_count() const {
    std::size_t n = 0;
    for (const TriangleMesh& m : meshes) n += m.triangles.size();
    return n;
  }
};

}  // namespace octrad
