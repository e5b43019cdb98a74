// Every switch of the method, as one plain struct with a table of dotted keys (config.cc). Presets are functions of it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "octrad/base/follow_rules.h"
#include "octrad/base/lookup_rule.h"
#include "octrad/base/vec.h"
#include "octrad/model/choices.h"

namespace octrad {

// Keys are the field names with '.' for the first '_' (octree_levels is "octree.levels"); groups of related values have
// a second dot ("adam.rate.features", "adam.decay.start", "loss.epsilon.first"). The values here are the preset "cpu".
struct Config {
  std::string preset = "cpu";
  std::string field = "octaoctree";  // octaoctree | nr | ncr

  // Octree and encoding (method sections 2-4).
  int octree_levels = 6;    // K, 1..9
  int octree_fine = 0;      // levels beyond K whose cells hold one feature vector; K + fine <= 9
  int octree_features = 4;  // C per level: 2, 4 or 8
  OctreeBox octree_box = OctreeBox::cube;
  std::string octree_bounds = "auto";  // auto | scene | six numbers
  OctreeOccupancy octree_occupancy = OctreeOccupancy::conservative;
  OctreeInterpolation octree_interpolation = OctreeInterpolation::trilinear;
  OctaInterpolation octa_interpolation = OctaInterpolation::barycentric;
  LookupDirection lookup_direction = LookupDirection::mirror;
  Coats lookup_coats = Coats::split;
  LookupOffset lookup_offset = LookupOffset::traced;
  Reflected lookup_reflected = Reflected::features;
  RoughDirection lookup_rough_direction = RoughDirection::normal;
  double lookup_rough_threshold = 1.0;  // diffuse surfaces alone
  bool lookup_rough_offset = false;

  // Disparity predictor (method section 5).
  int disparity_levels = 6;
  int disparity_features = 2;
  int disparity_log2_table = 17;
  int disparity_base = 32;
  double disparity_scale = 2.0;     // per-level growth of the grid
  bool disparity_direction = true;  // spherical harmonics of w
  int disparity_width = 64;
  int disparity_hidden = 2;
  DisparityUnit disparity_unit = DisparityUnit::extent;

  // Decoder.
  int decoder_width = 128;
  int decoder_hidden = 4;
  Activation decoder_output = Activation::exp;
  DecoderPosition decoder_position = DecoderPosition::normalized;

  // Neural Radiosity (method section 9).
  int nr_levels = 4;
  int nr_features = 8;
  int nr_log2_table = 19;
  int nr_base = 32;
  double nr_scale = 2.0;
  int nr_width = 128;
  int nr_hidden = 4;
  Activation nr_output = Activation::exp;

  // Neural Cone Radiosity (method section 9): diffuse branch, cones, merge; what is traced.
  int ncr_levels = 4;
  int ncr_features = 8;
  int ncr_log2_table = 19;
  int ncr_base = 32;
  double ncr_scale = 2.0;
  int ncr_width = 64;
  int ncr_hidden = 3;
  Activation ncr_output = Activation::exp;
  int ncr_cone_levels = 8;
  int ncr_cone_features = 8;
  int ncr_cone_log2_table = 19;
  int ncr_cone_base = 4;
  double ncr_cone_scale = 2.0;
  int ncr_cone_width = 64;
  int ncr_cone_hidden = 2;
  int ncr_merge_width = 32;
  int ncr_merge_hidden = 1;
  int ncr_rays_train = 64, ncr_rays_render = 32;
  int ncr_clusters = 4;
  int ncr_iterations_train = 10, ncr_iterations_render = 3;
  double ncr_lobe_share = 0.99;
  double ncr_chroma = 0.01;

  // Target (method section 6).
  TargetEmission target_emission = TargetEmission::outside;
  TargetDemodulation target_demodulate = TargetDemodulation::albedo;
  double target_scale = 0.0;  // 0: chosen from the first batches and stored

  // Training (method section 7).
  int train_steps = 0;                // 0: until train_time is over
  double train_seconds = 300.0;       // "train.time"; used when train_steps is 0
  int train_points = 512;             // N, left-hand-side points a step
  int train_first_points = 0;         // at most so many in the first quarter, twice as many in each next; 0: no limit
  int train_directions = 8;           // M, right-hand-side directions a point
  double train_guide = 0.5;           // share of these at rough points that are drawn by what arrived before
  bool train_quarters = false;        // halve N and double M every quarter
  double train_walks = 0.9;           // share of points from camera walks; the rest is area-uniform
  bool train_area_falls = true;       // fewer points by area as the rates fall
  double train_far_ends = 0.3;        // share of points that are ends of the last step's rays, drawn by contribution
  double train_view_share = 0.0;      // share of points on the primary hits of the scene's view
  double train_keep_direction = 0.0;  // share of walk vertices that keep the walk's own wo
  FreshDirection train_fresh_direction = FreshDirection::uniform;
  double train_glossy_boost = 3.0;  // how much likelier a glossy point is taken than a rough one
  double train_stop_probability = 0.6;
  int train_max_walk = 16;
  int train_poses = 0;        // camera poses drawn once; 0: a fresh one for every walk
  std::string train_cameras;  // JSON file with more camera poses
  TrainSampler train_sampler = TrainSampler::mixture;
  int train_max_chain = 16;    // mirrors and the like that a ray passes
  double train_average = 0.1;  // share of the steps whose weights are averaged; 0: none

  // Loss and optimiser.
  LossNormalizer loss_normalizer = LossNormalizer::prediction;
  double loss_power = 1.75;                                     // of the denominator
  double loss_epsilon_first = 0.5, loss_epsilon_last = 0.0625;  // in units of the exposure
  AdamMode adam_mode = AdamMode::touched;
  double adam_beta1 = 0.9, adam_beta2 = 0.99, adam_epsilon = 1e-8;
  double adam_rate_features = 6e-3, adam_rate_networks = 2e-3, adam_rate_grids = 3e-3;
  int adam_rate_budget = 5000;           // steps of a run whose networks' rate is .7 of it; 0: the same in all
  int adam_warmup = 100;                 // steps
  double adam_decay_start = 0.3;         // fraction of the budget from which the rate decays (1: constant)
  double adam_decay_to = 0.02;           // cosine to this share of the rate
  long long adam_max_non_finite = 1000;  // dropped gradients until the run stops

  // Checkpoints and rendering.
  double checkpoint_seconds = 180.0;  // "checkpoint.every"
  DeltaSurfaces render_delta = DeltaSurfaces::trace;
  double render_trace_below = 0.05;      // alpha
  double render_coat_samples = 6400.0;   // times alpha^2: samples of a pixel before coats are followed; 0: never
  double render_metal_samples = 6400.0;  // the same for metals, rough glass and other single lobes
  Highlights render_highlights = Highlights::automatic;
  double render_bounce_below = 0.1;
  double render_offset_spread = 0.6;  // share of the roughness
  long long seed = 0;

  bool operator==(const Config&) const = default;
};

// Whether look-ups also take what their direction leads to.
bool looks_up_reflected(const Config& config);
// lookup.direction, .rough_direction, .rough_threshold and .rough_offset.
LookupRule lookup_rule(const Config& config);

// The box that octree.bounds gives in numbers; none: it is chosen from the scene (train/domain.h).
std::optional<Bounds3f> given_bounds(const Config& config);

// Preset by name: "paper", "default", "cpu" (presets.cc). Throws UsageError with the list.
Config preset(const std::string& name);
std::vector<std::string> preset_names();

// The value of one key as text that set() reads back. Throws UsageError for an unknown key.
std::string get(const Config& config, const std::string& key);

// Sets one key from text ("octree.levels", "6"; durations "3s", "2m", "1h"). Throws UsageError for an unknown key (with
// a suggestion) or a value that is not accepted (saying what is). Setting train.time sets train.steps to 0, so that the
// last of the two decides the budget.
void set(Config& config, const std::string& key, const std::string& value);

// Applies a JSON object, nested or with dotted keys. A "preset" in it replaces the whole configuration first. Throws
// InputError that begins with `where` (the file's name).
void apply(Config& config, const nlohmann::json& object, const std::string& where);

// The resolved configuration as a nested JSON object, durations in seconds; apply() reads it back exactly.
nlohmann::json to_json(const Config& config);
// The keys that such an object of an earlier version does not have.
std::vector<std::string> keys_missing_in(const nlohmann::json& object);

// Levels of the octree: octree.levels and octree.fine. Throws UsageError where these are more than there may be.
int octree_levels(const Config& config);
// Which surfaces rays pass: rays of pictures (render.delta, render.trace_below), and rays of right-hand sides, which
// pass perfect mirrors in any case.
FollowRules first_hit_rules(const Config& config);
FollowRules rhs_rules(const Config& config);
// Whether each lobe of a coated surface is a point of its own (lookup.coats).
bool split_coats(const Config& config);

// What a key has an effect with, where that is not so; empty where it has one. (Fields that do not use a key:
// ignores_key().)
std::string unmet_condition(const Config& config, const std::string& key);

// Every key with its current value and one line of help, grouped as the struct is.
struct ConfigKey {
  std::string key, value, accepted, help;
};
std::vector<ConfigKey> describe(const Config& config);

}  // namespace octrad
