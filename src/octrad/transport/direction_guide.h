// The tables of transport/direction_guide_math.h on the computer's side: for training on the CPU, and as the state of
// any training.
#pragma once

#include <vector>

#include "octrad/transport/direction_guide_math.h"

namespace octrad {

class LhsSampler;

// All that a guide knows.
struct GuideState {
  Bounds3f box;       // divided into places
  float unit = 1.0f;  // as in GuideView, and all that follows; all empty: no guide
  std::vector<float> rows, columns, means;
  std::vector<unsigned long long> squares, bsdf_squares, targets, samples;

  bool empty() const { return rows.empty(); }
  // Whether this is a guide: sizes, and probabilities that are some.
  bool valid() const;
  // Over it; `share`: train.guide. The state must outlive the view, which learns.
  GuideView view(float share);
};

// One that knows nothing yet. `unit`: of radiance, above 0.
GuideState make_guide(const Bounds3f& box, float unit);
// Its box: of what the sampler draws.
Bounds3f guide_box(const LhsSampler& sampler);

// make_guide_table() for all tables. Parallel.
void make_guide_tables(const GuideView& guides);

}  // namespace octrad
