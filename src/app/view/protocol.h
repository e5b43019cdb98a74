// What the page and the server say to each other, as JSON (docs/viewer.md). Everything is checked before anything
// changes.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "octrad/image/tonemap_math.h"
#include "octrad/render/view.h"

namespace octrad::viewer {

inline constexpr int kProtocol = 1;
inline constexpr int kLeastSize = 16, kLargestSize = 4096;  // pixels of a picture's sides

// Integrator of side b that is a picture from a file.
inline constexpr char kStored[] = "stored";
// Layer that is drawn over the picture, where there is a live training.
inline constexpr char kTrainingPoints[] = "training points";

// What makes a picture: an integrator, and the number of the model that it asks (of no meaning for others).
struct Side {
  std::string integrator;
  int model = 0;
  bool operator==(const Side&) const = default;
};

// Everything that the one in control decides.
struct ViewState {
  Camera camera;
  nlohmann::json pose;  // `camera` as it was said: a file for `render --camera`
  long long input = 0;  // number that came with the camera; frames say the one that they show
  int width = 0, height = 0;
  Side a;
  std::optional<Side> b;  // compared with it
  bool errors = false;    // of `a` against `b`, too
  double most_error = 0.5;
  bool full = false;    // at full resolution also while moving
  std::string layer;    // "": the radiance
  ToneMapping mapping;  // of it
  Vec3f white{1, 1, 1};
};

// What there is to choose from.
struct Catalogue {
  std::vector<std::string> plain;  // integrators without a model
  struct Model {
    std::string file;
    std::vector<std::string> integrators;  // that ask it
  };
  std::vector<Model> models;
  std::vector<std::string> layers;
  bool stored = false;  // there is a picture from a file
};

// Throws InputError, saying what is accepted, for a side (`second`: b) that cannot be shown.
void check_side(const Side& side, const Catalogue& catalogue, bool second);
// Pose and camera of a state. Throws InputError.
void set_pose(ViewState& state, const nlohmann::json& pose);
// A camera as set_pose() takes it, and as `render --camera` does.
nlohmann::json pose_json(const Camera& camera);

// The state after a message {"type": "set", ...}. Throws InputError for anything that is not understood.
ViewState apply_set(const ViewState& state, const nlohmann::json& message, const Catalogue& catalogue);
// The state as {"camera", "width", "height", "a", "b", ...}: what apply_set() takes.
nlohmann::json to_json(const ViewState& state);

// Members of a message beside "type". Throws InputError for others, with a suggestion.
void check_keys(const nlohmann::json& message, const std::vector<std::string>& known);
// Words and numbers, checked.
std::string word_in(const nlohmann::json& message, const std::string& key, const std::vector<std::string>& known);
double number_in(const nlohmann::json& message, const std::string& key, double lower, double upper);
long long whole_in(const nlohmann::json& message, const std::string& key, long long lower, long long upper);

// The message "error". `input`: of the camera that was refused; null: something else was.
std::string error_text(const std::string& why, const nlohmann::json& input = nullptr);

// A binary message: the length of `header` in 4 bytes, the lowest first; header; pictures one after the other.
std::string frame_bytes(const nlohmann::json& header, const std::vector<std::string>& pictures);

}  // namespace octrad::viewer
