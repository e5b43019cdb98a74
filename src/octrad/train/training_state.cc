#include "octrad/train/training_state.h"

#include <utility>

#include "octrad/base/error.h"

namespace octrad {

void store_far_ends(const std::vector<FarEnd>& ends, TrainingState& state) {
  state.far_end_rays.clear();
  state.far_end_hits.clear();
  for (const FarEnd& end : ends) {
    const Vec3f &o = end.origin, &d = end.direction;
    state.far_end_rays.push_back({o.x, o.y, o.z, d.x, d.y, d.z, end.hit.t, end.hit.u, end.hit.v});
    state.far_end_hits.push_back({end.hit.shape, end.hit.primitive, static_cast<std::int32_t>(end.lobe)});
  }
}

std::vector<FarEnd> stored_far_ends(const TrainingState& state, const Scene& scene) {
  std::vector<FarEnd> ends;
  for (std::size_t i = 0; i < state.far_end_rays.size(); ++i) {
    const auto& r = state.far_end_rays[i];
    const auto [shape, primitive, lobe] = state.far_end_hits[i];
    ends.push_back(
        {{r[0], r[1], r[2]}, {r[3], r[4], r[5]}, {shape, primitive, r[6], r[7], r[8]}, static_cast<Lobe>(lobe)});
    if (shape < 0) continue;
    std::size_t primitives = 0;
    if (static_cast<std::size_t>(shape) < scene.shapes.size()) {
      const Shape& s = scene.shapes[static_cast<std::size_t>(shape)];
      primitives =
          s.kind == Shape::Kind::sphere ? 1 : scene.meshes[static_cast<std::size_t>(s.geometry)].triangles.size();
    }
    if (primitive < 0 || static_cast<std::size_t>(primitive) >= primitives || lobe < 0 ||
        lobe > static_cast<std::int32_t>(Lobe::base))
      throw InputError("the model's far ends do not lie on this scene: it is broken or belongs to another scene");
  }
  return ends;
}

void store_guide(GuideState guide, TrainingState& state) {
  const Vec3f &lower = guide.box.lower, &upper = guide.box.upper;
  state.guide_box = {lower.x, lower.y, lower.z, upper.x, upper.y, upper.z, guide.unit};
  state.guide_rows = std::move(guide.rows);
  state.guide_columns = std::move(guide.columns);
  state.guide_means = std::move(guide.means);
  state.guide_squares = std::move(guide.squares);
  state.guide_bsdf_squares = std::move(guide.bsdf_squares);
  state.guide_targets = std::move(guide.targets);
  state.guide_samples = std::move(guide.samples);
}

GuideState stored_guide(const TrainingState& state) {
  const auto& b = state.guide_box;
  GuideState guide{{{b[0], b[1], b[2]}, {b[3], b[4], b[5]}},
                   b[6],
                   state.guide_rows,
                   state.guide_columns,
                   state.guide_means,
                   state.guide_squares,
                   state.guide_bsdf_squares,
                   state.guide_targets,
                   state.guide_samples};
  if (!guide.valid()) throw InputError("the model's guide (train.guide) is broken");
  return guide;
}

}  // namespace octrad
