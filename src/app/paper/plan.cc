#include "app/paper/plan.h"
#include "app/report/vector_json.h"

#include <fmt/format.h>
#include <fnmatch.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "octrad/base/error.h"
#include "octrad/base/join.h"
#include "octrad/base/vec.h"
#include "octrad/model/field_registry.h"
#include "octrad/model/model_file.h"
#include "octrad/scene/camera.h"
#include "octrad/train/schedule.h"

namespace octrad::paper {
namespace {
namespace fs = std::filesystem;

const std::vector<std::string> kPaperScenes = {"bathroom", "cornell-box", "kitchen", "living-room", "veach-ajar"};

// In the paper's order, then by name.
void sort_scenes(std::vector<SceneInput>& scenes) {
  const auto rank = [](const SceneInput& s) {
    return std::find(kPaperScenes.begin(), kPaperScenes.end(), s.name) - kPaperScenes.begin();
  };
  std::stable_sort(scenes.begin(), scenes.end(), [&](const SceneInput& a, const SceneInput& b) {
    return rank(a) != rank(b) ? rank(a) < rank(b) : a.name < b.name;
  });
}

std::string scene_name(const fs::path& file) {
  const bool usual = file.filename() == "scene.xml" && file.has_parent_path();
  std::string name = (usual ? file.parent_path().filename() : file.stem()).string();
  for (char& c : name) {
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '-' && c != '_') c = '_';
  }
  return name;
}

std::string hash_of(const nlohmann::json& settings) {  // FNV-1a
  std::uint64_t h = 14695981039346656037ull;
  for (const char c : settings.dump()) h = (h ^ static_cast<unsigned char>(c)) * 1099511628211ull;
  return fmt::format("{:08x}", static_cast<std::uint32_t>(h ^ (h >> 32)));
}

std::vector<ViewSpec> views_of(const Matrix& matrix, const PaperScene& scene) {
  for (const std::string& key : {scene.name, std::string("*")}) {
    if (const auto it = matrix.views.find(key); it != matrix.views.end()) return it->second;
  }
  std::vector<ViewSpec> all;
  for (std::size_t i = 0; i < scene.info.at("cameras").size(); ++i)
    all.push_back({fmt::format("sensor{}", i), static_cast<int>(i), {}});
  return all;
}

View make_view(const Matrix& matrix, const PaperScene& scene, const ViewSpec& spec, const Scale& scale) {
  View view;
  view.name = spec.name;
  nlohmann::json size = scene.info.at("film");
  const auto& cameras = scene.info.at("cameras");
  const int sensors = static_cast<int>(cameras.size());
  if (spec.sensor >= sensors)
    throw InputError(fmt::format("{}: views: sensor {}: {} has {} (numbered from 0)", matrix.name, spec.sensor,
                                 scene.name, sensors));
  const nlohmann::json& own = spec.sensor >= 0 ? cameras[static_cast<std::size_t>(spec.sensor)] : spec.camera;
  if (own.value("width", 0) > 0 && own.value("height", 0) > 0) size = own;
  view.width = scale.width(matrix.width);
  view.height = std::max(
      1, static_cast<int>(std::lround(view.width * size.at("height").get<double>() / size.at("width").get<double>())));
  view.words = spec.sensor >= 0 ? std::vector<std::string>{"--sensor", std::to_string(spec.sensor)}
                                : std::vector<std::string>{"--camera", camera_file(scene.name, spec)};
  view.words.insert(view.words.end(), {"--width", std::to_string(view.width), "--height", std::to_string(view.height)});
  view.first_sensor = spec.sensor == 0;
  return view;
}

// Folders end in a hash of all settings; what comes before it is for people, and may differ.
std::string hash_in(const std::string& folder) { return folder.substr(folder.rfind('.') + 1); }

template <typename T>
std::size_t find_or_add(std::vector<T>& list, const T& item) {
  const auto it = std::find_if(list.begin(), list.end(),
                               [&](const T& other) { return hash_in(other.folder) == hash_in(item.folder); });
  if (it != list.end()) return static_cast<std::size_t>(it - list.begin());
  list.push_back(item);
  return list.size() - 1;
}

// The keys of the field's tables of features, such as nr.log2_table.
std::vector<std::string> table_keys(const std::string& field) {
  std::vector<std::string> keys;
  for (const ConfigKey& k : describe(Config{})) {
    if (k.key.rfind(field + ".", 0) == 0 && k.key.size() > 10 && k.key.substr(k.key.size() - 10) == "log2_table")
      keys.push_back(k.key);
  }
  return keys;
}

// Chooses the size of the field's tables so that its model has about `bytes`.
void match_bytes(const Config& base, double bytes, std::map<std::string, std::string>& keys) {
  const std::vector<std::string> tables = table_keys(base.field);
  double best = 1e300;
  for (int log2 = 10; log2 <= 24 && !tables.empty(); ++log2) {
    Config config = base;
    for (const std::string& key : tables) set(config, key, std::to_string(log2));
    const ModelFileSize size = estimate_model_file_size(config, {});
    const double off = std::abs(std::log((size.total - size.optimizer) / bytes));
    if (off >= best) continue;
    best = off;
    for (const std::string& key : tables) keys[key] = std::to_string(log2);
  }
}

std::string budget_text(const Training& t) {
  return t.steps > 0 ? fmt::format("{}steps", t.steps) : fmt::format("{:g}s", t.seconds);
}

}  // namespace

std::string camera_file(const std::string& scene, const ViewSpec& view) {
  return fmt::format("cameras/{}-{}-{}.json", scene, view.name, hash_of(view.camera));
}

std::vector<std::string> tables_words(const PaperScene& scene, const std::string& preset,
                                      const std::vector<const std::map<std::string, std::string>*>& keys) {
  std::vector<std::string> words = {"info", scene.file, "--preset", preset};
  for (const auto* some : keys) {
    for (const auto& [key, value] : *some) {
      if (key.starts_with("octree.") || key.starts_with("disparity.") || key == "lookup.offset")
        words.insert(words.end(), {"-D", key + "=" + value});
    }
  }
  return words;
}

double Scale::batch() const { return std::exp2(std::round(std::log2(factor) / 3.0)); }
int Scale::width(int full) const {
  return std::min(full, std::max(64, 2 * static_cast<int>(std::lround(full * std::pow(factor, 0.25) / 2.0))));
}
int Scale::half_spp(int full) const {
  return std::max(1, std::min(full / 2, std::max(8, static_cast<int>(std::lround(full * std::sqrt(factor) / 2.0)))));
}

SceneChoice choose_scenes(const std::string& list) {
  SceneChoice choice;
  std::size_t begin = 0;
  while (begin <= list.size()) {
    const std::size_t end = std::min(list.find(',', begin), list.size());
    const std::string word = list.substr(begin, end - begin);
    begin = end + 1;
    if (word.empty()) continue;
    if (!fs::exists(word)) throw IoError(fmt::format("--scenes: {} does not exist", word));
    if (!fs::is_directory(word)) {
      choice.files.push_back({scene_name(fs::absolute(word)), fs::absolute(word).lexically_normal().string()});
      continue;
    }
    std::vector<SceneInput> found;
    for (const auto& entry : fs::directory_iterator(word)) {
      const fs::path file = entry.path() / "scene.xml";
      if (fs::is_regular_file(file))
        found.push_back({scene_name(fs::absolute(file)), fs::absolute(file).lexically_normal().string()});
    }
    if (found.empty()) throw InputError(fmt::format("--scenes: {} holds no scene (FOLDER/NAME/scene.xml)", word));
    sort_scenes(found);
    choice.found.insert(choice.found.end(), found.begin(), found.end());
  }
  std::map<std::string, std::string> names;
  for (const auto* scenes : {&choice.files, &choice.found}) {
    for (const SceneInput& s : *scenes) {
      const auto [it, is_new] = names.emplace(s.name, s.file);
      if (!is_new)
        throw InputError(fmt::format("--scenes: {} and {} have the same name, {}", it->second, s.file, s.name));
    }
  }
  if (names.empty()) throw UsageError("--scenes: expected scene files or folders of scenes");
  return choice;
}

std::vector<SceneInput> SceneChoice::of(const Matrix& matrix) const {
  if (matrix.scenes.empty() || found.empty()) {
    std::vector<SceneInput> all = files;
    all.insert(all.end(), found.begin(), found.end());
    return all;
  }
  std::vector<SceneInput> out = files;
  std::vector<std::string> names;
  for (const SceneInput& s : found) names.push_back(s.name);
  for (const std::string& name : matrix.scenes) {
    const auto it = std::find_if(found.begin(), found.end(), [&](const SceneInput& s) { return s.name == name; });
    if (it == found.end())
      throw InputError(fmt::format("{}: unknown scene \"{}\"{}; there are {}", matrix.name, name,
                                   did_you_mean(name, names), join(names)));
    out.push_back(*it);
  }
  return out;
}

namespace {

// A camera that moves to its right by a fiftieth of the scene's diagonal, without turning.
nlohmann::json sideways(const PaperScene& scene) {
  const nlohmann::json& camera = scene.info.at("cameras").at(0);
  const auto vector = [](const nlohmann::json& v) {
    return Vec3f{v.at(0).get<float>(), v.at(1).get<float>(), v.at(2).get<float>()};
  };
  const Vec3f origin = vector(camera.at("origin")), forward = vector(camera.at("forward")),
              up = vector(camera.at("up"));
  const auto& bounds = scene.info.at("bounds");
  const Vec3f step =
      normalize(cross(forward, up)) * (0.02f * length(vector(bounds.at("upper")) - vector(bounds.at("lower"))));
  nlohmann::json keys = nlohmann::json::array();
  for (const Vec3f from : {origin, origin + step}) {
    keys.push_back({{"origin", vector_json(from)},
                    {"target", vector_json(from + forward)},
                    {"up", vector_json(up)},
                    {"fov", camera.at("fov")}});
    if (camera.at("mirrored") == true) keys.back()["mirrored"] = true;
  }
  return {{"keys", keys}};
}

// Cameras as hashes take them. What `info` came to say of them later counts where it is another than that of most
// scenes, so that those keep their folders.
nlohmann::json hashed_cameras(const nlohmann::json& cameras) {
  const auto pair = [](Vec2f v) { return nlohmann::json::array({v.x, v.y}); };
  static const Camera usual;
  static const nlohmann::json later = {{"type", "perspective"},
                                       {"mirrored", false},
                                       {"fov_axis", "x"},
                                       {"near_clip", usual.near_clip},
                                       {"far_clip", usual.far_clip},
                                       {"principal_point_offset", pair(usual.principal_point_offset)},
                                       {"crop_offset", pair(usual.crop_offset)},
                                       {"crop_size", pair(usual.crop_size)},
                                       {"filter", {{"type", "box"}}}};
  nlohmann::json out = cameras;
  for (nlohmann::json& camera : out) {
    for (const auto& [key, value] : later.items()) {
      if (camera.contains(key) && camera[key] == value) camera.erase(key);
    }
  }
  return out;
}

// Makes the cells of one matrix and scene; what has the same settings as something there is that.
struct Planner {
  Plan& plan;
  const std::function<double(std::size_t, const Matrix&, const Switch&)>& octaoctree_bytes;
  std::size_t m = 0, s = 0;  // matrix and scene
  std::vector<std::size_t> references = {};
  std::optional<std::size_t> film = {};

  const Matrix& matrix() const { return plan.matrices[m]; }
  const PaperScene& scene() const { return plan.scenes[s]; }
  nlohmann::json fingerprint() const {
    nlohmann::json seen = {scene().info.at("fingerprint"), hashed_cameras(scene().info.at("cameras"))};
    if (scene().info.at("hide_emitters").get<bool>()) seen.push_back("emitters hidden");
    return seen;
  }

  void add_references() {
    for (const ViewSpec& spec : views_of(matrix(), scene())) {
      Reference r{s, make_view(matrix(), scene(), spec, plan.scale), plan.scale.half_spp(matrix().reference_spp), ""};
      r.folder = fmt::format("references/{}/{}-{}x{}-{}spp.{}", scene().name, spec.name, r.view.width, r.view.height,
                             2 * r.half_spp, hash_of({fingerprint(), r.view.words, r.half_spp}));
      references.push_back(find_or_add(plan.references, r));
    }
  }

  void add_film() {
    if (matrix().temporal_frames == 0) return;
    Film f;
    f.scene = s;
    const auto own = matrix().paths.find(scene().name);
    f.path = own == matrix().paths.end() ? sideways(scene()) : own->second;
    f.path.erase("duration");
    f.path["frames"] = matrix().temporal_frames;
    const View& view = plan.references[references.front()].view;
    f.width = view.width;
    f.height = view.height;
    f.spp = plan.scale.film_spp(matrix().temporal_spp);
    f.folder = fmt::format("references/{}/film-{}x{}-{}spp.{}", scene().name, f.width, f.height, f.spp,
                           hash_of({fingerprint(), f.path, f.width, f.height, f.spp}));
    film = find_or_add(plan.films, f);
  }

  // Right-hand sides a step, a mean over the quarters of the schedule.
  static double mean_queries(const Config& config) {
    double sum = 0.0;
    for (const double fraction : kQuarters) {
      const ScheduleState s = schedule(config, 0, fraction);
      sum += static_cast<double>(s.points) * s.directions;
    }
    return sum / static_cast<double>(std::size(kQuarters));
  }

  std::size_t add_training(const Method& method, const Switch& sw, Equal equal, long long seed) {
    Training t;
    t.scene = s;
    t.field = method.field;
    t.preset = matrix().preset;
    t.seed = seed;
    t.keys = matrix().keys;
    for (const auto& [key, value] : sw.keys) t.keys[key] = value;
    Config config = preset(t.preset);
    set(config, "field", t.field);
    for (const auto& [key, value] : t.keys) set(config, key, value);
    const int points =
        std::min(config.train_points, std::max(128, static_cast<int>(config.train_points * plan.scale.batch())));
    const double batch = static_cast<double>(points) / config.train_points;
    Config scaled = config;
    if (batch < 1.0) {
      scaled.train_points = points;
      t.keys["train.points"] = std::to_string(points);
      if (config.train_first_points > 0) {
        scaled.train_first_points = std::max(64, static_cast<int>(config.train_first_points * batch));
        t.keys["train.first_points"] = std::to_string(scaled.train_first_points);
      }
    }
    t.work = mean_queries(scaled);
    if (equal == Equal::bytes && t.field != "octaoctree")
      match_bytes(config, octaoctree_bytes(s, matrix(), sw), t.keys);
    if (equal == Equal::steps) {
      t.steps = std::min(matrix().steps,
                         std::max(20LL, std::llround(static_cast<double>(matrix().steps) * plan.scale.factor / batch)));
    } else {
      const double seconds = std::min(matrix().seconds, std::max(0.3, matrix().seconds * plan.scale.factor));
      t.seconds = seconds > 10.0 ? std::round(seconds) : std::round(seconds * 100.0) / 100.0;
    }
    for (const std::size_t r : references) {
      if (plan.references[r].view.first_sensor) t.reference = r;
    }
    // With every value: presets change from version to version.
    nlohmann::json values = nlohmann::json::array();
    for (const ConfigKey& key : describe(config)) values.push_back(key.key + "=" + key.value);
    const std::string hash = hash_of({fingerprint(), values, t.keys, seed, t.seconds, t.steps});
    t.folder = fmt::format("models/{}/{}-{}s{}-{}.{}", scene().name, t.field, sw.keys.empty() ? "" : sw.name + "-",
                           seed, budget_text(t), hash);
    return find_or_add(plan.trainings, t);
  }

  void add_cell(const Method& method, const Switch& sw, Equal equal, long long seed) {
    Cell cell;
    cell.scene = s;
    cell.method = &method;
    cell.seed = seed;
    cell.references = references;
    const auto spp = matrix().spp.find(method.name);
    cell.spp = spp == matrix().spp.end() ? method.spp : spp->second;
    nlohmann::json settings = {fingerprint(), method.name, cell.spp, seed};
    for (const std::size_t r : references) settings.push_back(plan.references[r].folder);
    if (traces_paths(method)) settings.push_back("every bounce");
    std::string name = method.name;
    if (*method.field != '\0') {
      cell.training = add_training(method, sw, equal, seed);
      const Training& training = plan.trainings[*cell.training];
      settings.push_back(hash_in(training.folder));
      name += fmt::format("-{}s{}-{}", sw.keys.empty() ? "" : sw.name + "-", seed, budget_text(training));
    } else {
      name += fmt::format("-s{}", seed);
    }
    cell.folder = fmt::format("cells/{}/{}.{}", scene().name, name, hash_of(settings));
    Cell& kept = plan.cells[find_or_add(plan.cells, cell)];
    kept.places.push_back({m, sw.name, equal});
    if (film && !kept.film) kept.film = film;
    kept.learned |= matrix().learned && std::string(method.name) == "octaoctree" && equal == matrix().equal.front() &&
                    seed == matrix().seeds.front() && &sw == &matrix().switches.front();
  }

  void add_cells() {
    for (const Method* method : matrix().methods) {
      const bool trained = *method->field != '\0';
      for (const Switch& sw : matrix().switches) {
        const bool first = &sw == &matrix().switches.front();
        if (!trained && !first) continue;  // it has no keys
        if (!first && !sw.keys.empty() && std::all_of(sw.keys.begin(), sw.keys.end(), [&](const auto& k) {
              return ignores_key(field_entry(method->field), k.first);
            }))
          continue;
        for (const Equal equal : matrix().equal) {
          for (const long long seed : matrix().seeds) add_cell(*method, sw, equal, seed);
        }
      }
    }
  }
};

}  // namespace

Plan make_plan(std::vector<Matrix> matrices, const std::vector<PaperScene>& plan_scenes,
               const std::vector<std::vector<std::size_t>>& scenes, Scale scale,
               const std::function<double(std::size_t, const Matrix&, const Switch&)>& octaoctree_bytes) {
  Plan plan;
  plan.matrices = std::move(matrices);
  plan.scale = scale;
  plan.scenes = plan_scenes;
  for (std::size_t m = 0; m < plan.matrices.size(); ++m) {
    for (const std::size_t s : scenes[m]) {
      Planner planner{plan, octaoctree_bytes, m, s};
      planner.add_references();
      planner.add_film();
      planner.add_cells();
    }
  }
  return plan;
}

std::string temporal_folder(const Plan& plan, const Cell& cell) {
  return cell.film ? cell.folder + "/temporal." + hash_in(plan.films[*cell.film].folder) : "";
}

std::vector<int> ladder_spp(const Plan& plan, const Cell& cell) {
  if (std::string(cell.method->name) != "path") return {};
  for (const Place& place : cell.places) {
    if (!plan.matrices[place.matrix].path_spp.empty()) return plan.matrices[place.matrix].path_spp;
  }
  return {};
}

std::string ladder_folder(const Plan& plan, const Cell& cell) {
  const std::vector<int> spp = ladder_spp(plan, cell);
  return spp.empty() ? "" : cell.folder + "/ladder." + hash_of(spp);
}

bool traces_paths(const Method& method) {
  return std::string(method.integrator) == "path" || std::string(method.integrator) == "denoised";
}

std::string cell_label(const Plan& plan, const Cell& cell, const Place& place) {
  return fmt::format("{}/{}/{}/{}/{}/s{}", plan.matrices[place.matrix].name, plan.scenes[cell.scene].name,
                     cell.method->name, place.switch_name.empty() ? "-" : place.switch_name, equal_name(place.equal),
                     cell.seed);
}

void select_cells(Plan& plan, const std::string& patterns) {
  if (patterns.empty()) return;
  bool any = false;
  for (Cell& cell : plan.cells) {
    cell.selected = false;
    for (const Place& place : cell.places) {
      const std::string label = cell_label(plan, cell, place);
      std::size_t begin = 0;
      while (begin <= patterns.size()) {
        const std::size_t end = std::min(patterns.find(',', begin), patterns.size());
        const std::string word = patterns.substr(begin, end - begin);
        begin = end + 1;
        if (!word.empty() && fnmatch(("*" + word + "*").c_str(), label.c_str(), 0) == 0) cell.selected = true;
      }
    }
    any |= cell.selected;
  }
  if (!any)
    throw UsageError(fmt::format("--only {}: no cell has that in its name; names are like {}", patterns,
                                 cell_label(plan, plan.cells.front(), plan.cells.front().places.front())));
}

}  // namespace octrad::paper
