// The rendering thread of a session: when it renders what, and what it sends.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "app/view/points_layer.h"
#include "app/view/session.h"
#include "octrad/base/bytes.h"
#include "octrad/base/error.h"
#include "octrad/base/json_file.h"
#include "octrad/base/stopwatch.h"
#include "octrad/image/encode.h"
#include "octrad/image/metrics.h"
#include "octrad/image/tonemap.h"

namespace octrad::viewer {
namespace {

using namespace std::chrono_literals;

constexpr double kFrameSeconds = 0.05;                  // of a frame while moving
constexpr auto kStill = 150ms;                          // without a new camera: the picture refines
constexpr auto kBetweenFrames = 100ms;                  // of pictures that refine
constexpr int kMovingQuality = 80, kStillQuality = 92;  // of JPEG
constexpr int kLeastWidth = 96;                         // of a moving picture

}  // namespace

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
      [this] { return ends(); });
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
        const bool other_film = wanted_.film != film_done_;
        moving = now - wanted_.moved < kStill || (other_film && wanted_.quick != quick_done_);
        training = live_ != nullptr && live_->training();
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
    quick_done_ = wanted.quick;
    if (!sample(wanted, view, false, [this] { return ends(); })) return;
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
  {
    const std::lock_guard lock(mutex_);
    shown_ = shown;
    const View& view = shown.a->view;
    const bool full = !moving && view.width == state.width && view.height == state.height;
    finished_[0] = full ? shown.a : nullptr;
    finished_[1] = full ? shown.b : nullptr;
  }
  server_->publish(std::move(frame));  // last: whoever sees the picture may save it at once
}

}  // namespace octrad::viewer
