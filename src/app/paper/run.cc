#include "app/paper/run.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <thread>

#include "app/paper/rates.h"
#include "app/paper/report.h"
#include "app/paper/store.h"
#include "octrad/base/atomic_file.h"
#include "octrad/base/duration.h"
#include "octrad/base/error.h"
#include "octrad/base/interrupt.h"
#include "octrad/base/json_file.h"
#include "octrad/base/log.h"
#include "octrad/base/progress.h"
#include "octrad/base/stopwatch.h"
#include "octrad/base/version.h"
#include "octrad/encoding/octaoctree.h"
#include "octrad/model/model_file.h"
#include "octrad/scene/camera.h"

namespace octrad::paper {
namespace {
namespace fs = std::filesystem;

bool denoises(const Method& method) { return method.denoise || std::string(method.integrator) == "denoised"; }

// Error against seconds while it trained, from its log: [seconds, step, mape].
nlohmann::json convergence(const Store& store, const Training& t, const nlohmann::json& output) {
  nlohmann::json points = nlohmann::json::array();
  std::string text = store.has(t.folder + "/progress.jsonl") ? store.read_text(t.folder + "/progress.jsonl") : "";
  std::size_t begin = 0;
  while (begin < text.size()) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const nlohmann::json line = parse_json_or_discard(text.substr(begin, end - begin));
    begin = end + 1;
    if (line.is_object() && line.value("event", "") == "validation")
      points.push_back({line.at("seconds"), line.at("step"), line.at("mape")});
  }
  if (output.contains("validation_mape") && output["validation_mape"].is_number())
    points.push_back({output["seconds"], output["steps"], output["validation_mape"]});
  return points;
}

// A piece of work with a folder of its own. It is done when its result is there, whoever made it.
struct Job {
  std::string title, folder, result;
  double cost = 0.0;  // estimated seconds
  std::vector<std::size_t> needs;
  std::function<void()> work;
  bool library = false;  // needs one that may not be there
  enum class State { waiting, done, failed } state = State::waiting;
};

class Run {
 public:
  explicit Run(const PaperOptions& options) : o_(options), store_(options.output) {}
  PaperSummary go();

 private:
  void open_folder();
  void read_matrices();
  void open_scenes();
  void choose_scale();
  Plan plan_at(double factor);
  void write_cameras();
  void make_jobs();
  void do_jobs(PaperSummary& summary);
  bool do_job(Job& job);
  void fail(Job& job, const nlohmann::json& why);
  void fail(Job& job, const std::string& message, const std::string& command, bool unavailable);
  void describe_plan(PaperSummary& summary) const;
  void forget_errors_without_lpips();

  void render_reference(const Reference& r);
  void train(const Training& t);
  void make_cell(const Cell& cell);
  std::vector<std::string> render_words(const Cell& cell, int spp) const;
  nlohmann::json make_view(const Cell& cell, const Reference& reference);
  void make_learned(const Cell& cell);
  void render_film(const Film& film);
  void make_temporal(const Cell& cell);
  void make_ladder(const Cell& cell);
  std::vector<std::string> with_device(std::vector<std::string> words) const {
    words.insert(words.end(), o_.device.begin(), o_.device.end());
    return words;
  }
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
  std::vector<Job> jobs_;
  std::map<std::string, double> bytes_;
  std::string linked_weights_, linked_library_;
  nlohmann::json head_;  // of the report: budget, machine, program
  Stopwatch watch_;
};

double Run::octaoctree_bytes(std::size_t scene, const Matrix& matrix, const Switch& sw) {
  std::vector<std::string> words = {"info", scenes_[scene].file, "--preset", matrix.preset};
  for (const auto* keys : {&matrix.keys, &sw.keys}) {
    for (const auto& [key, value] : *keys) {
      if (key.rfind("octree.", 0) == 0) words.insert(words.end(), {"-D", key + "=" + value});
    }
  }
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
  if (!o_.lpips_weights.empty()) linked_weights_ = link_to("lpips-weights", o_.lpips_weights);
  if (!o_.oidn_library.empty()) linked_library_ = link_to("oidn-library", o_.oidn_library);
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
    if (const double cost = plan_cost(smallest, rates_); cost > 1.2 * budget)
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

void Run::render_reference(const Reference& r) {
  store_.make_folder(r.folder);
  std::vector<std::string> merge = {"merge"};
  for (int half = 0; half < 2; ++half) {
    const std::string name = half == 0 ? "a" : "b", file = fmt::format("{}/{}.exr", r.folder, name);
    std::vector<std::string> words = {"render",       plan_.scenes[r.scene].file,
                                      "--integrator", "path",
                                      "--max-depth",  "-1",
                                      "--spp",        std::to_string(r.half_spp),
                                      "--seed",       std::to_string(900001 + half),
                                      "-o",           file};
    words.insert(words.end(), r.view.words.begin(), r.view.words.end());
    words.push_back("--resume");
    store_.command(fmt::format("{}/{}.json", r.folder, name), with_device(words));
    store_.remove(file + ".state");  // what it would take to go on
    merge.push_back(file);
  }
  merge.insert(merge.end(), {"-o", r.picture()});
  store_.command(r.folder + "/ref.json", merge);
}

void Run::train(const Training& t) {
  store_.make_folder(t.folder);
  const std::string record = t.folder + "/train.json";
  std::vector<std::string> words = {
      "train",  plan_.scenes[t.scene].file, "-o", t.model(), "--preset", t.preset, "--field", t.field,
      "--seed", std::to_string(t.seed)};
  if (t.steps > 0) words.insert(words.end(), {"--steps", std::to_string(t.steps)});
  else words.insert(words.end(), {"--time", fmt::format("{:g}s", t.seconds)});
  for (const auto& [key, value] : t.keys) words.insert(words.end(), {"-D", key + "=" + value});
  if (t.reference) words.insert(words.end(), {"--reference", plan_.references[*t.reference].picture()});
  if (t.reference) {
    const double expected = t.steps > 0 ? training_cost(plan_, rates_, t) : t.seconds;
    words.insert(words.end(), {"--validate-every", fmt::format("{:.2g}s", std::clamp(expected / 40.0, 0.1, 10.0))});
  }
  words.insert(words.end(), {"--log-json", t.folder + "/progress.jsonl", "--resume"});
  store_.write(t.folder + "/config.json", {{"field", t.field},
                                           {"preset", t.preset},
                                           {"keys", t.keys},
                                           {"seed", t.seed},
                                           {"seconds", t.seconds},
                                           {"steps", t.steps}});
  // The command of a run that was killed a moment ago may still be saving what it has.
  while (!interrupted() && !WriterLock::try_to_take(store_.path(t.model())))
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
  nlohmann::json trained = store_.command(t.folder + "/trained.json", with_device(words));
  // What resuming needs is several times the model, and of no use any more. Doing this again does no harm.
  const std::string file = store_.path(t.model());
  const Model model = load_model(file);
  save_model(file, *model.field, model.info, false);
  const std::vector<long long> cells = model.field->cells_per_level();
  trained["entries"] = octree_entries(model.info.config.octree_levels, cells);
  trained["convergence"] = convergence(store_, t, trained["output"]);
  store_.write(record, trained);
}

// The beginning of the command that renders the cell's pictures.
std::vector<std::string> Run::render_words(const Cell& cell, int spp) const {
  std::vector<std::string> words = {"render", plan_.scenes[cell.scene].file, "--integrator", cell.method->integrator};
  if (cell.training) words.insert(words.end(), {"--model", cell.folder + "/model.octrad"});
  if (traces_paths(*cell.method)) words.insert(words.end(), {"--max-depth", "-1"});
  words.insert(words.end(), {"--spp", std::to_string(spp), "--seed", std::to_string(cell.seed)});
  if (cell.method->denoise) words.push_back("--denoise");
  if (denoises(*cell.method) && !linked_library_.empty())
    words.insert(words.end(), {"--oidn-library", linked_library_});
  return words;
}

nlohmann::json Run::make_view(const Cell& cell, const Reference& reference) {
  const std::string base = cell.folder + "/" + reference.view.name, picture = base + ".exr";
  const int frame_spp = cell.method->spp;
  const auto render_with = [&](int spp, const std::string& to, const std::string& record) {
    std::vector<std::string> words = render_words(cell, spp);
    if (spp == frame_spp) words.insert(words.end(), {"--frames", std::to_string(timed_frames(reference.view, spp))});
    words.insert(words.end(), reference.view.words.begin(), reference.view.words.end());
    words.insert(words.end(), {"-o", to});
    return store_.command(record, with_device(words));
  };
  const nlohmann::json render = render_with(cell.spp, picture, base + ".render.json");
  const nlohmann::json frame =
      cell.spp == frame_spp ? render : render_with(frame_spp, base + ".frame.exr", base + ".frame.json");

  std::vector<std::string> compare = {"compare", reference.picture(), picture};
  if (!linked_weights_.empty()) compare.insert(compare.end(), {"--lpips-weights", linked_weights_});
  const nlohmann::json all = store_.command(base + ".compare.json", compare);
  const nlohmann::json glossy =
      store_.command(base + ".glossy.json", {"compare", reference.picture(), picture, "--alpha-below", "0.5"});
  // Scores of blocks need the halves of the reference, which tell its noise.
  const nlohmann::json halves = store_.command(base + ".halves.json", {"compare", reference.folder + "/a.exr", picture,
                                                                       "--reference-b", reference.folder + "/b.exr"});

  nlohmann::json view = all["output"]["images"][0];
  view.erase("image");
  for (const char* member : {"blocks", "relmse_noise_free"})
    view[member] = halves["output"]["images"][0].value(member, nlohmann::json());
  const nlohmann::json& r = render["output"];
  view["view"] = reference.view.name;
  view["picture"] = picture;
  view["reference"] = reference.picture();
  view["width"] = r["width"];
  view["height"] = r["height"];
  view["spp"] = r["spp"];
  view["mape_glossy"] = glossy["output"]["images"][0]["mape"];
  view["pixels_glossy"] = glossy["output"]["images"][0]["pixels"];
  for (const char* metric : {"lpips", "flip", "ssim"}) {
    if (!view.contains(metric)) view[metric] = nullptr;
  }
  const nlohmann::json& f = frame["output"];
  view["frame_spp"] = frame_spp;
  view["frame_ms"] = f.contains("frames") ? f["frames"]["median_ms"] : nlohmann::json(1e3 * f["seconds"].get<double>());
  view["stages_ms"] = f.contains("frames") ? f["frames"]["stages_ms"] : nlohmann::json::object();
  view["commands"] = {{"render", render["command"]},
                      {"compare", all["command"]},
                      {"compare_glossy", glossy["command"]},
                      {"compare_halves", halves["command"]}};
  if (cell.spp != frame_spp) view["commands"]["frame"] = frame["command"];
  return view;
}

void Run::make_cell(const Cell& cell) {
  store_.make_folder(cell.folder);
  nlohmann::json config = {
      {"scene", plan_.scenes[cell.scene].name}, {"method", cell.method->name}, {"seed", cell.seed}, {"spp", cell.spp}};
  if (cell.training) {
    const Training& t = plan_.trainings[*cell.training];
    store_.link(cell.folder + "/model.octrad", "../../../" + t.model());
    config["training"] = store_.read(t.folder + "/config.json");
  }
  store_.write(cell.folder + "/config.json", config);
  nlohmann::json views = nlohmann::json::array();
  for (const std::size_t r : cell.references) views.push_back(make_view(cell, plan_.references[r]));
  store_.write(cell.folder + "/cell.json", {{"views", views}});
}

// Pictures of what the cache holds, for the report alone: one that cannot be made is left out.
void Run::make_learned(const Cell& cell) {
  const std::string folder = cell.folder + "/learned";
  store_.make_folder(folder);
  const View& view = plan_.references[cell.references.front()].view;
  const Training& training = plan_.trainings[*cell.training];
  Config config = preset(training.preset);
  for (const auto& [key, value] : training.keys) set(config, key, value);
  std::vector<std::string> integrators = {"traced", "disparity"};
  for (int level = 1; level <= octree_levels(config); ++level) integrators.push_back(fmt::format("features{}", level));
  nlohmann::json pictures = nlohmann::json::array();
  for (const std::string& integrator : integrators) {
    const std::string file = fmt::format("{}/{}.exr", folder, integrator);
    std::vector<std::string> words = {"render",  plan_.scenes[cell.scene].file, "--integrator", integrator,
                                      "--model", cell.folder + "/model.octrad"};
    words.insert(words.end(), view.words.begin(), view.words.end());
    words.insert(words.end(), {"-o", file});
    try {
      pictures.push_back(
          {{"integrator", integrator},
           {"picture", file},
           {"command", store_.command(fmt::format("{}/{}.json", folder, integrator), with_device(words))["command"]}});
    } catch (const CommandFailed& failure) {
      log_warning(fmt::format("{}: {}", failure.command, failure.message));
    }
  }
  std::vector<std::string> levels = {"info", plan_.scenes[cell.scene].file, "--preset", training.preset};
  for (const auto& [key, value] : training.keys) {
    if (key.rfind("octree.", 0) == 0) levels.insert(levels.end(), {"-D", key + "=" + value});
  }
  const nlohmann::json statistics = store_.command(folder + "/levels.json", levels);
  store_.write(
      folder + "/learned.json",
      {{"pictures", pictures}, {"levels", statistics["output"]["levels"]}, {"levels_command", statistics["command"]}});
}

void Run::render_film(const Film& film) {
  store_.make_folder(film.folder + "/frames");
  store_.write(film.path_file(), film.path);
  store_.command(film.folder + "/film.json",
                 with_device({"render", plan_.scenes[film.scene].file, "--integrator", "path", "--max-depth", "-1",
                              "--spp", std::to_string(film.spp), "--seed", "900001", "--path", film.path_file(),
                              "--width", std::to_string(film.width), "--height", std::to_string(film.height), "-o",
                              film.folder + "/frames/####.exr"}));
}

// How much the cell's frames of a camera path flicker. The frames are of no use afterwards.
void Run::make_temporal(const Cell& cell) {
  const Film& film = plan_.films[*cell.film];
  const std::string folder = temporal_folder(plan_, cell);
  store_.make_folder(folder + "/frames");
  std::vector<std::string> words = render_words(cell, cell.spp);
  words.insert(words.end(), {"--path", film.path_file(), "--width", std::to_string(film.width), "--height",
                             std::to_string(film.height), "-o", folder + "/frames/####.exr"});
  const nlohmann::json render = store_.command(folder + "/render.json", with_device(words));
  const nlohmann::json compared =
      store_.command(folder + "/compare.json", {"compare", film.folder + "/frames", folder + "/frames", "--temporal"});
  nlohmann::json result = compared["output"]["images"][0];
  result.erase("image");
  result["commands"] = {{"reference", store_.read(film.folder + "/film.json")["command"]},
                        {"render", render["command"]},
                        {"compare", compared["command"]}};
  store_.write(folder + "/temporal.json", result);
  store_.remove(folder + "/frames");
}

// Path tracing with more and more samples: its error against its time.
void Run::make_ladder(const Cell& cell) {
  const Reference& reference = plan_.references[cell.references.front()];
  const std::string folder = ladder_folder(plan_, cell);
  store_.make_folder(folder);
  nlohmann::json steps = nlohmann::json::array();
  for (const int spp : ladder_spp(plan_, cell)) {
    if (spp > reference.half_spp) continue;  // nearer to the truth than the reference
    const std::string base = fmt::format("{}/{}spp", folder, spp);
    std::vector<std::string> words = {
        "render",           plan_.scenes[cell.scene].file, "--integrator", "path", "--max-depth", "-1", "--spp",
        std::to_string(spp)};
    words.insert(words.end(), reference.view.words.begin(), reference.view.words.end());
    words.insert(words.end(), {"-o", base + ".exr"});
    const nlohmann::json render = store_.command(base + ".json", with_device(words));
    const nlohmann::json error =
        store_.command(base + ".compare.json", {"compare", reference.picture(), base + ".exr"});
    steps.push_back({{"spp", spp},
                     {"seconds", render["output"]["seconds"]},
                     {"mape", error["output"]["images"][0]["mape"]},
                     {"command", render["command"]}});
    store_.remove(base + ".exr");
  }
  store_.write(folder + "/ladder.json", {{"points", steps}});
}

// Errors that were measured without LPIPS are measured again where its weights are given now.
void Run::forget_errors_without_lpips() {
  if (linked_weights_.empty()) return;
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
  std::map<std::string, std::size_t> made;  // by result
  const auto add = [&](Job job) {
    const auto it = made.find(job.result);
    if (it != made.end()) return it->second;
    jobs_.push_back(std::move(job));
    made[jobs_.back().result] = jobs_.size() - 1;
    return jobs_.size() - 1;
  };
  const auto reference_job = [&](std::size_t i) {
    const Reference& r = plan_.references[i];
    return add({fmt::format("reference {} {}", plan_.scenes[r.scene].name, r.view.name),
                r.folder,
                r.folder + "/ref.json",
                reference_cost(plan_, rates_, r),
                {},
                [this, &r] { render_reference(r); }});
  };
  for (std::size_t s = 0; s < plan_.scenes.size(); ++s) {
    for (const Cell& cell : plan_.cells) {
      if (cell.scene != s || !cell.selected) continue;
      const std::string name = fmt::format("{} in {}", cell.method->name, plan_.scenes[s].name);
      Job job{name,
              cell.folder,
              cell.folder + "/cell.json",
              cell_cost(plan_, rates_, cell),
              {},
              [this, &cell] { make_cell(cell); }};
      job.library = denoises(*cell.method);
      for (const std::size_t r : cell.references) job.needs.push_back(reference_job(r));
      if (cell.training) {
        const Training& t = plan_.trainings[*cell.training];
        Job training{fmt::format("training {} in {}", t.field, plan_.scenes[s].name),
                     t.folder,
                     t.folder + "/train.json",
                     training_cost(plan_, rates_, t),
                     {},
                     [this, &t] { train(t); }};
        if (t.reference) training.needs.push_back(reference_job(*t.reference));
        job.needs.push_back(add(training));
      }
      const std::size_t made_cell = add(job);
      if (cell.film) {
        const Film& film = plan_.films[*cell.film];
        const std::size_t reference = add({"reference film in " + plan_.scenes[s].name,
                                           film.folder,
                                           film.folder + "/film.json",
                                           film_cost(plan_, rates_, film),
                                           {},
                                           [this, &film] { render_film(film); }});
        add({"flicker of " + name,
             temporal_folder(plan_, cell),
             temporal_folder(plan_, cell) + "/temporal.json",
             temporal_cost(plan_, rates_, cell),
             {made_cell, reference},
             [this, &cell] { make_temporal(cell); }});
      }
      if (cell.learned) {
        add({"what " + name + " learned",
             cell.folder + "/learned",
             cell.folder + "/learned/learned.json",
             0.0,
             {made_cell},
             [this, &cell] { make_learned(cell); }});
      }
      if (const std::string ladder = ladder_folder(plan_, cell); !ladder.empty()) {
        add({"path tracing in " + plan_.scenes[s].name,
             ladder,
             ladder + "/ladder.json",
             0.0,
             {made_cell},
             [this, &cell] { make_ladder(cell); }});
      }
    }
  }
}

// Ends the job, and with it all that need it.
void Run::fail(Job& job, const nlohmann::json& why) {
  job.state = Job::State::failed;
  store_.make_folder(job.folder);
  store_.write(job.result + ".failed", why);
  const auto number = static_cast<std::size_t>(&job - jobs_.data());
  for (Job& other : jobs_)
    if (other.state == Job::State::waiting && std::count(other.needs.begin(), other.needs.end(), number))
      fail(other, why);
}

void Run::fail(Job& job, const std::string& message, const std::string& command, bool unavailable) {
  fail(job, {{"message", message}, {"command", command}, {"unavailable", unavailable}});
  if (unavailable) log_info("{}: not available: {}", job.title, message);
  else log_warning(fmt::format("{} failed: {}", job.title, message));
}

// False when another process is at it.
bool Run::do_job(Job& job) {
  store_.make_folder(job.folder);
  const std::unique_ptr<WriterLock> lock = WriterLock::try_to_take(store_.path(job.result));
  if (!lock) return false;
  if (store_.has(job.result)) {  // made by another process in the meantime
    job.state = Job::State::done;
    return true;
  }
  try {
    job.work();
    store_.remove(job.result + ".failed");
    job.state = Job::State::done;
  } catch (const CommandFailed& failure) {
    fail(job, failure.message, failure.command, job.library && failure.exit_code == 3);
  } catch (const InputError& error) {
    fail(job, error.what(), "", false);
  } catch (const MemoryError& error) {
    fail(job, error.what(), "", false);
  } catch (const nlohmann::json::exception& error) {
    fail(job, std::string("what a command printed is not as expected: ") + error.what(), "", false);
  } catch (const Interrupted&) {
    if (!interrupted()) fail(job, "its command was interrupted", "", false);
  }
  return true;
}

void Run::do_jobs(PaperSummary& summary) {
  defer_interrupts();  // commands save what they have, and this process keeps their records
  Progress progress("paper");
  double estimated = 0.0, spent = 0.0;  // `spent` on jobs that were estimated to take `estimated`
  for (Job& job : jobs_)
    if (store_.has(job.result)) job.state = Job::State::done;
  const auto seconds_left = [&] {
    double sum = 0.0;
    for (const Job& job : jobs_) sum += job.state == Job::State::waiting ? job.cost : 0.0;
    return sum;
  };
  const double total = seconds_left();
  while (!interrupted()) {
    bool moved = false, waits = false;
    for (Job& job : jobs_) {
      if (interrupted()) break;
      if (job.state != Job::State::waiting) continue;
      if (store_.has(job.result)) {
        job.state = Job::State::done;
        moved = true;
        continue;
      }
      if (std::any_of(job.needs.begin(), job.needs.end(),
                      [&](std::size_t n) { return jobs_[n].state != Job::State::done; })) {
        waits = true;
        continue;
      }
      // Times so far correct the estimates of what is left.
      const double slower = estimated > 5.0 ? std::clamp(spent / estimated, 0.2, 20.0) : 1.0;
      const double left = seconds_left();
      const Stopwatch watch;  // of all commands of the job
      store_.waiting = [&] {
        if (!progress.due()) return;
        const double rest = std::max(0.0, left - std::min(job.cost, watch.seconds() / slower));
        progress.update(total > 0.0 ? std::clamp(1.0 - rest / total, 0.0, 1.0) : 0.0, job.title, false, rest * slower);
      };
      if (!do_job(job)) {
        waits = true;
        continue;
      }
      moved = true;
      if (job.state == Job::State::done) {
        spent += watch.seconds();
        estimated += job.cost;
        log_verbose("{}: {}", job.title, format_duration(watch.seconds()));
      }
      write_results(store_, plan_, head_);
    }
    if (!waits) break;
    if (!moved) std::this_thread::sleep_for(std::chrono::milliseconds(500));  // another process has the rest
  }
  progress.finish();
  store_.waiting = [] {};
  summary.interrupted = interrupted();
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
  double cost = 0.0;
  std::size_t open = 0;
  for (const Job& job : jobs_) {
    if (store_.has(job.result)) continue;
    cost += job.cost;
    ++open;
  }
  summary.plan += fmt::format("{} cells, {} trainings, {} references; {} of {} pieces of work are left, about {}\n",
                              plan_.cells.size(), plan_.trainings.size(), plan_.references.size(), open, jobs_.size(),
                              format_duration(cost));
  summary.plan_json = {{"cells", cells},
                       {"jobs", jobs_.size()},
                       {"jobs_left", open},
                       {"seconds_left", cost},
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
  head_ = {{"program", std::string("octrad ") + kVersion},
           {"budget", o_.budget.empty() ? nlohmann::json() : nlohmann::json(o_.budget)},
           {"machine", store_.ask(with_device({"info"}), "")["output"]}};
  forget_errors_without_lpips();
  do_jobs(summary);
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
