#include "app/paper/work.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>

#include "octrad/base/atomic_file.h"
#include "octrad/base/interrupt.h"
#include "octrad/base/json_file.h"
#include "octrad/base/log.h"
#include "octrad/encoding/octaoctree.h"
#include "octrad/model/model_file.h"

namespace octrad::paper {
namespace {

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

}  // namespace

bool denoises(const Method& method) { return method.denoise || std::string(method.integrator) == "denoised"; }

Work::Work(Store& store, const Plan& plan, const Rates& rates, WorkOptions options)
    : store_(store),
      plan_(plan),
      rates_(rates),
      o_(std::move(options)) {}

std::vector<std::string> Work::with_device(std::vector<std::string> words) const {
  words.insert(words.end(), o_.device.begin(), o_.device.end());
  return words;
}

void Work::render_reference(const Reference& r) {
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

void Work::train(const Training& t) {
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
std::vector<std::string> Work::render_words(const Cell& cell, int spp) const {
  std::vector<std::string> words = {"render", plan_.scenes[cell.scene].file, "--integrator", cell.method->integrator};
  if (cell.training) words.insert(words.end(), {"--model", cell.folder + "/model.octrad"});
  if (traces_paths(*cell.method)) words.insert(words.end(), {"--max-depth", "-1"});
  words.insert(words.end(), {"--spp", std::to_string(spp), "--seed", std::to_string(cell.seed)});
  if (cell.method->denoise) words.push_back("--denoise");
  if (denoises(*cell.method) && !o_.oidn_library.empty())
    words.insert(words.end(), {"--oidn-library", o_.oidn_library});
  return words;
}

nlohmann::json Work::make_view(const Cell& cell, const Reference& reference) {
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
  if (!o_.lpips_weights.empty()) compare.insert(compare.end(), {"--lpips-weights", o_.lpips_weights});
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

void Work::make_cell(const Cell& cell) {
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
void Work::make_learned(const Cell& cell) {
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
  const nlohmann::json statistics = store_.command(
      folder + "/levels.json", tables_words(plan_.scenes[cell.scene], training.preset, {&training.keys}));
  store_.write(
      folder + "/learned.json",
      {{"pictures", pictures}, {"levels", statistics["output"]["levels"]}, {"levels_command", statistics["command"]}});
}

void Work::render_film(const Film& film) {
  store_.make_folder(film.folder + "/frames");
  store_.write(film.path_file(), film.path);
  store_.command(film.folder + "/film.json",
                 with_device({"render", plan_.scenes[film.scene].file, "--integrator", "path", "--max-depth", "-1",
                              "--spp", std::to_string(film.spp), "--seed", "900001", "--path", film.path_file(),
                              "--width", std::to_string(film.width), "--height", std::to_string(film.height), "-o",
                              film.folder + "/frames/####.exr"}));
}

// The frames are of no use afterwards.
void Work::make_temporal(const Cell& cell) {
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

void Work::make_ladder(const Cell& cell) {
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

}  // namespace octrad::paper
