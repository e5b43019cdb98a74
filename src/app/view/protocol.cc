#include "app/view/protocol.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "app/report/picture_origin.h"
#include "octrad/base/error.h"
#include "octrad/base/join.h"
#include "octrad/base/json_file.h"
#include "octrad/scene/camera_json.h"

namespace octrad::viewer {
namespace {

const std::vector<std::string> kCurves = {"none", "log1p", "filmic"};

const nlohmann::json& value_of(const nlohmann::json& message, const std::string& key) {
  const auto found = message.find(key);
  if (found == message.end()) throw InputError(fmt::format("\"{}\" is missing", key));
  return *found;
}

bool flag_in(const nlohmann::json& message, const std::string& key) {
  const nlohmann::json& value = value_of(message, key);
  if (!value.is_boolean()) throw InputError(fmt::format("\"{}\" must be true or false", key));
  return value.get<bool>();
}

Side side_of(const nlohmann::json& value, const Side& before, const Catalogue& catalogue, bool second) {
  if (!value.is_object()) throw InputError("a side must be an object such as {\"integrator\": \"lhs\", \"model\": 0}");
  check_keys(value, {"integrator", "model"});
  Side side = before;
  if (value.contains("integrator")) {
    if (!value["integrator"].is_string()) throw InputError("\"integrator\" must be a name");
    side.integrator = value["integrator"].get<std::string>();
  }
  if (value.contains("model"))
    side.model =
        static_cast<int>(whole_in(value, "model", 0, std::max(0, static_cast<int>(catalogue.models.size()) - 1)));
  check_side(side, catalogue, second);
  return side;
}

nlohmann::json side_json(const Side& side) { return {{"integrator", side.integrator}, {"model", side.model}}; }

}  // namespace

void check_keys(const nlohmann::json& message, const std::vector<std::string>& known) {
  for (const auto& [key, value] : message.items()) {
    if (key != "type" && std::find(known.begin(), known.end(), key) == known.end())
      throw InputError(
          fmt::format("unknown key \"{}\"{}; supported: {}", key.substr(0, 40), did_you_mean(key, known), join(known)));
  }
}

std::string word_in(const nlohmann::json& message, const std::string& key, const std::vector<std::string>& known) {
  const nlohmann::json& value = value_of(message, key);
  const std::string word = value.is_string() ? value.get<std::string>() : "";
  if (!value.is_string() || std::find(known.begin(), known.end(), word) == known.end())
    throw InputError(fmt::format("\"{}\" must be one of {}{}", key, join(known), did_you_mean(word, known)));
  return word;
}

double number_in(const nlohmann::json& message, const std::string& key, double lower, double upper) {
  const nlohmann::json& value = value_of(message, key);
  const double number = value.is_number() ? value.get<double>() : std::nan("");
  if (!(number >= lower && number <= upper))
    throw InputError(fmt::format("\"{}\" must be a number from {:g} to {:g}", key, lower, upper));
  return number;
}

long long whole_in(const nlohmann::json& message, const std::string& key, long long lower, long long upper) {
  return whole_number(value_of(message, key), lower, upper, "\"" + key + "\"");
}

void check_side(const Side& side, const Catalogue& catalogue, bool second) {
  std::vector<std::string> names = catalogue.plain;
  if (side.model < static_cast<int>(catalogue.models.size())) {
    const auto& own = catalogue.models[static_cast<std::size_t>(side.model)].integrators;
    names.insert(names.end(), own.begin(), own.end());
  }
  if (second && catalogue.stored) names.emplace_back(kStored);
  if (std::find(names.begin(), names.end(), side.integrator) == names.end())
    throw InputError(fmt::format("no integrator \"{}\" here{}; there are {}", side.integrator.substr(0, 40),
                                 did_you_mean(side.integrator, names), join(names)));
}

void set_pose(ViewState& state, const nlohmann::json& pose) {
  Camera camera = read_camera(pose, "camera: ");
  camera.view(kLargestSize, kLargestSize);  // refuses what would begin too far away
  state.camera = camera;
  state.pose =
      pose.contains("target") && pose.contains("up") ? pose : pose_json(camera);  // the page turns it about "up"
}

// Without what a camera file cannot say: a window of the film, a shifted principal point. Of a camera that is not
// rolled, "up" is the axis of the world about which the page turns it.
nlohmann::json pose_json(const Camera& camera) {
  nlohmann::json pose = report::camera_json(camera);
  pose.erase("window");
  pose.erase("view_height");
  for (const Vec3f axis : {Vec3f{0, 1, 0}, Vec3f{0, 0, 1}, Vec3f{1, 0, 0}}) {
    const float along = dot(camera.up, axis);
    if (std::fabs(dot(camera.right, axis)) > 1e-3f || std::fabs(along) < 0.05f) continue;
    const Vec3f up = along > 0.0f ? axis : -axis;
    pose["up"] = {up.x, up.y, up.z};
    break;
  }
  pose["near_clip"] = camera.near_clip;
  pose["far_clip"] = camera.far_clip;
  return pose;
}

ViewState apply_set(const ViewState& before, const nlohmann::json& message, const Catalogue& catalogue) {
  check_keys(message, {"camera", "input", "width", "height", "a", "b", "errors", "most_error", "full", "layer",
                       "exposure", "curve", "white"});
  ViewState state = before;
  if (message.contains("camera")) set_pose(state, message["camera"]);
  if (message.contains("input")) state.input = whole_in(message, "input", 0, 1LL << 50);
  for (const auto& [key, size] : {std::pair{"width", &state.width}, std::pair{"height", &state.height}}) {
    if (message.contains(key)) *size = static_cast<int>(whole_in(message, key, kLeastSize, kLargestSize));
  }
  if (message.contains("a")) state.a = side_of(message["a"], state.a, catalogue, false);
  if (message.contains("b")) {
    if (message["b"].is_null()) state.b.reset();
    else state.b = side_of(message["b"], state.b.value_or(state.a), catalogue, true);
  }
  if (message.contains("errors")) state.errors = flag_in(message, "errors");
  if (message.contains("most_error")) state.most_error = number_in(message, "most_error", 1e-3, 1e3);
  if (message.contains("full")) state.full = flag_in(message, "full");
  if (message.contains("layer")) {
    std::vector<std::string> layers = catalogue.layers;
    layers.emplace_back();
    state.layer = word_in(message, "layer", layers);
  }
  if (message.contains("exposure"))
    state.mapping.exposure = static_cast<float>(number_in(message, "exposure", -20, 20));
  if (message.contains("curve")) {
    const std::string curve = word_in(message, "curve", kCurves);
    state.mapping.curve =
        static_cast<ToneMapping::Curve>(std::find(kCurves.begin(), kCurves.end(), curve) - kCurves.begin());
  }
  if (message.contains("white")) {
    const std::vector<double> white = read_array(message, "white", 3, "");
    for (int c = 0; c < 3; ++c) {
      const double v = white[static_cast<std::size_t>(c)];
      if (!(v >= 0.01 && v <= 100.0)) throw InputError("\"white\" must be three factors from 0.01 to 100");
      state.white[c] = static_cast<float>(v);
    }
  }
  return state;
}

nlohmann::json to_json(const ViewState& state) {
  return {{"camera", state.pose},
          {"width", state.width},
          {"height", state.height},
          {"a", side_json(state.a)},
          {"b", state.b ? side_json(*state.b) : nlohmann::json()},
          {"errors", state.errors},
          {"most_error", state.most_error},
          {"full", state.full},
          {"layer", state.layer},
          {"exposure", state.mapping.exposure},
          {"curve", kCurves[static_cast<std::size_t>(state.mapping.curve)]},
          {"white", {state.white.x, state.white.y, state.white.z}}};
}

std::string error_text(const std::string& why, const nlohmann::json& input) {
  return json_text({{"type", "error"}, {"message", why.substr(0, 500)}, {"input", input}});
}

std::string frame_bytes(const nlohmann::json& header, const std::vector<std::string>& pictures) {
  const std::string text = header.dump();
  std::size_t size = 4 + text.size();
  for (const std::string& picture : pictures) size += picture.size();
  std::string bytes;
  bytes.reserve(size);
  for (int shift = 0; shift < 32; shift += 8) bytes += static_cast<char>(text.size() >> shift & 255u);
  bytes += text;
  for (const std::string& picture : pictures) bytes += picture;
  return bytes;
}

}  // namespace octrad::viewer
