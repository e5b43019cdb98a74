#include "app/view/session.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "app/view/inspect.h"
#include "app/view/points_layer.h"
#include "octrad/base/error.h"
#include "octrad/base/interrupt.h"
#include "octrad/base/json_file.h"
#include "octrad/base/memory_limit.h"
#include "octrad/base/stopwatch.h"
#include "octrad/base/version.h"
#include "octrad/image/encode.h"
#include "octrad/scene/camera_path.h"

namespace octrad::viewer {
namespace {

using namespace std::chrono_literals;

constexpr int kMostJobs = 4;  // pictures that are being saved
constexpr int kMostPathFrames = 20000;
constexpr std::size_t kMostPicks = 32;  // that wait
constexpr auto kBetweenStatus = 250ms;  // of a live training
constexpr auto kAlive = 15s;            // between two signs of life, if nothing else is done meanwhile

}  // namespace

Session::Session(Studio studio, ViewState first, nlohmann::json command, LiveTraining* live)
    : studio_(std::move(studio)),
      command_(std::move(command)),
      a_(studio_),
      b_(studio_),
      live_(live) {
  for (const std::string& name : integrator_names()) {
    const IntegratorInfo& info = *find_integrator(name).info;
    if (!info.needs_model && (!info.denoised || studio_.denoiser)) catalogue_.plain.push_back(name);
  }
  for (const ViewerModel& model : studio_.models) {
    catalogue_.models.push_back({model.file, {}});
    for (const std::string& name : integrator_names(model.field)) {
      if (find_integrator(name).info->needs_model) catalogue_.models.back().integrators.push_back(name);
    }
  }
  catalogue_.layers = {"albedo", "normal", "roughness", "depth"};
  if (live_ != nullptr) catalogue_.layers.emplace_back(kTrainingPoints);
  catalogue_.stored = studio_.stored != nullptr;
  check_side(first.a, catalogue_, false);
  if (first.b) check_side(*first.b, catalogue_, true);
  require_memory_for(first.width, first.height, first.b.has_value());
  wanted_.state = std::move(first);
}

Session::~Session() { stop(); }

void Session::start(WebServer& server) {
  server_ = &server;
  server.start();
  renderer_thread_ = std::thread([this] {
    try {
      render();
    } catch (...) {
      const std::lock_guard lock(mutex_);
      failure_ = std::current_exception();
    }
  });
  worker_ = std::thread([this] { work(); });
}

void Session::stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    jobs_.clear();
  }
  wake_.notify_all();
  work_.notify_all();
  if (renderer_thread_.joinable()) renderer_thread_.join();
  if (worker_.joinable()) worker_.join();
}

void Session::check() const {
  const std::lock_guard lock(mutex_);
  if (failure_) std::rethrow_exception(failure_);
}

// Asked in the middle of a picture. With a live training pictures are made in the thread of run(), which cannot see a
// signal meanwhile.
bool Session::ends() const { return stopping_ || octrad::interrupted(); }

bool Session::run(const std::function<bool()>& interrupted) {
  const auto ended = [&] {
    check();
    return interrupted();
  };
  if (live_ != nullptr) return live_->run(ended);
  while (!ended()) std::this_thread::sleep_for(kBetweenLooks);
  return true;
}

// Sums of films are doubles, twice: the copy before a pass. Then the picture with its layers, and what is shown of it.
void Session::require_memory_for(int width, int height, bool two) const {
  const std::uint64_t bytes = static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height) *
                              (kFilmNumbers * (2 * sizeof(double) + 3 * sizeof(float)) + 16) * (two ? 2 : 1);
  const MemoryScope scope;
  ask_memory(bytes, fmt::format("a picture of {} x {} pixels", width, height));
}

void Session::opened(ClientId client) {
  nlohmann::json hello;
  {
    const std::lock_guard lock(mutex_);
    clients_.push_back(client);
    if (controller_ == 0 && clients_.size() == 1) controller_ = client;
    if (!shown_.a) wanted_.moved = Clock::now();  // something quick first
    const Scene& scene = studio_.scene.scene();
    nlohmann::json sensors = nlohmann::json::array();
    for (const Camera& camera : scene.cameras) sensors.push_back(pose_json(camera));
    nlohmann::json models = nlohmann::json::array();
    for (std::size_t m = 0; m < catalogue_.models.size(); ++m) {
      const ModelInfo& info = studio_.models[m].info;
      models.push_back({{"file", catalogue_.models[m].file},
                        {"integrators", catalogue_.models[m].integrators},
                        {"field", info.config.field},
                        {"step", info.state.step}});
    }
    nlohmann::json summaries = nlohmann::json::object();
    for (const IntegratorInfo& info : integrators()) summaries[info.name] = info.summary;
    const Bounds3f& bounds = scene.bounds;
    hello = {{"type", "hello"},
             {"protocol", kProtocol},
             {"version", kVersion},
             {"you", client},
             {"scene", scene.file},
             {"radius", bounds.empty() ? 1.0f : 0.5f * length(bounds.extent())},
             {"sensors", sensors},
             {"integrators", catalogue_.plain},
             {"summaries", summaries},
             {"models", models},
             {"layers", catalogue_.layers},
             {"stored", nullptr},
             {"command", command_},
             {"training", nullptr},
             {"limits", {{"least_size", kLeastSize}, {"largest_size", kLargestSize}}}};
    if (const auto& stored = studio_.stored) {
      hello["stored"] = {{"width", stored->image.width}, {"height", stored->image.height}};
      if (stored->view.width > 0) hello["stored"]["camera"] = pose_json(stored->view.camera);
    }
    if (live_ != nullptr) {
      hello["training"] = {{"curves", live_->history()}};
      live_->set_watched(true);
    }
    wake_.notify_all();
  }
  server_->send(client, json_text(hello));
  if (live_ != nullptr) {
    server_->send(client, json_text(live_->scene()));
    server_->send(client, json_text(live_->status()));
  }
  tell_state();
}

void Session::closed(ClientId client) {
  {
    const std::lock_guard lock(mutex_);
    std::erase(clients_, client);
    if (controller_ == client) controller_ = clients_.empty() ? 0 : clients_.front();
    if (live_ != nullptr) live_->set_watched(!clients_.empty());
  }
  tell_state();
}

nlohmann::json Session::state_json() const {
  nlohmann::json state = to_json(wanted_.state);
  state["type"] = "state";
  state["controller"] = controller_;
  state["clients"] = clients_.size();
  return state;
}

void Session::tell_state() {
  std::string text;
  {
    const std::lock_guard lock(mutex_);
    text = json_text(state_json());
  }
  server_->broadcast(text);
}

void Session::message(ClientId client, const std::string& text) {
  nlohmann::json message;
  try {
    message = parse_json(text, "message");
    if (!message.is_object() || !message.contains("type") || !message["type"].is_string())
      throw InputError("a message is an object with a \"type\"");
    handle(client, message);
  } catch (const std::exception& error) {
    const bool number = message.is_object() && message.contains("input") && message["input"].is_number_integer();
    server_->send(client, error_text(error.what(), number ? message["input"] : nlohmann::json()));
  }
}

void Session::handle(ClientId client, const nlohmann::json& message) {
  const std::string type = message["type"].get<std::string>();
  if (type == "ack") {
    check_keys(message, {"frame"});
    server_->acknowledge(client, whole_in(message, "frame", 0, 1LL << 50));
  } else if (type == "set") {
    set(client, message);
  } else if (type == "pick") {
    if (live_ == nullptr) return server_->send(client, json_text(pick(message)));
    // The model and the scene may be changing: between two steps.
    const std::lock_guard lock(mutex_);
    if (picks_.size() >= kMostPicks) throw InputError("too many points are asked for at once");
    picks_.emplace_back(client, message);
    wake_.notify_all();
  } else if (type == "path") {
    {
      const std::lock_guard lock(mutex_);
      require_control(client);
    }
    server_->send(client, json_text(path(message)));
  } else if (type == "train" || type == "edit") {
    train(client, message);
  } else if (type == "take" || type == "release") {
    check_keys(message, {});
    {
      const std::lock_guard lock(mutex_);
      if (type == "take" && controller_ != 0 && controller_ != client)
        throw InputError(fmt::format("viewer {} has the controls; they must be released there first", controller_));
      if (type == "release" && controller_ != client) throw InputError("only who has the controls can release them");
      controller_ = type == "take" ? client : 0;
    }
    tell_state();
  } else {
    const std::vector<std::string> types = {"ack", "set", "pick", "path", "take", "release", "train", "edit"};
    throw InputError(fmt::format("unknown type \"{}\"{}", type.substr(0, 40), did_you_mean(type, types)));
  }
}

void Session::set(ClientId client, const nlohmann::json& message) {
  bool only_camera = true;
  for (const auto& [key, value] : message.items())
    only_camera = only_camera && (key == "type" || key == "camera" || key == "input");
  {
    const std::lock_guard lock(mutex_);
    require_control(client);
    ViewState state = apply_set(wanted_.state, message, catalogue_);
    const ViewState& old = wanted_.state;
    const bool moved = message.contains("camera");
    const bool seen_anew = moved || state.width != old.width || state.height != old.height;
    const bool other_a = !(state.a == old.a), film = seen_anew || other_a || state.b != old.b;
    if (state.width != old.width || state.height != old.height || other_a || state.b != old.b)
      require_memory_for(state.width, state.height, state.b.has_value());
    wanted_.state = std::move(state);
    if (live_ != nullptr) live_->set_wants_points(wanted_.state.layer == kTrainingPoints);
    ++wanted_.display;
    if (seen_anew) ++wanted_.view;
    if (film) film_ = ++wanted_.film;
    if (seen_anew || other_a) {  // something quick first, however long the renderer is busy with another picture
      wanted_.moved = Clock::now();
      wanted_.quick = wanted_.film;
    }
    wake_.notify_all();
  }
  if (!only_camera) tell_state();
}

void Session::require_control(ClientId client) const {
  if (controller_ == 0) throw InputError("nobody has the controls: take them first");
  if (client != controller_) throw InputError("another viewer has the controls");
}

void Session::train(ClientId client, const nlohmann::json& message) {
  if (live_ == nullptr) throw InputError("nothing is trained here: octrad train --view, or octrad view --train, does");
  {
    const std::lock_guard lock(mutex_);
    require_control(client);
  }
  if (message["type"] == "train") return live_->command(message);
  try {
    live_->edit(message);
  } catch (const InputError&) {
    server_->send(client, json_text(live_->scene()));  // its page has shown the edit already
    throw;
  }
  server_->broadcast(json_text(live_->scene()));
}

nlohmann::json Session::pick(const nlohmann::json& message) const {
  check_keys(message, {"x", "y", "id", "side"});
  const double x = number_in(message, "x", 0.0, 1.0), y = number_in(message, "y", 0.0, 1.0);
  const long long id = message.contains("id") ? whole_in(message, "id", 0, 1LL << 50) : 0;
  ViewState state;
  Shown shown;
  {
    const std::lock_guard lock(mutex_);
    state = wanted_.state;
    shown = shown_;
  }
  bool second = false;
  if (message.contains("side")) {
    if (message["side"] != "a" && message["side"] != "b") throw InputError("\"side\" must be a or b");
    second = message["side"] == "b" && state.b;
  }
  const int number = second ? state.b->model : state.a.model;
  const ViewerModel* model = studio_.models.empty() ? nullptr : &studio_.models.at(static_cast<std::size_t>(number));
  nlohmann::json out = inspect(studio_, view_of(state, 1.0), x, y, model);
  out["type"] = "pick";
  out["id"] = id;
  out["x"] = x;
  out["y"] = y;
  if (model != nullptr) out["model"] = number;
  out["pixels"] = nlohmann::json::object();
  for (const auto& [name, picture] : {std::pair{"a", shown.a}, std::pair{"b", shown.b}}) {
    if (!picture) continue;
    const Image& image = picture->image;
    const int px = std::min(static_cast<int>(x * image.width), image.width - 1),
              py = std::min(static_cast<int>(y * image.height), image.height - 1);
    const Vec3f rgb = image.rgb(px, py, image.channel("R"));
    out["pixels"][name] = {{"integrator", picture->side.integrator},
                           {"samples", picture->samples},
                           {"pixel", {px, py}},
                           {"radiance", {rgb.x, rgb.y, rgb.z}}};
  }
  return out;
}

nlohmann::json Session::path(const nlohmann::json& message) const {
  nlohmann::json document = message;
  document.erase("type");
  const CameraPath path(document, "path");
  if (path.frames() > kMostPathFrames)
    throw InputError(fmt::format("path: {} frames; the page plays {} at most", path.frames(), kMostPathFrames));
  nlohmann::json frames = nlohmann::json::array();
  // More than a browser shows a second are left out.
  const int step = std::max(1, static_cast<int>(path.fps() / 60.0));
  for (int f = 0; f < path.frames(); f += step) frames.push_back(pose_json(path.camera(f)));
  return {{"type", "path"}, {"fps", path.fps() / step}, {"frames", frames}};
}

void Session::download(const std::string& path, std::function<void(Download)> answer) {
  const auto refuse = [&](int status, const std::string& why) {
    answer({status, "text/plain; charset=utf-8", "", why + "\n"});
  };
  const bool exr = path.ends_with(".exr");
  const bool second = path.starts_with("/picture-b.");
  if (path != "/picture-a.png" && path != "/picture-a.exr" && path != "/picture-b.png" && path != "/picture-b.exr")
    return refuse(404, "there is nothing here");
  const std::lock_guard lock(mutex_);
  const std::shared_ptr<const Picture> picture = finished_[second ? 1 : 0];
  if (!picture)
    return refuse(409, live_ != nullptr
                           ? "there is no picture at full resolution yet; while it trains there is none: pause it"
                           : "there is no picture at full resolution yet");
  if (stopping_ || *saving_ >= kMostJobs) return refuse(503, "too many pictures are asked for at once");
  // Counts until the client has all of it, or is gone.
  ++*saving_;
  std::shared_ptr<void> held(nullptr, [saving = saving_](void*) { --*saving; });
  jobs_.emplace_back([picture, exr, state = wanted_.state, answer = std::move(answer), held = std::move(held)] {
    Download file;
    try {
      if (exr) {
        file = {200, "image/x-exr", "view.exr", encode_exr("view.exr", picture->image)};
      } else {
        ToneMapper tone;
        file = {200, "image/png", "view.png", encode_png(tone.show(picture->image, state))};
      }
    } catch (const std::exception& error) {  // std::bad_alloc, too: a picture must not end a training
      file = {500, "text/plain; charset=utf-8", "", std::string(error.what()) + "\n"};
    }
    file.held = held;
    answer(std::move(file));
  });
  work_.notify_one();
}

// Pictures to be saved, and how a training goes on.
void Session::work() {
  std::string told;
  long long refusals = 0;
  Stopwatch since_alive;
  while (true) {
    std::function<void()> job;
    bool watched = false;
    {
      std::unique_lock lock(mutex_);
      const auto due = [&] { return stopping_ || !jobs_.empty(); };
      work_.wait_for(lock, live_ != nullptr ? kBetweenStatus : kAlive, due);
      if (stopping_) return;
      watched = !clients_.empty();
      if (!jobs_.empty()) {
        job = std::move(jobs_.front());
        jobs_.pop_front();
      }
    }
    if (job) job();
    if (watched && since_alive.seconds() >= std::chrono::duration<double>(kAlive).count()) {
      server_->broadcast(R"({"type":"alive"})");
      since_alive = {};
    }
    if (live_ == nullptr || !watched) continue;
    if (const long long now = live_->refusals(); now != std::exchange(refusals, now))
      server_->broadcast(json_text(live_->scene()));
    if (std::string status = json_text(live_->status()); status != told) {
      told = std::move(status);
      server_->broadcast(told);
    }
  }
}

}  // namespace octrad::viewer
