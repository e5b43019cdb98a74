#include "app/view/live.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>

#include "app/report/vector_json.h"
#include "app/view/protocol.h"
#include "octrad/base/error.h"
#include "octrad/base/join.h"
#include "octrad/base/log.h"
#include "octrad/base/stopwatch.h"
#include "octrad/scene/camera_json.h"

namespace octrad::viewer {
namespace {

using namespace std::chrono_literals;

// Shares of the time that pictures may take: of 100 s of steps 9.5 s more, or as much again while the camera moves.
constexpr double kWatchShare = 0.087, kMoveShare = 0.5;
constexpr double kMostCredit = 0.1;  // seconds: what was not used in a while is not made up for
constexpr double kAlone = 10.0;      // seconds without anybody after which a finished run ends
constexpr std::size_t kMostPoints = 16384, kMostHistory = 1500;
constexpr double kMostFactor = 1e4;

const std::vector<std::string> kCommands = {"start", "pause", "save", "stop"};

#define OCTRAD_NAME(name, Model, transmits) #name,
constexpr const char* kModels[] = {OCTRAD_BSDF_LIST(OCTRAD_NAME)};
#undef OCTRAD_NAME

Vec3f color_in(const nlohmann::json& message, const std::string& key, double most) {
  const std::vector<double> numbers = read_array(message, key, 3, "");
  Vec3f color;
  for (int c = 0; c < 3; ++c) {
    const double v = numbers[static_cast<std::size_t>(c)];
    if (!(v >= 0.0 && v <= most))
      throw InputError(fmt::format("\"{}\" must be three numbers from 0 to {:g}", key, most));
    color[c] = static_cast<float>(v);
  }
  return color;
}

nlohmann::json edit_json(const MaterialEdit& edit) {
  nlohmann::json json = nlohmann::json::object();
  if (edit.color) json["color"] = vector_json(*edit.color);
  if (edit.roughness) json["roughness"] = *edit.roughness;
  return json;
}

}  // namespace

LiveTraining::LiveTraining(PreparedScene& scene, Trainer& trainer, const Options& options)
    : scene_(scene),
      trainer_(trainer),
      options_(options),
      lights_(describe_lights()),
      materials_(describe_materials()),
      state_(options.begin && !trainer.done() ? State::running : State::idle),
      finished_(trainer.done()),
      spacing_(0.2) {
  tell();
}

nlohmann::json LiveTraining::describe_lights() const {
  const Scene& s = scene_.scene();
  const LightsView& view = scene_.lights().view();
  nlohmann::json lights = nlohmann::json::array();
  const auto add = [&](const std::string& name, const std::string& kind, const nlohmann::json& emission) {
    lights.push_back({{"name", name.empty() ? fmt::format("{} {}", kind, lights.size() + 1) : name},
                      {"kind", kind},
                      {"emission", emission},
                      {"factor", {1, 1, 1}}});
  };
  for (int i = 0; i < view.area_count; ++i) {
    const LightRecord& l = view.area[i];
    add(s.shapes[static_cast<std::size_t>(l.shape_index)].id, "area",
        l.texture >= 0 ? nlohmann::json() : vector_json(l.radiance));
  }
  const std::vector<std::string> kinds = {"point", "spot", "directional", "projector"};
  for (const DeltaLight& l : s.delta_lights)
    add("", kinds.at(static_cast<std::size_t>(l.kind)), vector_json(l.intensity));
  if (!s.environments.empty()) add("", "environment", nullptr);
  for (int i = 0; i < scene_.light_count(); ++i)
    lights[static_cast<std::size_t>(i)]["factor"] = vector_json(scene_.light_factor(i));
  return lights;
}

// Those that surfaces have.
nlohmann::json LiveTraining::describe_materials() const {
  const Scene& s = scene_.scene();
  nlohmann::json materials = nlohmann::json::array();
  for (std::size_t i = 0; i < s.materials.size(); ++i) {
    const MaterialRecord& r = scene_.materials().view().records[i];
    const int slot = color_slot(r.constant.type);
    const bool used = std::any_of(s.shapes.begin(), s.shapes.end(), [&](const Shape& shape) {
      return uses_material(s, shape.material, static_cast<int>(i));
    });
    if (!used || (slot < 0 && !has_roughness(r.constant.type))) continue;
    nlohmann::json m = {
        {"material", i}, {"name", s.materials[i].id}, {"model", kModels[static_cast<int>(r.constant.type)]}};
    if (slot >= 0) {
      const bool textured = (r.textured >> slot & 1u) != 0;
      m["color"] = textured
                       ? nlohmann::json()
                       : vector_json(slot == MaterialSlot::reflectance            ? r.constant.reflectance
                                     : slot == MaterialSlot::specular_reflectance ? r.constant.specular_reflectance
                                                                                  : r.constant.specular_transmittance);
    }
    if (has_roughness(r.constant.type)) {
      const bool extra = needs_record(r.constant.type);
      const bool textured = extra ? (r.extra_textured >> ExtraParameter::roughness & 1u) != 0
                                  : (r.textured >> MaterialSlot::alpha_u & 1u) != 0;
      m["roughness"] =
          textured ? nlohmann::json() : nlohmann::json(extra ? r.extra[ExtraParameter::roughness] : r.constant.alpha_u);
    }
    m["edit"] = nlohmann::json::object();
    materials.push_back(m);
  }
  return materials;
}

void LiveTraining::set_watched(bool watched) {
  watched_ = watched;
  if (watched) ever_watched_ = true;
}

void LiveTraining::command(const nlohmann::json& message) {
  check_keys(message, {"do"});
  const std::string word = word_in(message, "do", kCommands);
  if (word == "save" && !options_.saves) throw InputError("there is no file to save to: octrad view takes one with -o");
  const std::lock_guard lock(mutex_);
  if (commands_.size() >= 16) throw InputError("too many commands at once");
  commands_.push_back(word);
  asked_ = true;
  wake_.notify_all();
}

// Everything is checked before anything changes.
void LiveTraining::edit(const nlohmann::json& message) {
  check_keys(message, {"lights", "material", "color", "roughness"});
  const std::lock_guard lock(mutex_);
  if (message.contains("lights") == message.contains("material"))
    throw InputError("an edit has either \"lights\" or a \"material\"");
  if (message.contains("lights")) {
    const nlohmann::json& lights = message["lights"];
    if (message.size() != 2 || !lights.is_array() || lights.empty() || lights.size() > lights_.size())
      throw InputError("\"lights\" must be a list of {\"light\", \"factor\"}");
    std::map<int, Vec3f> edits;
    for (const nlohmann::json& light : lights) {
      if (!light.is_object()) throw InputError("\"lights\" must be a list of {\"light\", \"factor\"}");
      check_keys(light, {"light", "factor"});
      edits[static_cast<int>(whole_in(light, "light", 0, static_cast<long long>(lights_.size()) - 1))] =
          color_in(light, "factor", kMostFactor);
    }
    for (const auto& [light, factor] : edits) {
      light_edits_[light] = factor;
      lights_[static_cast<std::size_t>(light)]["factor"] = vector_json(factor);
    }
  } else {
    const auto number = whole_in(message, "material", 0, 1 << 30);
    const auto found =
        std::find_if(materials_.begin(), materials_.end(), [&](const auto& m) { return m["material"] == number; });
    if (found == materials_.end())
      throw InputError(fmt::format("no surface has a material {} that can be changed", number));
    MaterialEdit edit;
    nlohmann::json said = nlohmann::json::object();
    for (const char* key : {"color", "roughness"}) {
      if (!message.contains(key) || message[key].is_null()) continue;
      if (!found->contains(key)) throw InputError(fmt::format("this material has no {}", key));
      said[key] = message[key];
    }
    if (said.contains("color")) edit.color = color_in(message, "color", 1.0);
    if (said.contains("roughness")) edit.roughness = static_cast<float>(number_in(message, "roughness", 0.01, 1.0));
    material_edits_[static_cast<int>(number)] = edit;
    (*found)["edit"] = said;
  }
  asked_ = true;
  wake_.notify_all();
}

nlohmann::json LiveTraining::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

nlohmann::json LiveTraining::history() const {
  const std::lock_guard lock(mutex_);
  return {{"seconds", seconds_}, {"loss", losses_}, {"rate", rates_}, {"mape", mapes_}};
}

nlohmann::json LiveTraining::scene() const {
  const std::lock_guard lock(mutex_);
  return {{"type", "scene"}, {"lights", lights_}, {"materials", materials_}};
}

bool LiveTraining::between_steps(bool moving, const std::function<void()>& work, const std::function<bool()>& give_up) {
  Turn turn{&work, moving};
  std::unique_lock lock(mutex_);
  if (ended_) return false;
  turn_ = &turn;
  asked_ = true;
  wake_.notify_all();
  while (!turn.done) {
    served_.wait_for(lock, 20ms);
    if (turn.done) break;
    const bool waits = turn_ == &turn;
    if (ended_ || (waits && give_up())) {
      if (waits) turn_ = nullptr;
      return false;
    }
  }
  lock.unlock();
  if (turn.error) std::rethrow_exception(turn.error);
  return true;
}

// Pictures may take what their share of the steps' time has left them; while nothing trains, all of it.
void LiveTraining::serve_picture() {
  Turn* turn = nullptr;
  {
    const std::lock_guard lock(mutex_);
    if (turn_ == nullptr || (training_ && credit_ <= 0.0)) return;
    turn = turn_;
    turn_ = nullptr;
  }
  const Stopwatch watch;
  trainer_.untimed([&] {
    try {
      (*turn->work)();
    } catch (...) {
      turn->error = std::current_exception();
    }
  });
  if (training_) credit_ -= watch.seconds();
  const std::lock_guard lock(mutex_);
  turn->done = true;
  served_.notify_all();
}

void LiveTraining::apply_edits() {
  std::map<int, Vec3f> lights;
  std::map<int, MaterialEdit> materials;
  {
    const std::lock_guard lock(mutex_);
    lights.swap(light_edits_);
    materials.swap(material_edits_);
  }
  if (lights.empty() && materials.empty()) return;
  SceneChange all;
  bool changed = false;
  trouble_.clear();
  const auto attempt = [&](const std::function<SceneChange()>& edit) {
    try {
      all += edit();
      changed = true;
    } catch (const InputError& error) {
      trouble_ = error.what();
    }
  };
  trainer_.untimed([&] {
    for (const auto& [light, factor] : lights) {
      if (!(scene_.light_factor(light) == factor))
        attempt([&, light = light, factor = factor] { return scene_.set_light_factor(light, factor); });
    }
    for (const auto& [material, edit] : materials) {
      if (!(scene_.material_edit(material) == edit))
        attempt([&, material = material, &edit = edit] { return scene_.set_material_edit(material, edit); });
    }
  });
  if (!trouble_.empty()) {  // says what holds, where something was refused
    const std::lock_guard lock(mutex_);
    for (const auto& [light, factor] : lights) {
      if (light_edits_.count(light) == 0)  // else it was said again
        lights_[static_cast<std::size_t>(light)]["factor"] = vector_json(scene_.light_factor(light));
    }
    for (nlohmann::json& m : materials_) {
      const int material = m["material"].get<int>();
      if (materials.count(material) && material_edits_.count(material) == 0)
        m["edit"] = edit_json(scene_.material_edit(material));
    }
    ++refusals_;
  }
  if (!changed) return;
  if (state_ == State::stopped) state_ = State::idle;  // which learns it
  trainer_.scene_changed(all);
  ++scene_number_;
  ++field_number_;
}

void LiveTraining::take_commands() {
  std::vector<std::string> commands;
  {
    const std::lock_guard lock(mutex_);
    commands.swap(commands_);
  }
  for (const std::string& word : commands) {
    if (word == "start") state_ = State::running;
    if (word == "pause" && state_ != State::stopped) state_ = State::paused;
    if (word == "stop") state_ = State::stopped;
    if (word == "save" || (word == "stop" && options_.saves)) save();
  }
}

void LiveTraining::save() {
  try {
    trainer_.untimed([&] { trainer_.checkpoint(true); });
  } catch (const IoError& error) {
    log_warning(error.what());
  }
}

void LiveTraining::note_step() {
  ++field_number_;
  if (watched_ && wants_points_) {
    for (const SurfacePoint& p : trainer_.last_points()) {
      if (points_.size() < kMostPoints) points_.push_back(p.x);
      else points_[next_point_++ % kMostPoints] = p.x;
    }
  }
  const TrainProgress p = trainer_.progress();
  if (p.loss < 0.0 || (!seconds_.empty() && p.seconds < seconds_.back() + spacing_)) return;
  const std::lock_guard lock(mutex_);
  seconds_.push_back(p.seconds);
  losses_.push_back(p.loss);
  rates_.push_back(p.rate_scale);
  mapes_.push_back(p.validation_mape);
  if (seconds_.size() < kMostHistory) return;
  for (std::vector<double>* curve : {&seconds_, &losses_, &rates_, &mapes_}) {
    for (std::size_t i = 0; 2 * i < curve->size(); ++i) (*curve)[i] = (*curve)[2 * i];
    curve->resize((curve->size() + 1) / 2);
  }
  spacing_ *= 2.0;
}

void LiveTraining::tell() {
  const TrainProgress p = trainer_.progress();
  const Config& config = trainer_.config();
  const long long saved = trainer_.saved_step();
  static const char* const kNames[] = {"idle", "running", "paused", "stopped"};
  nlohmann::json status = {
      {"type", "training"},
      {"state", kNames[static_cast<int>(state_)]},
      {"finished", finished_},
      {"step", p.step},
      {"steps", p.steps},
      {"seconds", p.seconds},
      {"budget", config.train_steps > 0 ? 0.0 : config.train_seconds},
      {"fraction", p.fraction},
      {"loss", p.loss},
      {"rate", p.rate_scale},
      {"mape", p.validation_mape},
      {"points_per_s", p.points_per_second},
      {"queries_per_s", p.queries_per_second},
      {"change", static_cast<double>(trainer_.change_steps_left()) / static_cast<double>(Trainer::kChangeSteps)},
      {"saved", saved < 0 ? nlohmann::json() : nlohmann::json(saved)},
      {"saves", options_.saves},
      {"ends", options_.ends},
      {"share", share_},
      {"error", trainer_.not_saved().empty() ? trouble_ : trainer_.not_saved()}};
  const std::lock_guard lock(mutex_);
  status_ = std::move(status);
}

bool LiveTraining::run(const std::function<bool()>& interrupted) {
  struct Ending {
    LiveTraining& live;
    ~Ending() {
      live.training_ = false;
      const std::lock_guard lock(live.mutex_);
      live.ended_ = true;
      live.served_.notify_all();
    }
  } const ending{*this};
  Stopwatch since_told, alone, lap;
  double pictures = 0.0;
  bool cut = false;
  while (true) {
    if (interrupted()) {
      cut = true;
      break;
    }
    if (asked_.exchange(false)) {
      take_commands();
      apply_edits();
    }
    if (state_ == State::running && !finished_ && trainer_.done()) {
      finished_ = true;
      state_ = State::idle;
      if (options_.saves) save();
    }
    training_ = !trainer_.is_dark() &&
                (state_ == State::running || (state_ == State::idle && trainer_.change_steps_left() > 0));
    if (watched_) alone = {};
    const bool over = state_ == State::stopped || (state_ == State::idle && !training_);
    if (options_.ends && over && !watched_ && (alone.seconds() > kAlone || !ever_watched_)) break;
    {
      const double before = credit_;
      serve_picture();
      pictures += before - credit_;
    }
    if (training_) {
      const Stopwatch watch;
      trainer_.step();
      const bool moving = [&] {
        const std::lock_guard lock(mutex_);
        return turn_ != nullptr && turn_->moving;
      }();
      const double share = moving ? kMoveShare : kWatchShare;
      credit_ = std::min(kMostCredit, credit_ + watch.seconds() * share / (1.0 - share));
      note_step();
    } else {
      credit_ = 0.0;
      trainer_.untimed([this] {
        std::unique_lock lock(mutex_);
        if (turn_ == nullptr && !asked_) wake_.wait_for(lock, 50ms);
      });
    }
    if (since_told.seconds() > 0.1) {
      share_ = pictures / std::max(1e-9, lap.seconds());
      if (lap.seconds() > 2.0) {
        lap = {};
        pictures = 0.0;
      }
      tell();
      since_told = {};
    }
  }
  return cut || !finished_;
}

}  // namespace octrad::viewer
