#include "app/view/session.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "app/view/inspect.h"
#include "app/view/points_layer.h"
#include "octrad/base/bytes.h"
#include "octrad/base/error.h"
#include "octrad/base/json_file.h"
#include "octrad/base/log.h"
#include "octrad/base/memory_limit.h"
#include "octrad/base/stopwatch.h"
#include "octrad/base/version.h"
#include "octrad/image/encode.h"
#include "octrad/image/metrics.h"
#include "octrad/image/tonemap.h"
#include "octrad/scene/camera_path.h"

namespace octrad::viewer {
namespace {

using namespace std::chrono_literals;

constexpr double kFrameSeconds = 0.05;                  // of a frame while moving
constexpr auto kStill = 150ms;                          // without a new camera: the picture refines
constexpr auto kBetweenFrames = 100ms;                  // of pictures that refine
constexpr int kMovingQuality = 80, kStillQuality = 92;  // of JPEG
constexpr int kLeastWidth = 96;                         // of a moving picture
constexpr std::size_t kMostJobs = 4;
constexpr int kMostPathFrames = 20000;
constexpr std::size_t kMostPicks = 32;                        // that wait
constexpr auto kBetweenLooks = 50ms, kBetweenStatus = 250ms;  // at a live training
constexpr auto kAlive = 15s;  // between two signs of life, if nothing else is done meanwhile

// `input`: of the camera that was refused; null: something else was.
std::string error_text(const std::string& why, const nlohmann::json& input = nullptr) {
  return json_text({{"type", "error"}, {"message", why.substr(0, 500)}, {"input", input}});
}

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
    if (seen_anew || other_a) wanted_.moved = Clock::now();  // something quick first
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
  live_->edit(message);
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
  if (stopping_ || jobs_.size() >= kMostJobs) return refuse(503, "too many pictures are asked for at once");
  jobs_.emplace_back([picture, exr, state = wanted_.state, answer = std::move(answer)] {
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

View Session::view_of(const ViewState& state, double scale) const {
  View view;
  view.camera = state.camera;
  view.width = std::max(1, static_cast<int>(std::lround(state.width * scale)));
  view.height = std::max(1, static_cast<int>(std::lround(state.height * scale)));
  return view;
}

// Size of a picture that must not take long, as a share of the state's.
double Session::quick_scale(const ViewState& state) {
  if (state.full) return 1.0;
  const double pixels = static_cast<double>(state.width) * state.height;
  const double fits = seconds_per_pixel_ > 0.0 ? kFrameSeconds / seconds_per_pixel_ : 25000.0;
  double scale =
      std::clamp(std::sqrt(fits / pixels), std::min(1.0, static_cast<double>(kLeastWidth) / state.width), 1.0);
  // Small changes of the rate leave the size as it is.
  if (scale_ > 0.0 && std::fabs(scale / scale_ - 1.0) < 0.12) scale = scale_;
  return scale_ = scale;
}

void Session::took(double seconds, const View& view) {
  const double now = seconds / (static_cast<double>(view.width) * view.height);
  seconds_per_pixel_ = seconds_per_pixel_ > 0.0 ? 0.7 * seconds_per_pixel_ + 0.3 * now : now;
}

Session::FilmKey Session::film_key(const Wanted& wanted, const Side& side, const View& view) const {
  FilmKey key{wanted.view, 0, 0, view.width, view.height, side};
  if (live_ == nullptr) return key;
  key.scene = live_->scene_number();
  const ViewerModel* model = studio_.model_of(side);
  if (model != nullptr && model->trainer != nullptr) key.field = live_->field_number();
  return key;
}

// Samples of the sides: the first of those whose film is another one, and with `more` the next of those whose film is
// the same, so that what one side has is kept when the other changes. False where `stop` said so.
bool Session::sample(const Wanted& wanted, const View& view, bool more, const Stop& stop) {
  const auto add = [&](SideRenderer& renderer, std::optional<FilmKey>& film, const Side& side, long long& scene) {
    const FilmKey key = film_key(wanted, side, view);
    if (std::exchange(scene, key.scene) != key.scene) renderer.scene_changed();
    if (film == key) return !more || renderer.finished() || renderer.add_pass(stop);
    film.reset();
    renderer.show(side, view);
    if (!renderer.add_pass(stop)) return false;
    film = key;
    return true;
  };
  return add(a_, a_film_, wanted.state.a, a_scene_) && (!wanted.state.b || add(b_, b_film_, *wanted.state.b, b_scene_));
}

// Whether the films show the model and the scene as they are.
bool Session::is_current(const Wanted& wanted) const {
  const auto same = [&](const std::optional<FilmKey>& film, const Side& side) {
    if (!film) return false;
    const FilmKey now = film_key(wanted, side, {{}, film->width, film->height});
    return film->scene == now.scene && film->field == now.field;
  };
  return same(a_film_, wanted.state.a) && (!wanted.state.b || same(b_film_, *wanted.state.b));
}

// Points that were asked for while a training runs. Whether there were any.
bool Session::answer_picks() {
  std::deque<std::pair<ClientId, nlohmann::json>> picks;
  {
    const std::lock_guard lock(mutex_);
    picks.swap(picks_);
  }
  if (picks.empty()) return false;
  live_->between_steps(
      true,
      [&] {
        for (const ViewerModel& model : studio_.models) {
          if (model.trainer != nullptr) model.trainer->field();  // brings it up to date
        }
        for (const auto& [client, message] : picks) {
          try {
            server_->send(client, json_text(pick(message)));
          } catch (const std::exception& error) {
            server_->send(client, error_text(error.what()));
          }
        }
      },
      [this] { return stopping_.load(); });
  return true;
}

// Frames are numbered; the film of a moving picture is of the moment, so that only whole pictures are seen.
void Session::render() {
  std::pair<long long, long long> failed{0, 0};  // film and display that could not be shown
  while (true) {
    Wanted wanted;
    bool moving = false, training = false;
    {
      std::unique_lock lock(mutex_);
      while (true) {
        if (stopping_) return;
        if (!picks_.empty()) break;
        const auto now = Clock::now();
        moving = now - wanted_.moved < kStill;
        training = live_ != nullptr && live_->training();
        const bool other_film = wanted_.film != film_done_;
        if (live_ != nullptr && still_ && !moving && !is_current(wanted_)) still_ = false;
        const bool refines = !a_.finished() || (wanted_.state.b && !b_.finished());
        const bool settles = !moving && !still_ && (!training || refines || !is_current(wanted_));
        const bool work =
            std::pair(wanted_.film, wanted_.display) != failed &&
            (other_film || settles || wanted_.display != display_done_ || (still_ && refines) || unpublished_);
        if (!clients_.empty() && work && (other_film || !moving || wanted_.display != display_done_)) break;
        if (!clients_.empty() && moving) wake_.wait_until(lock, wanted_.moved + kStill);
        else if (!clients_.empty() && live_ != nullptr) wake_.wait_for(lock, kBetweenLooks);
        else wake_.wait(lock);
      }
      wanted = wanted_;
    }
    if (live_ != nullptr && answer_picks()) continue;
    const auto give_up = [&](const std::string& why) {
      failed = {wanted.film, wanted.display};
      still_ = false;
      film_done_ = 0;
      server_->broadcast(error_text(why));
    };
    try {
      if (live_ == nullptr) {
        make_picture(wanted, moving, false);
      } else {
        const bool done = live_->between_steps(
            moving, [&] { make_picture(wanted, moving, training); }, [&] { return changed(wanted.film); });
        if (!done) std::this_thread::sleep_for(5ms);
      }
    } catch (const Error& error) {
      give_up(error.what());
    } catch (const std::bad_alloc&) {
      give_up("out of memory");
    }
  }
}

// The next picture of what is wanted, or more samples of it.
void Session::make_picture(const Wanted& wanted, bool moving, bool training) {
  const ViewState& state = wanted.state;
  const Stop stop = [this, film = wanted.film] { return changed(film); };
  const auto done = [&](bool still) {
    still_ = still;
    film_done_ = wanted.film;
    display_done_ = wanted.display;
    published_ = Clock::now();
    unpublished_ = false;
  };
  if (wanted.film != film_done_ && moving) {
    const Stopwatch watch;
    const View view = view_of(state, quick_scale(state));
    a_film_.reset();
    b_film_.reset();
    if (!sample(wanted, view, false, [this] { return stopping_.load(); })) return;
    a_film_.reset();
    b_film_.reset();
    done(false);
    publish(wanted, true, true);
    took(watch.seconds(), view);
  } else if (wanted.film == film_done_ && moving && !still_) {  // only what is shown of the picture changed
    publish(wanted, true, false);
    display_done_ = wanted.display;
  } else if (training) {
    const View view = view_of(state, quick_scale(state));
    if (!sample(wanted, view, true, stop)) return;
    took(a_.last_sample_seconds() + (state.b ? b_.last_sample_seconds() : 0.0), view);
    done(false);
    publish(wanted, false, true);
  } else if (wanted.film != film_done_ || !still_) {
    if (!sample(wanted, view_of(state, 1.0), false, stop)) {
      still_ = false;
      film_done_ = 0;
      return;
    }
    done(true);
    publish(wanted, false, true);
  } else if (wanted.display != display_done_) {
    done(true);
    publish(wanted, false, true);
  } else {
    const bool first = !a_.finished(), second = state.b && !b_.finished();
    if ((first && !a_.add_pass(stop)) || (second && !b_.add_pass(stop))) {
      still_ = false;  // what comes next is another film
      return;
    }
    unpublished_ = unpublished_ || first || second;
    const bool last = a_.finished() && (!state.b || b_.finished());
    if (unpublished_ && (last || Clock::now() - published_ >= kBetweenFrames)) {
      done(true);
      publish(wanted, false, true);
    }
  }
}

void Session::publish(const Wanted& wanted, bool moving, bool samples_are_new) {
  const ViewState& state = wanted.state;
  Stopwatch watch;
  const auto lap = [&watch] {
    const double ms = 1e3 * watch.seconds();
    watch = {};
    return ms;
  };
  Shown shown;
  const ChannelRange channels = moving ? shown_channels(state) : ChannelRange{};
  if (!samples_are_new) {
    const std::lock_guard lock(mutex_);
    shown = shown_;
    if (!shown.a) return;
  }
  if (samples_are_new || !shown.channels.contains(channels)) {
    shown = {moving ? a_.glance(channels) : a_.picture(), {}, channels};
    if (state.b) shown.b = moving ? b_.glance(channels) : b_.picture();
  }
  const double film_ms = lap();
  std::vector<Image8> pictures = {tone_.show(shown.a->image, state)};
  std::vector<std::string> names = {"a"};
  if (shown.b) {
    pictures.push_back(tone_.show(shown.b->image, state));
    names.emplace_back("b");
    if (state.errors && shown.a->image.width == shown.b->image.width &&
        shown.a->image.height == shown.b->image.height) {
      pictures.push_back(
          false_color(error_image(shown.b->image, shown.a->image), 0, 0.0f, static_cast<float>(state.most_error)));
      names.emplace_back("errors");
    }
  }
  if (state.layer == kTrainingPoints)
    pictures[0] = draw_points(std::move(pictures[0]), shown.a->image, shown.a->view, live_->points());
  const double tone_ms = lap();
  std::vector<std::string> jpegs;
  nlohmann::json parts = nlohmann::json::array();
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    jpegs.push_back(encode_jpeg(pictures[i], moving ? kMovingQuality : kStillQuality));
    parts.push_back({{"name", names[i]}, {"bytes", jpegs.back().size()}});
  }
  const auto side = [&](const Picture& picture, const SideRenderer& renderer) {
    return nlohmann::json{{"integrator", picture.side.integrator},
                          {"model", picture.side.model},
                          {"samples", picture.samples},
                          {"seconds", picture.seconds},
                          {"pass_ms", 1e3 * renderer.last_pass_seconds()},
                          {"queries_per_s", renderer.last_queries_per_second()},
                          {"rays_per_s", renderer.last_rays_per_second()}};
  };
  nlohmann::json header = {{"frame", ++frame_},
                           {"input", state.input},
                           {"camera", state.pose},
                           {"width", shown.a->view.width},
                           {"height", shown.a->view.height},
                           {"moving", moving},
                           {"pictures", parts},
                           {"a", side(*shown.a, a_)},
                           {"memory", resident_bytes()}};
  if (shown.b) header["b"] = side(*shown.b, b_);
  const double encode_ms = lap();
  header["ms"] = {{"samples", 1e3 * (a_.last_pass_seconds() + (shown.b ? b_.last_pass_seconds() : 0.0))},
                  {"film", film_ms},
                  {"tone", tone_ms},
                  {"encode", encode_ms},
                  {"send", server_->last_send_ms()}};
  auto frame = std::make_shared<Frame>();
  frame->number = frame_;
  frame->bytes = frame_bytes(header, jpegs);
  server_->publish(std::move(frame));
  const std::lock_guard lock(mutex_);
  shown_ = shown;
  const View& view = shown.a->view;
  const bool full = !moving && view.width == state.width && view.height == state.height;
  finished_[0] = full ? shown.a : nullptr;
  finished_[1] = full ? shown.b : nullptr;
}

}  // namespace octrad::viewer
