#include "app/paper/run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>

#include "app/paper/jobs.h"
#include "app/paper/rates.h"
#include "app/paper/report.h"
#include "app/paper/store.h"
#include "app/paper/work.h"
#include "octrad/base/atomic_file.h"
#include "octrad/base/duration.h"
#include "octrad/base/error.h"
#include "octrad/base/log.h"
#include "octrad/base/stopwatch.h"
#include "octrad/base/version.h"
#include "octrad/scene/camera.h"

namespace octrad::paper {
namespace {
namespace fs = std::filesystem;

class Run {
 public:
  explicit Run(const PaperOptions& options) : o_(options), store_(options.output), jobs_(store_) {}
  PaperSummary go();

 private:
  void open_folder();
  void read_matrices();
  void open_scenes();
  void choose_scale();
  Plan plan_at(double factor);
  void write_cameras();
  void make_jobs();
  void describe_plan(PaperSummary& summary) const;
  void forget_errors_without_lpips();

  double octaoctree_bytes(std::size_t scene, const Matrix& matrix, const Switch& sw);
  std::string link_to(const std::string& name, const std::string& target);

  const PaperOptions& o_;
  Store store_;
  std::vector<Matrix> matrices_;
  std::vector<PaperScene> scenes_;
  std::vector<std::vector<SceneInput>> inputs_;      // scenes as they were asked for, by matrix
  std::vector<std::vector<std::size_t>> scenes_of_;  // the same, as places in scenes_
  Plan plan_;
  Rates rates_;
  std::map<std::string, double> bytes_;
  WorkOptions work_options_;
  Jobs jobs_;
  nlohmann::json head_;  // of the report: budget, machine, program
  Stopwatch watch_;
};

double Run::octaoctree_bytes(std::size_t scene, const Matrix& matrix, const Switch& sw) {
  const auto words = tables_words(scenes_[scene], matrix.preset, {&matrix.keys, &sw.keys});
  std::string id;
  for (const std::string& word : words) id += word + "\n";
  const auto it = bytes_.find(id);
  if (it != bytes_.end()) return it->second;
  return bytes_[id] = store_.ask(words, "")["output"]["model_file"]["without_optimizer"].get<double>();
}

// The name, within the run's folder, of a file or folder elsewhere: commands hold no names of this machine.
std::string Run::link_to(const std::string& name, const std::string& target) {
  if (!fs::exists(target)) throw IoError(fmt::format("{} does not exist", target));
  const fs::path full = fs::absolute(target).lexically_normal();
  if (fs::is_directory(full)) {
    store_.link(name, full.string());
    return name;
  }
  store_.link(name, full.parent_path().string());
  return name + "/" + full.filename().string();
}

void Run::open_folder() {
  store_.open();
  if (!o_.references.empty()) {
    std::error_code error;
    fs::create_directories(o_.references, error);
    if (error) throw IoError(fmt::format("cannot make folder {}: {}", o_.references, error.message()));
    store_.link("references", fs::canonical(o_.references).string());
  }
  for (const char* name : {"scenes", "cells", "models", "references", "cameras"}) store_.make_folder(name);
  store_.common = o_.common;
  work_options_.device = o_.device;
  if (!o_.lpips_weights.empty()) work_options_.lpips_weights = link_to("lpips-weights", o_.lpips_weights);
  if (!o_.oidn_library.empty()) work_options_.oidn_library = link_to("oidn-library", o_.oidn_library);
}

// Before anything is written: a mistake in what is asked for leaves no folder.
void Run::read_matrices() {
  const SceneChoice choice = choose_scenes(o_.scenes);
  for (const std::string& name : o_.matrices) {
    matrices_.push_back(read_matrix(name));
    for (std::size_t i = 0; i + 1 < matrices_.size(); ++i) {
      if (matrices_[i].name == matrices_.back().name)
        throw InputError(fmt::format("two matrices are named {}", matrices_[i].name));
    }
    inputs_.push_back(choice.of(matrices_.back()));
  }
}

void Run::open_scenes() {
  for (const std::vector<SceneInput>& inputs : inputs_) {
    scenes_of_.emplace_back();
    for (const SceneInput& input : inputs) {
      auto it = std::find_if(scenes_.begin(), scenes_.end(), [&](const PaperScene& s) { return s.name == input.name; });
      if (it == scenes_.end()) {
        const fs::path file = input.file;
        const std::string link = "scenes/" + input.name;
        store_.link(link, file.parent_path().string());
        scenes_.push_back({input.name, link + "/" + file.filename().string(), {}});
        it = scenes_.end() - 1;
      }
      scenes_of_.back().push_back(static_cast<std::size_t>(it - scenes_.begin()));
    }
  }
  for (PaperScene& scene : scenes_) {
    log_verbose("looking at {}", scene.name);
    try {
      scene.info = store_.ask({"info", scene.file}, "")["output"];
    } catch (const CommandFailed& failure) {
      throw InputError(fmt::format("scene {}: {}", scene.name, failure.message));
    }
  }
}

Plan Run::plan_at(double factor) {
  return make_plan(matrices_, scenes_, scenes_of_, Scale{factor},
                   [this](std::size_t s, const Matrix& m, const Switch& sw) { return octaoctree_bytes(s, m, sw); });
}

// The factor for a budget is chosen once and kept, so that a run that continues does the same work.
void Run::choose_scale() {
  plan_ = plan_at(1.0);
  if (plan_.cells.empty()) throw InputError("the matrices have no cells");
  double factor = 1.0;
  nlohmann::json what = {o_.budget};
  for (const Cell& cell : plan_.cells) what.push_back(cell.folder);
  const nlohmann::json kept = store_.read("plan.json");
  const bool known =
      !o_.budget.empty() && kept.is_object() && kept.value("what", nlohmann::json()) == what && kept.contains("factor");
  if (o_.budget.empty()) select_cells(plan_, o_.only);  // else all have a share in the budget
  rates_ = measure_rates(store_, plan_, o_.device);
  if (known) {
    factor = kept["factor"];
  } else if (!o_.budget.empty()) {
    const double budget = parse_duration(o_.budget);
    double low = 1e-6, high = 1.0;
    for (int i = 0; i < 24 && plan_cost(plan_, rates_) > 0.85 * budget; ++i) {
      const double middle = std::sqrt(low * high);
      (plan_cost(plan_at(middle), rates_) > 0.85 * budget ? high : low) = middle;
      factor = low;
    }
    const Plan smallest = plan_at(factor);
    if (const double cost = plan_cost(smallest, rates_); cost > 0.85 * budget)
      log_warning(fmt::format(
          "--budget {}: even at the smallest sizes this takes about {}; fewer scenes, methods or views take less",
          o_.budget, format_duration(cost)));
  }
  if (!o_.budget.empty() && !o_.dry_run)
    store_.write("plan.json", {{"what", what}, {"budget", o_.budget}, {"factor", factor}});
  if (factor < 1.0) plan_ = plan_at(factor);
}

void Run::write_cameras() {
  for (std::size_t m = 0; m < matrices_.size(); ++m) {
    for (const auto& [scene, views] : matrices_[m].views) {
      for (const ViewSpec& view : views) {
        if (view.sensor >= 0) continue;
        for (const PaperScene& s : scenes_) {
          if (scene != "*" && scene != s.name) continue;
          const std::string name = camera_file(s.name, view);
          store_.write(name, view.camera);
          read_cameras(store_.path(name));  // refuses what is no camera
        }
      }
    }
  }
}

// Errors that were measured without LPIPS are measured again where its weights are given now.
void Run::forget_errors_without_lpips() {
  if (work_options_.lpips_weights.empty()) return;
  for (const Cell& cell : plan_.cells) {
    if (!cell.selected || !store_.has(cell.folder + "/cell.json")) continue;
    const std::unique_ptr<WriterLock> lock = WriterLock::try_to_take(store_.path(cell.folder + "/cell.json"));
    for (const std::size_t r : cell.references) {
      const std::string record = cell.folder + "/" + plan_.references[r].view.name + ".compare.json";
      const nlohmann::json kept = store_.read(record);
      if (!lock || !kept.is_object() || kept.value("command", "").find("--lpips-weights") != std::string::npos)
        continue;
      store_.remove(record);
      store_.remove(cell.folder + "/cell.json");
    }
  }
}

void Run::make_jobs() {
  // What the selected cells need, in the order in which it can be done: all of a scene before the next one.
  const auto work = std::make_shared<Work>(store_, plan_, rates_, work_options_);
  const auto reference_job = [&](std::size_t i) {
    const Reference& r = plan_.references[i];
    return jobs_.add({fmt::format("reference {} {}", plan_.scenes[r.scene].name, r.view.name),
                      r.folder,
                      r.folder + "/ref.json",
                      reference_cost(plan_, rates_, r),
                      {},
                      [work, &r] { work->render_reference(r); }});
  };
  for (std::size_t s = 0; s < plan_.scenes.size(); ++s) {
    for (const Cell& cell : plan_.cells) {
      if (cell.scene != s || !cell.selected) continue;
      const std::string name = fmt::format("{} in {}", cell.method->name, plan_.scenes[s].name);
      Job job{name, cell.folder, cell.folder + "/cell.json", cell_cost(plan_, rates_, cell), {}, [work, &cell] {
                work->make_cell(cell);
              }};
      job.library = denoises(*cell.method);
      for (const std::size_t r : cell.references) job.needs.push_back(reference_job(r));
      if (cell.training) {
        const Training& t = plan_.trainings[*cell.training];
        Job training{fmt::format("training {} in {}", t.field, plan_.scenes[s].name),
                     t.folder,
                     t.folder + "/train.json",
                     training_cost(plan_, rates_, t),
                     {},
                     [work, &t] { work->train(t); }};
        if (t.reference) training.needs.push_back(reference_job(*t.reference));
        job.needs.push_back(jobs_.add(training));
      }
      const std::size_t made_cell = jobs_.add(job);
      if (cell.film) {
        const Film& film = plan_.films[*cell.film];
        const std::size_t reference = jobs_.add({"reference film in " + plan_.scenes[s].name,
                                                 film.folder,
                                                 film.folder + "/film.json",
                                                 film_cost(plan_, rates_, film),
                                                 {},
                                                 [work, &film] { work->render_film(film); }});
        jobs_.add({"flicker of " + name,
                   temporal_folder(plan_, cell),
                   temporal_folder(plan_, cell) + "/temporal.json",
                   temporal_cost(plan_, rates_, cell),
                   {made_cell, reference},
                   [work, &cell] { work->make_temporal(cell); }});
      }
      if (cell.learned) {
        jobs_.add({"what " + name + " learned",
                   cell.folder + "/learned",
                   cell.folder + "/learned/learned.json",
                   0.0,
                   {made_cell},
                   [work, &cell] { work->make_learned(cell); }});
      }
      if (const std::string ladder = ladder_folder(plan_, cell); !ladder.empty()) {
        jobs_.add({"path tracing in " + plan_.scenes[s].name,
                   ladder,
                   ladder + "/ladder.json",
                   0.0,
                   {made_cell},
                   [work, &cell] { work->make_ladder(cell); }});
      }
    }
  }
}

void Run::describe_plan(PaperSummary& summary) const {
  nlohmann::json cells = nlohmann::json::array();
  for (const Cell& cell : plan_.cells) {
    if (!cell.selected) continue;
    const bool done = store_.has(cell.folder + "/cell.json");
    for (const Place& place : cell.places) {
      const std::string label = cell_label(plan_, cell, place);
      summary.plan += fmt::format("{}  {}{}\n", label, cell.folder, done ? "  (done)" : "");
      cells.push_back({{"name", label}, {"folder", cell.folder}, {"done", done}});
    }
  }
  const Jobs::Left left = jobs_.left();
  summary.plan += fmt::format("{} cells, {} trainings, {} references; {} of {} pieces of work are left, about {}\n",
                              plan_.cells.size(), plan_.trainings.size(), plan_.references.size(), left.jobs,
                              jobs_.size(), format_duration(left.seconds));
  summary.plan_json = {{"cells", cells},
                       {"jobs", jobs_.size()},
                       {"jobs_left", left.jobs},
                       {"seconds_left", left.seconds},
                       {"factor", plan_.scale.factor}};
}

PaperSummary Run::go() {
  read_matrices();
  open_folder();
  open_scenes();
  write_cameras();
  choose_scale();
  select_cells(plan_, o_.only);
  make_jobs();
  PaperSummary summary;
  if (o_.dry_run) {
    describe_plan(summary);
    return summary;
  }
  std::vector<std::string> machine = {"info"};
  machine.insert(machine.end(), o_.device.begin(), o_.device.end());
  head_ = {{"program", std::string("octrad ") + kVersion},
           {"budget", o_.budget.empty() ? nlohmann::json() : nlohmann::json(o_.budget)},
           {"machine", store_.ask(machine, "")["output"]}};
  forget_errors_without_lpips();
  summary.interrupted = !jobs_.run([this] { write_results(store_, plan_, head_); });
  const nlohmann::json results = write_results(store_, plan_, head_);
  write_report(store_, plan_, results, !o_.no_viewers);
  for (const nlohmann::json& cell : results["cells"]) {
    const std::string status = cell["status"];
    ++(status == "done"            ? summary.done
       : status == "failed"        ? summary.failed
       : status == "not available" ? summary.unavailable
                                   : summary.waiting);
    if (status == "failed" && summary.first_failure.empty())
      summary.first_failure = fmt::format("{} in {}: {}", cell["method"].get<std::string>(),
                                          cell["scene"].get<std::string>(), cell["message"].get<std::string>());
  }
  summary.seconds = watch_.seconds();
  return summary;
}

}  // namespace

PaperSummary run_paper(const PaperOptions& options) {
  try {
    return Run(options).go();
  } catch (const CommandFailed& failure) {  // of a command that is no job's
    const int code = failure.exit_code;
    throw Error(code >= 1 && code <= 5 ? static_cast<ExitCode>(code) : ExitCode::bad_input,
                failure.command + ": " + failure.message);
  } catch (const Interrupted&) {
    throw Error(ExitCode::interrupted, "interrupted");
  }
}

}  // namespace octrad::paper
