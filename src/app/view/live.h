// A training that clients watch and steer, and whose scene they edit: what they may ask is checked and left to the
// loop that trains, which does it between two steps. So do pictures of the field, in a bounded share of the time.
#pragma once

#include <atomic>
#include <condition_variable>
#include <exception>
#include <functional>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "octrad/train/trainer.h"

namespace octrad::viewer {

class LiveTraining {
 public:
  struct Options {
    bool begin = true;  // trains from the start; else once somebody asks for it, or has edited something
    bool saves = true;  // the trainer has a file
    bool ends = true;   // run() ends when training has and nobody watches
  };
  // Both must outlive this object, and are used by run() alone while it runs.
  LiveTraining(PreparedScene& scene, Trainer& trainer, const Options& options);

  // --- Any thread.
  // {"type": "train", "do": "start" | "pause" | "save" | "stop"}. Throws InputError.
  void command(const nlohmann::json& message);
  // {"type": "edit", ...} (docs/viewer.md). Throws InputError.
  void edit(const nlohmann::json& message);
  nlohmann::json status() const;   // {"type": "training", ...}
  nlohmann::json history() const;  // curves: {"seconds": [...], "loss": ..., "rate": ..., "mape": ...}
  nlohmann::json scene() const;    // {"type": "scene", "lights": [...], "materials": [...]} with their edits
  // How often an edit was refused after it had been said, so that scene() says something else again.
  long long refusals() const { return refusals_; }
  long long scene_number() const { return scene_number_; }  // rises with every edit that was applied
  long long field_number() const { return field_number_; }  // rises with every step
  bool training() const { return training_; }               // steps are being taken
  void set_watched(bool watched);
  void set_wants_points(bool wants) { wants_points_ = wants; }

  // --- One thread that makes pictures.
  // Has the loop run `work` between two steps and waits for it. While it trains, such work takes a tenth of the time,
  // or half of it where `moving`. Until its turn has come `give_up` is asked now and then; then, or when run() has
  // ended, the result is false and `work` has not run. What it throws is thrown here.
  bool between_steps(bool moving, const std::function<void()>& work, const std::function<bool()>& give_up);
  // Where the last steps were taken: for `work`.
  const std::vector<Vec3f>& points() const { return points_; }

  // --- The thread that trains.
  // Trains and serves until `interrupted`; with Options::ends also until training is done, or was stopped, and nobody
  // has watched for some seconds. Whether training was cut short.
  bool run(const std::function<bool()>& interrupted);

 private:
  enum class State { idle, running, paused, stopped };
  struct Turn {  // of between_steps()
    const std::function<void()>* work;
    bool moving;
    bool done = false;
    std::exception_ptr error = {};
  };

  void serve_picture();
  void apply_edits();
  void take_commands();
  void save();
  void note_step();
  void tell();
  nlohmann::json describe_lights() const;
  nlohmann::json describe_materials() const;

  PreparedScene& scene_;
  Trainer& trainer_;
  const Options options_;

  mutable std::mutex mutex_;
  std::condition_variable wake_, served_;
  std::vector<std::string> commands_;
  std::map<int, Vec3f> light_edits_;            // not applied yet
  std::map<int, MaterialEdit> material_edits_;  // likewise
  nlohmann::json lights_, materials_;           // as they will be once they are
  nlohmann::json status_;
  std::vector<double> seconds_, losses_, rates_, mapes_;
  Turn* turn_ = nullptr;
  bool ended_ = false;
  std::atomic<long long> scene_number_{1}, field_number_{1}, refusals_{0};
  std::atomic<bool> training_{false}, watched_{false}, ever_watched_{false}, wants_points_{false}, asked_{false};

  // Of the thread that trains.
  State state_;
  bool finished_ = false;  // the budget was spent and the result saved
  double credit_ = 0.0;    // seconds that pictures may take
  double share_ = 0.0;     // of the time that they took lately
  double spacing_ = 0.0;   // seconds between two points of the curves
  std::string trouble_;    // why the last edit was refused
  std::vector<Vec3f> points_;
  std::size_t next_point_ = 0;
};

}  // namespace octrad::viewer
