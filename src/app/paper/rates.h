// How fast this machine is: a short training and small pictures of every scene, from which the cost of a plan follows.
#pragma once

#include <string>
#include <vector>

#include "app/paper/plan.h"
#include "app/paper/store.h"

namespace octrad::paper {

// Per scene, in rates/NAME.json of the store; measured where it is missing, a few seconds each. Fields that this
// program does not have are left out.
struct Rates {
  std::vector<nlohmann::json> scenes;  // of plan.scenes
};
Rates measure_rates(const Store& store, const Plan& plan, const std::vector<std::string>& device);

// Estimated seconds.
double reference_cost(const Plan& plan, const Rates& rates, const Reference& reference);
double training_cost(const Plan& plan, const Rates& rates, const Training& training);
double cell_cost(const Plan& plan, const Rates& rates, const Cell& cell);  // without training
double film_cost(const Plan& plan, const Rates& rates, const Film& film);
double temporal_cost(const Plan& plan, const Rates& rates, const Cell& cell);
double plan_cost(const Plan& plan, const Rates& rates);  // everything

// Frames that are timed for a picture: the median of three, but one where a frame takes seconds.
inline int timed_frames(const View& view, int spp) {
  return static_cast<double>(view.width) * view.height * spp > 5e5 ? 1 : 3;
}

}  // namespace octrad::paper
