#include "app/paper/matrix.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <set>

#include "octrad/base/duration.h"
#include "octrad/base/error.h"
#include "octrad/base/input_file.h"
#include "octrad/base/join.h"
#include "octrad/base/json_file.h"
#include "octrad/model/config.h"

namespace octrad::paper {
namespace {

constexpr std::array kMethods = {
    Method{"octaoctree", "OctaOctree", "octaoctree", "lhs", 4, false},
    Method{"ncr", "Neural Cone Radiosity", "ncr", "lhs", 4, false},
    Method{"nr", "Neural Radiosity", "nr", "lhs", 4, false},
    Method{"oidn", "path tracing, denoised", "", "denoised", 4, false},
    Method{"lhs-oidn", "OctaOctree, denoised", "octaoctree", "lhs", 4, true},
    Method{"nr-rhs", "NR-RHS", "nr", "rhs", 16, false},
    Method{"ncr-rhs", "NCR-RHS", "ncr", "rhs", 16, false},
    Method{"octaoctree-rhs", "OctaOctree-RHS", "octaoctree", "rhs", 16, false},
    Method{"nr-deferred", "NR, deferred", "nr", "deferred", 16, false},
    Method{"ncr-deferred", "NCR, deferred", "ncr", "deferred", 16, false},
    Method{"octaoctree-deferred", "OctaOctree, deferred", "octaoctree", "deferred", 16, false},
    Method{"path", "path tracing", "", "path", 4, false},
};

constexpr std::array kEquals = {std::pair{"seconds", Equal::seconds}, std::pair{"steps", Equal::steps},
                                std::pair{"bytes", Equal::bytes}};

const std::vector<std::string> kKeys = {
    "title",        "about", "scenes", "views", "methods", "switches",      "seeds",   "equal",    "preset",
    "keys",         "time",  "steps",  "spp",   "width",   "reference_spp", "learned", "path_spp", "temporal_frames",
    "temporal_spp", "paths"};

// A value in a message; not all of a list.
std::string shown(const nlohmann::json& v) { return v.is_primitive() ? v.dump() : v.type_name(); }

// Reads members of one JSON object; messages say "FILE: KEY: ...".
class Reader {
 public:
  Reader(const nlohmann::json& object, std::string place) : object_(object), place_(std::move(place)) {
    if (!object.is_object()) fail("", "expected an object {...}");
  }
  const nlohmann::json* find(const char* key) const {
    const auto it = object_.find(key);
    return it == object_.end() ? nullptr : &*it;
  }
  [[noreturn]] void fail(const std::string& key, const std::string& what) const {
    throw InputError(place_ + ": " + (key.empty() ? "" : key + ": ") + what);
  }
  void text(const char* key, std::string& to) const {
    if (const auto* v = find(key)) {
      if (!v->is_string()) fail(key, "expected a text");
      to = v->get<std::string>();
    }
  }
  void flag(const char* key, bool& to) const {
    if (const auto* v = find(key)) {
      if (!v->is_boolean()) fail(key, "expected true or false");
      to = v->get<bool>();
    }
  }
  template <typename T>
  T whole(const nlohmann::json& v, const std::string& key, long long low, long long high) const {
    return static_cast<T>(whole_number(v, low, high, place_ + ": " + key));
  }
  template <typename T>
  void number(const char* key, long long low, long long high, T& to) const {
    if (const auto* v = find(key)) to = whole<T>(*v, key, low, high);
  }
  // The elements of a list that must not be empty; a single value counts as a list of one.
  std::vector<nlohmann::json> list(const char* key) const {
    const auto* v = find(key);
    if (!v) return {};
    if (!v->is_array()) return {*v};
    if (v->empty()) fail(key, "the list is empty");
    return *v;
  }
  std::vector<std::string> texts(const char* key) const {
    std::vector<std::string> out;
    for (const auto& v : list(key)) {
      if (!v.is_string()) fail(key, shown(v) + " where a text is expected");
      out.push_back(v.get<std::string>());
      if (std::count(out.begin(), out.end(), out.back()) > 1) fail(key, "\"" + out.back() + "\" is there twice");
    }
    return out;
  }

 private:
  const nlohmann::json& object_;
  std::string place_;
};

std::string config_text(const nlohmann::json& v) { return v.is_string() ? v.get<std::string>() : v.dump(); }

// Configuration keys of trainings, checked against the preset.
std::map<std::string, std::string> read_keys(const Reader& reader, const std::string& where,
                                             const nlohmann::json& object, const std::string& preset_name) {
  if (!object.is_object()) reader.fail(where, "expected an object of configuration keys");
  static const std::set<std::string> kOwn = {"field", "seed", "preset", "train.time", "train.steps"};
  std::map<std::string, std::string> out;
  for (const auto& [key, value] : object.items()) {
    if (kOwn.count(key) > 0) reader.fail(where, key + " is not for keys: the matrix has members of its own for it");
    if (!value.is_primitive() || value.is_null())
      reader.fail(where, key + ": expected a number, a text, true or false");
    try {
      Config config = preset(preset_name);
      set(config, key, config_text(value));
    } catch (const Error& error) {
      reader.fail(where, error.what());
    }
    out[key] = config_text(value);
  }
  return out;
}

bool plain_name(const std::string& name) {
  return !name.empty() && name != "." && name != ".." && name.size() <= 64 &&
         name.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_.=") ==
             std::string::npos;
}

std::vector<ViewSpec> read_views(const Reader& reader, const std::string& scene, const nlohmann::json& list,
                                 const std::filesystem::path& folder) {
  const std::string where = "views: " + scene;
  if (!list.is_array() || list.empty()) reader.fail(where, "expected a list of sensors (numbers) and cameras");
  std::vector<ViewSpec> views;
  for (const auto& v : list) {
    ViewSpec view;
    if (v.is_number()) {
      view.sensor = reader.whole<int>(v, where, 0, 1 << 20);
      view.name = fmt::format("sensor{}", view.sensor);
    } else {
      view.camera = v;
      if (v.is_string()) view.camera = read_json_file((folder / v.get<std::string>()).string());
      if (!view.camera.is_object()) reader.fail(where, "expected a number, a camera {...} or the name of its file");
      view.name = v.is_string() ? std::filesystem::path(v.get<std::string>()).stem().string() : "";
      if (view.camera.contains("name") && view.camera["name"].is_string()) view.name = view.camera["name"];
      if (!plain_name(view.name))
        reader.fail(where, "a camera needs a \"name\" of letters, digits, - and _ for the names of its files");
    }
    for (const ViewSpec& other : views) {
      if (other.name == view.name) reader.fail(where, "two views are named " + view.name);
    }
    views.push_back(view);
  }
  return views;
}

void read_switches(const Reader& reader, const nlohmann::json& list, Matrix& m) {
  const char* expected = "expected a list of {\"name\": \"...\", \"keys\": {configuration keys}}";
  if (!list.is_array() || list.empty()) reader.fail("switches", expected);
  m.switches.clear();
  for (const auto& item : list) {
    if (!item.is_object() || !item.contains("name") || !item["name"].is_string()) reader.fail("switches", expected);
    Switch added;
    added.name = item["name"];
    if (!plain_name(added.name)) reader.fail("switches", "\"" + added.name + "\": use letters, digits, - and _");
    for (const auto& [key, value] : item.items()) {
      if (key == "keys") added.keys = read_keys(reader, "switches: " + added.name, value, m.preset);
      else if (key != "name") reader.fail("switches: " + added.name, "unknown key \"" + key + "\"; " + expected);
    }
    for (const Switch& other : m.switches) {
      if (other.name == added.name) reader.fail("switches", "two are named " + added.name);
    }
    m.switches.push_back(added);
  }
}

}  // namespace

std::span<const Method> methods() { return kMethods; }

const Method* find_method(const std::string& name) {
  const auto it = std::find_if(kMethods.begin(), kMethods.end(), [&](const Method& m) { return m.name == name; });
  return it == kMethods.end() ? nullptr : &*it;
}

const char* equal_name(Equal equal) {
  return std::find_if(kEquals.begin(), kEquals.end(), [&](const auto& e) { return e.second == equal; })->first;
}

Matrix parse_matrix(const std::string& text, const std::string& file) {
  const nlohmann::json object = parse_json(text, file);
  const Reader reader(object, file);
  for (const auto& [key, value] : object.items()) {
    if (std::find(kKeys.begin(), kKeys.end(), key) == kKeys.end())
      reader.fail("", fmt::format("unknown key \"{}\"{}; there are {}", key, did_you_mean(key, kKeys), join(kKeys)));
  }
  Matrix m;
  m.name = std::filesystem::path(file).stem().string();
  if (!plain_name(m.name))
    throw InputError(file + ": its name is in names of files: use letters, digits, - and _ for it");
  m.title = m.name;
  reader.text("title", m.title);
  reader.text("about", m.about);
  reader.text("preset", m.preset);
  try {
    preset(m.preset);
  } catch (const Error& error) {
    reader.fail("preset", error.what());
  }
  m.scenes = reader.texts("scenes");

  std::vector<std::string> names;
  for (const Method& method : kMethods) names.push_back(method.name);
  for (const std::string& name : reader.texts("methods")) {
    const Method* method = find_method(name);
    if (!method)
      reader.fail("methods",
                  fmt::format("unknown method \"{}\"{}; there are {}", name, did_you_mean(name, names), join(names)));
    m.methods.push_back(method);
  }
  if (m.methods.empty()) {
    for (const Method& method : kMethods) m.methods.push_back(&method);
  }
  for (const std::string& name : reader.texts("equal")) {
    const auto it = std::find_if(kEquals.begin(), kEquals.end(), [&](const auto& e) { return name == e.first; });
    if (it == kEquals.end()) reader.fail("equal", "\"" + name + "\" where seconds, steps or bytes is expected");
    m.equal.push_back(it->second);
  }
  if (m.equal.empty()) m.equal = {Equal::seconds};
  for (const auto& v : reader.list("seeds")) m.seeds.push_back(reader.whole<long long>(v, "seeds", 0, 1'000'000'000));
  if (m.seeds.empty()) m.seeds = {0};
  if (std::set<long long>(m.seeds.begin(), m.seeds.end()).size() != m.seeds.size())
    reader.fail("seeds", "a seed is there twice");

  if (const auto* keys = reader.find("keys")) m.keys = read_keys(reader, "keys", *keys, m.preset);
  m.switches = {{"", {}}};
  if (const auto* list = reader.find("switches")) read_switches(reader, *list, m);
  if (const auto* views = reader.find("views")) {
    if (!views->is_object()) reader.fail("views", "expected an object: name of the scene, or *, to a list of views");
    for (const auto& [scene, list] : views->items())
      m.views[scene] = read_views(reader, scene, list, std::filesystem::path(file).parent_path());
  }
  if (const auto* time = reader.find("time")) {
    try {
      m.seconds = time->is_number() ? time->get<double>() : parse_duration(config_text(*time));
    } catch (const Error& error) {
      reader.fail("time", error.what());
    }
    if (!(m.seconds > 0.0 && m.seconds < 1e8)) reader.fail("time", "expected a duration above 0");
  }
  reader.number("steps", 1, 100'000'000, m.steps);
  reader.number("width", 16, 16384, m.width);
  reader.number("reference_spp", 2, 1 << 30, m.reference_spp);
  reader.flag("learned", m.learned);
  reader.number("temporal_frames", 2, 10000, m.temporal_frames);
  reader.number("temporal_spp", 1, 1 << 24, m.temporal_spp);
  if (const auto* paths = reader.find("paths")) {
    if (!paths->is_object()) reader.fail("paths", "expected an object: name of the scene to a camera path");
    for (const auto& [scene, path] : paths->items()) {
      nlohmann::json& read = m.paths[scene];
      read = path.is_string()
                 ? read_json_file((std::filesystem::path(file).parent_path() / path.get<std::string>()).string())
                 : path;
      if (!read.is_object()) reader.fail("paths: " + scene, "expected a camera path {...} or the name of its file");
    }
  }
  for (const auto& v : reader.list("path_spp")) m.path_spp.push_back(reader.whole<int>(v, "path_spp", 1, 1 << 24));
  if (const auto* spp = reader.find("spp")) {
    if (!spp->is_object()) reader.fail("spp", "expected an object: method to samples a pixel");
    for (const auto& [name, value] : spp->items()) {
      if (!find_method(name)) reader.fail("spp", "unknown method \"" + name + "\"" + did_you_mean(name, names));
      m.spp[name] = reader.whole<int>(value, "spp: " + name, 1, 1 << 24);
    }
  }
  return m;
}

Matrix read_matrix(const std::string& name_or_file) {
  for (const auto& [name, text] : builtin_matrices()) {
    if (name_or_file == name) return parse_matrix(text, std::string(name) + ".json");
  }
  if (!std::filesystem::exists(name_or_file)) {
    std::vector<std::string> names;
    for (const auto& [name, text] : builtin_matrices()) names.push_back(name);
    throw IoError(fmt::format("{} is no file and no matrix of the program{}; those are {}", name_or_file,
                              did_you_mean(name_or_file, names), join(names)));
  }
  return parse_matrix(read_file(name_or_file), name_or_file);
}

}  // namespace octrad::paper
