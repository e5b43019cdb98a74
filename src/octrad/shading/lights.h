// Emitters: area lights, lights without extent and the environment; picking one for next-event estimation.
#pragma once

#include <memory>
#include <span>

#include "octrad/scene/scene.h"
#include "octrad/shading/lights_math.h"

namespace octrad {

class EnvironmentMap;
struct EnvironmentPlaces;

// All emitters of a scene. They are picked by the `sampling_weight` of the scene's file, as in Mitsuba 3; where it has
// none, with equal probability until set_weights(). Mesh lights are sampled uniformly by area (a
// parallelogram that shows one whole picture by that), spheres by the cone they subtend, the environment by its
// radiance until set_environment_places(). The scene must outlive this object.
//
// Meshes with vertex normals emit from the side of the interpolated normal, and densities per area are turned into
// densities per solid angle by its cosine, both as Mitsuba 3 does. The second is exact for flat lights and as good as
// the normals agree with the facets elsewhere (low-polygon bulbs are lit a few per cent brighter than their facets
// would).
class Lights {
 public:
  explicit Lights(const Scene& scene);
  ~Lights();
  // Draws a point on an emitter as seen from `x`.
  LightSample sample(Vec3f x, float u_pick, Vec2f u) const;
  // sample() in three steps, of which each starts to load what the next will read: some hundred cycles should lie
  // between them. `x` may be a little off in the first: where that is another place of the environment's tables, the
  // last step draws again, for densities are those of the place of `x`.
  struct Draw {
    float u_pick = 0.0f;
    Vec2f u;
    bool in_map = false;  // a direction of an environment, from `pick`
    EnvironmentPick pick;
  };
  Draw begin(Vec3f x, float u_pick, Vec2f u) const;
  void go_on(Draw& draw) const;
  LightSample finish(const Draw& draw, Vec3f x) const {
    return draw.in_map && view_.environment.places.place(x) == draw.pick.place
               ? environment_light(view_, view_.environment_pick, sample_cell(view_.environment, draw.pick))
               : sample_light(view_, x, draw.u_pick, draw.u);
  }
  // Radiance leaving a hit emitter towards `wo` (zero on its back) and the density sample() has for it from `x`.
  Vec3f emitted(const SurfaceInteraction& surface, Vec3f wo) const;
  float pdf(Vec3f x, const SurfaceInteraction& surface) const;
  // Environment radiance and density, from `x`, along a unit direction that hit nothing.
  Vec3f environment(Vec3f direction) const;
  float environment_pdf(Vec3f x, Vec3f direction) const;
  Vec3f environment(Vec3f x, Vec3f direction, float& pdf) const;
  bool has_environment() const { return view_.has_environment(); }
  bool empty() const { return view_.count == 0; }
  // Emitters are picked in proportion to `weights` from now on: one for each, in the order of set_factor(), not
  // negative, not all 0. One of weight 0 is never picked.
  void set_weights(std::span<const float> weights);
  // Where from the environment is drawn from now on (EnvironmentMap::set_places()).
  void set_environment_places(const EnvironmentPlaces& places);
  // Null: no environment.
  const EnvironmentMap* environment_map() const;
  // The probability of the emitter that `u_pick` picks.
  float pick(float u_pick) const { return light_pick(view_, pick_light(view_, u_pick)); }
  // Multiplies the emission that the scene gives light `index`: area lights come first, then lights without extent,
  // then the environment. Not while anything else uses this object. Probabilities of picking lights stay.
  void set_factor(int index, Vec3f factor);
  // The tables as lights_math.h reads them; `textures` holds all of the scene, by index.
  const LightsView& view() const { return view_; }

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
  LightsView view_;
};

}  // namespace octrad
