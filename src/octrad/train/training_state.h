// Far ends and the guide of directions as a model file keeps them, between an engine's form and TrainingState.
#pragma once

#include <vector>

#include "octrad/model/model_file.h"
#include "octrad/scene/scene.h"
#include "octrad/transport/direction_guide.h"
#include "octrad/transport/far_ends_math.h"

namespace octrad {

void store_far_ends(const std::vector<FarEnd>& ends, TrainingState& state);
// What a file holds may be anything: throws InputError for what does not lie on the scene.
std::vector<FarEnd> stored_far_ends(const TrainingState& state, const Scene& scene);

void store_guide(GuideState guide, TrainingState& state);
// What a file holds may be anything: throws InputError for what is no guide.
GuideState stored_guide(const TrainingState& state);

}  // namespace octrad
