// The .octrad model file: a field's tensors with its configuration and the scene it belongs to (docs/formats.md).
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "octrad/model/config.h"
#include "octrad/model/radiance_field.h"

namespace octrad {

// Progress of a training run; with the optimiser's state it is all that resuming needs, because every random number is
// a function of seed and step.
struct TrainingState {
  long long step = 0;
  double seconds = 0.0;  // of training so far
  long long lhs_samples = 0, rhs_queries = 0;
  double loss = -1.0;   // smoothed (train/schedule.h); below 0 before the first step
  std::string sensors;  // sensors_fingerprint() of what walks start from; empty: not known
  // Of the configuration: the run began before there were such keys, and they mean what was done then.
  std::vector<std::string> newer_keys;
  bool has_other_sensors(const std::string& fingerprint) const { return !sensors.empty() && sensors != fingerprint; }
  // Points of the next step (train.far_ends), kept with the optimiser's state: origin, direction, t, u and v of each
  // ray; shape and primitive that it hit, -1 for no point, and the lobe (Lobe as a number).
  std::vector<std::array<float, 9>> far_end_rays;
  std::vector<std::array<std::int32_t, 3>> far_end_hits;
  // What directions are drawn by (train.guide), likewise: transport/direction_guide.h. Empty: nothing.
  std::array<float, 7> guide_box{};  // and the unit of radiance
  std::vector<float> guide_rows, guide_columns, guide_means;
  std::vector<unsigned long long> guide_squares, guide_bsdf_squares, guide_targets, guide_samples;
};

struct ModelInfo {
  Config config;  // resolved
  std::string scene_file;
  std::string scene_fingerprint;
  std::string program;  // version that wrote it
  TrainingState state;
};

struct Model {
  ModelInfo info;
  std::unique_ptr<RadianceField> field;
  bool has_optimizer = false;
  // Loaded to be trained on, and `field` holds averages of weights (train.average): the field that steps move, with the
  // optimiser's state. Null otherwise: they move `field`.
  std::unique_ptr<RadianceField> trained = {};
};

// `trained`: as Model::trained; written with the optimiser's state only, which needs it where train.average is above 0
// (InputError). Atomic: an interrupted or failed write leaves the old file. Throws IoError.
void save_model(const std::string& file, RadianceField& field, const ModelInfo& info, bool optimizer,
                RadianceField* trained = nullptr);

// `optimizer`: to be trained on. Throws IoError, or InputError for a file that is no model, broken, or of another
// format version.
Model load_model(const std::string& file, bool optimizer = false);

// Bytes of a file's tensors; the header adds little.
struct ModelFileSize {
  double total = 0.0;
  double features = 0.0;   // of it, what look-ups read: tables of features
  double optimizer = 0.0;  // of it, what resuming needs: 0 without optimiser
};
ModelFileSize model_file_size(const TensorReader& file);
// The sizes of a file with optimiser state, before anything is allocated. Without the networks, whose size hardly
// counts.
ModelFileSize estimate_model_file_size(const Config& config, const std::vector<long long>& cells_per_level);

// Throws InputError when the model was trained on another scene, unless `force`. `way_out`: what the message ends with.
void check_scene(const std::string& file, const ModelInfo& info, const std::string& scene_file,
                 const std::string& fingerprint, bool force, const char* way_out = "--force uses it all the same");

}  // namespace octrad
