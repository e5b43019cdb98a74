// What is shown to whom: the state that one client controls, the thread that renders it, and what clients ask.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "app/view/live.h"
#include "app/view/side_renderer.h"
#include "app/view/web_server.h"

namespace octrad::viewer {

class Session : public ServerHandler {
 public:
  // `command`: what the page needs to write a command line of octrad render (docs/viewer.md, "hello"). `live`: the
  // training of a model of the studio, null: there is none. It must outlive this object, and somebody run it.
  Session(Studio studio, ViewState first, nlohmann::json command, LiveTraining* live = nullptr);
  ~Session() override;

  // Renders for the clients of `server`, until stop().
  void start(WebServer& server);
  // Ends the threads. Call before the server ends.
  void stop();
  // While clients are served: trains where there is a training, else waits, until `interrupted`. Throws what ended the
  // rendering thread, if something did that is no mistake of a client. The result is that of LiveTraining::run().
  bool run(const std::function<bool()>& interrupted);

  void opened(ClientId client) override;
  void closed(ClientId client) override;
  void message(ClientId client, const std::string& text) override;
  void download(const std::string& path, std::function<void(Download)> answer) override;

 private:
  void check() const;
  using Clock = std::chrono::steady_clock;
  // What the rendering thread works on. Numbers rise with every change.
  struct Wanted {
    ViewState state;
    long long film = 1;     // changes that need other samples
    long long view = 1;     // those of them of the camera and the size
    long long display = 1;  // any change that is seen
    Clock::time_point moved{};
    long long quick = 0;  // the film that is to be shown in a quick way first
  };
  struct Shown {
    std::shared_ptr<const Picture> a, b;
    ChannelRange channels = {0, 0};  // that they have at least
  };

  // Of what a film is; that of a model that is being trained changes with every step.
  struct FilmKey {
    long long view, scene, field;
    int width, height;
    Side side;
    bool operator==(const FilmKey&) const = default;
  };
  using Stop = std::function<bool()>;
  static constexpr std::chrono::milliseconds kBetweenLooks{50};  // at a live training

  void handle(ClientId client, const nlohmann::json& message);
  void set(ClientId client, const nlohmann::json& message);
  void require_control(ClientId client) const;  // under mutex_; throws InputError where the client has no controls
  void train(ClientId client, const nlohmann::json& message);
  nlohmann::json pick(const nlohmann::json& message) const;
  nlohmann::json path(const nlohmann::json& message) const;
  nlohmann::json state_json() const;  // with who controls; under the mutex
  void tell_state();
  void require_memory_for(int width, int height, bool two) const;

  void work();

  // session_render.cc
  void render();
  bool answer_picks();
  View view_of(const ViewState& state, double scale) const;
  double quick_scale(const ViewState& state);
  void took(double seconds, const View& view);
  FilmKey film_key(const Wanted& wanted, const Side& side, const View& view) const;
  bool sample(const Wanted& wanted, const View& view, bool more, const Stop& stop);
  bool is_current(const Wanted& wanted) const;
  void make_picture(const Wanted& wanted, bool moving, bool training);
  void publish(const Wanted& wanted, bool moving, bool samples_are_new);
  bool ends() const;
  bool changed(long long film) const { return ends() || film_ != film; }

  Studio studio_;
  Catalogue catalogue_;
  const nlohmann::json command_;
  WebServer* server_ = nullptr;

  mutable std::mutex mutex_;
  std::condition_variable wake_, work_;
  Wanted wanted_;
  std::vector<ClientId> clients_;  // in the order of their coming
  ClientId controller_ = 0;
  Shown shown_;
  std::shared_ptr<const Picture> finished_[2];  // the last at full resolution
  std::deque<std::function<void()>> jobs_;
  const std::shared_ptr<std::atomic<int>> saving_ =
      std::make_shared<std::atomic<int>>(0);               // pictures, until they are sent
  std::deque<std::pair<ClientId, nlohmann::json>> picks_;  // while there is a live training
  std::exception_ptr failure_;
  std::atomic<bool> stopping_{false};
  std::atomic<long long> film_{1};  // Wanted::film, for the renderer

  // Of the rendering thread.
  SideRenderer a_, b_;
  std::optional<FilmKey> a_film_, b_film_;  // none while moving
  long long a_scene_ = 0, b_scene_ = 0;     // LiveTraining::scene_number() of the renderers
  bool still_ = false;                      // the films are those of the picture at rest
  long long film_done_ = 0, display_done_ = 0, quick_done_ = 0;
  Clock::time_point published_{};
  bool unpublished_ = false;
  ToneMapper tone_;
  long long frame_ = 0;
  double seconds_per_pixel_ = 0.0;  // of a frame while moving, all sides; 0: not known
  double scale_ = 0.0;

  LiveTraining* const live_;
  std::thread renderer_thread_, worker_;
};

}  // namespace octrad::viewer
