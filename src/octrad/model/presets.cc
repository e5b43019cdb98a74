// What the presets set: each is the configuration of `cpu`, the values of Config itself, with changes.
#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "octrad/base/error.h"
#include "octrad/base/join.h"
#include "octrad/model/config.h"

namespace octrad {
namespace {

constexpr const char* kPresets[] = {"paper", "default", "cpu"};

}  // namespace

std::vector<std::string> preset_names() { return {std::begin(kPresets), std::end(kPresets)}; }

Config preset(const std::string& name) {
  if (std::find(std::begin(kPresets), std::end(kPresets), name) == std::end(kPresets)) {
    throw UsageError(fmt::format("unknown preset \"{}\"{}; there are {}", name, did_you_mean(name, preset_names()),
                                 join(preset_names())));
  }
  Config c;
  c.preset = name;
  if (name == "cpu") return c;
  // Full size (method sections 3, 5 and 7).
  c.octree_levels = 8;
  c.disparity_log2_table = 19;
  c.train_steps = 20000;
  c.train_points = 65536;
  c.train_first_points = 8192;
  c.train_directions = 32;
  c.train_area_falls = false;
  c.train_far_ends = 0.0;
  c.nr_width = 256;
  c.ncr_width = 128;
  c.ncr_rays_train = 128;
  c.adam_rate_budget = 0;
  if (name == "default") return c;
  // The paper, and the constants behind its tables.
  c.train_first_points = 0;
  c.train_quarters = true;
  c.adam_beta2 = 0.999;
  c.octree_box = OctreeBox::axis;
  c.octree_bounds = "scene";
  c.lookup_rough_threshold = 0.5;
  c.lookup_rough_offset = true;
  c.lookup_offset = LookupOffset::predicted;
  c.lookup_reflected = Reflected::none;
  c.octree_occupancy = OctreeOccupancy::sampled;
  c.disparity_direction = false;
  c.disparity_unit = DisparityUnit::world;
  c.decoder_output = Activation::squareplus;
  c.decoder_position = DecoderPosition::world;
  c.nr_output = Activation::abs;
  c.ncr_output = Activation::squareplus;
  c.target_emission = TargetEmission::inside;
  c.target_demodulate = TargetDemodulation::none;
  c.target_scale = 1.0;
  c.train_sampler = TrainSampler::walks;
  c.train_poses = 64;
  c.train_fresh_direction = FreshDirection::cosine;
  c.train_glossy_boost = 1.0;
  c.train_stop_probability = 0.3;
  c.train_walks = 1.0;
  c.train_average = 0.0;
  c.train_guide = 0.0;
  c.loss_normalizer = LossNormalizer::symmetric;
  c.loss_power = 2.0;
  c.loss_epsilon_first = 0.1;
  c.loss_epsilon_last = 0.0125;
  c.render_delta = DeltaSurfaces::cache;
  c.render_trace_below = 0.0;
  c.render_coat_samples = 0.0;
  c.render_metal_samples = 0.0;
  c.lookup_coats = Coats::joined;
  c.render_highlights = Highlights::cache;
  c.render_offset_spread = 0.0;
  c.adam_mode = AdamMode::dense;  // the published optimiser is plain Adam: untouched entries keep moving along their
                                  // decaying moments
  c.adam_rate_features = c.adam_rate_networks = c.adam_rate_grids = 1e-3;
  c.adam_warmup = 0;
  c.adam_decay_start = 1.0;
  c.adam_decay_to = 1.0;
  return c;
}

}  // namespace octrad
