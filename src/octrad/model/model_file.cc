#include "octrad/model/model_file.h"

#include <fmt/format.h>

#include <climits>
#include <cmath>
#include <nlohmann/json.hpp>

#include "octrad/base/bytes.h"
#include "octrad/base/error.h"
#include "octrad/base/guide_layout.h"
#include "octrad/base/json_file.h"
#include "octrad/base/memory_limit.h"
#include "octrad/base/version.h"
#include "octrad/encoding/octaoctree.h"
#include "octrad/model/field_registry.h"
#include "octrad/model/field_storage.h"
#include "octrad/model/safetensors.h"

namespace octrad {
namespace {

constexpr const char* kFormat = "octrad";
constexpr const char* kFormatVersion = "1";

ModelInfo info_of(const TensorReader& in) {
  const auto& metadata = in.metadata();
  const auto text = [&](const char* key) {
    const auto found = metadata.find(key);
    if (found == metadata.end())
      throw InputError(in.file() + ": not an octrad model: the header lacks \"" + key + "\"");
    return found->second;
  };
  if (text("format") != kFormat)
    throw InputError(in.file() + ": not an octrad model (format \"" + text("format") + "\")");
  if (text("version") != kFormatVersion)
    throw InputError(in.file() + ": format version " + text("version") + "; this program reads version " +
                     kFormatVersion);
  ModelInfo info;
  try {
    const nlohmann::json config = parse_json(text("config"), in.file());
    apply(info.config, config, in.file());
    // What models of earlier versions do not know, where the default is another than what was done before.
    info.state.newer_keys = keys_missing_in(config);
    for (const std::string& key : info.state.newer_keys) {
      Config& c = info.config;
      if (key == "lookup.reflected") c.lookup_reflected = Reflected::none;
      if (key == "lookup.coats") c.lookup_coats = Coats::joined;
      if (key == "lookup.rough_offset") c.lookup_rough_offset = true;
      if (key == "train.average") c.train_average = 0.0;
      if (key == "train.guide") c.train_guide = 0.0;
      if (key == "train.first_points") c.train_first_points = 0;
      if (key == "train.area_falls") c.train_area_falls = false;
      if (key == "train.far_ends") c.train_far_ends = 0.0;
      if (key == "adam.rate.budget") c.adam_rate_budget = 0;
      if (key == "loss.power") c.loss_power = 2.0;
      if (key == "render.trace_below") c.render_trace_below = 0.0;
      if (key == "render.coat_samples") c.render_coat_samples = preset(c.preset).render_coat_samples;
      if (key == "render.metal_samples") c.render_metal_samples = preset(c.preset).render_metal_samples;
      if (key == "render.offset_spread") c.render_offset_spread = preset(c.preset).render_offset_spread;
    }
    field_entry(info.config.field).cell_levels(info.config);  // throws where there are too many
    const nlohmann::json scene = parse_json(text("scene"), in.file());
    info.scene_file = scene.at("file").get<std::string>();
    info.scene_fingerprint = scene.at("fingerprint").get<std::string>();
    const nlohmann::json state = parse_json(text("state"), in.file());
    const auto count = [&](const char* key) {
      return whole_number(state.at(key), 0, LLONG_MAX, in.file() + ": broken model header: " + key);
    };
    info.state.step = count("step");
    info.state.seconds = state.at("seconds").get<double>();
    info.state.lhs_samples = count("lhs_samples");
    info.state.rhs_queries = count("rhs_queries");
    info.state.loss = state.value("loss", -1.0);  // older files have neither
    info.state.sensors = state.value("sensors", std::string());
    for (const auto& key : state.value("newer_keys", std::vector<std::string>())) info.state.newer_keys.push_back(key);
  } catch (const nlohmann::json::exception& e) {
    throw InputError(in.file() + ": broken model header: " + e.what());
  } catch (const UsageError& e) {
    throw InputError(in.file() + ": broken model header: " + e.what());
  }
  if (!(info.state.seconds >= 0.0) || !std::isfinite(info.state.loss))
    throw InputError(in.file() + ": broken model header: seconds must not be negative");
  if (!(info.config.target_scale > 0.0))
    throw InputError(in.file() + ": broken model header: target.scale of a trained model must be above 0");
  info.program = text("program");
  return info;
}

Vec3f read_vec3(const TensorReader& in, const std::string& name) {
  float v[3];
  in.read(in.get(name, DType::f32, {3}), v);
  const Vec3f result{v[0], v[1], v[2]};
  if (!is_finite(result)) throw InputError(in.file() + ": " + name + " is not finite");
  return result;
}

FieldDomain read_domain(const TensorReader& in, const Config& config) {
  FieldDomain domain;
  domain.origin = read_vec3(in, "octree.origin");
  domain.size = read_vec3(in, "octree.size");
  if (min_component(domain.size) <= 0.0f) throw InputError(in.file() + ": octree.size must be positive");
  const int levels = field_entry(config.field).cell_levels(config);
  for (int l = 1; l <= levels; ++l) {
    const std::string name = "octree.level" + std::to_string(l) + ".cells";
    const auto t = in.get(name, DType::i32, {-1, 3});
    ask_memory(t.bytes, in.file());  // files may have holes: what they hold may be more than their disk
    std::vector<Vec3i> cells(static_cast<std::size_t>(t.shape[0]));
    in.read(t, cells.data());
    const int resolution = spatial_resolution(l);
    for (const Vec3i& c : cells) {
      if (min_component(c) < 0 || max_component(c) >= resolution)
        throw InputError(in.file() + ": " + name + " has a cell outside the level's grid");
    }
    domain.occupied_cells.push_back(std::move(cells));
  }
  return domain;
}

// Of the field that steps move, where the weights of the file are averages of its own.
constexpr const char* kTrained = "optimizer.trained.";

void load_trained(const TensorReader& in, RadianceField& field) {
  for (const WeightArray& array : field.weights())
    read_floats(in, kTrained + array.name, {static_cast<std::int64_t>(array.values.size())}, array.values);
  field.weights_changed();
}

constexpr const char* kFarEndRays = "optimizer.far_ends.rays";
constexpr const char* kFarEndHits = "optimizer.far_ends.hits";

void read_far_ends(const TensorReader& in, TrainingState& state) {
  if (!in.has(kFarEndRays)) return;
  const auto rays = in.get(kFarEndRays, DType::f32, {-1, 9});
  const auto hits = in.get(kFarEndHits, DType::i32, {rays.shape[0], 3});
  ask_memory(rays.bytes + hits.bytes, in.file());
  state.far_end_rays.resize(static_cast<std::size_t>(rays.shape[0]));
  state.far_end_hits.resize(state.far_end_rays.size());
  in.read(rays, state.far_end_rays.data());
  in.read(hits, state.far_end_hits.data());
  for (const auto& ray : state.far_end_rays) {
    for (const float number : ray)
      if (!std::isfinite(number)) throw InputError(in.file() + ": " + kFarEndRays + " is not finite");
  }
}

// Calls tensor(name, type, numbers of a table, vector) for all that a guide holds of its tables.
template <typename State, typename Tensor>
void each_guide_tensor(State& state, Tensor tensor) {
  tensor("optimizer.guide.rows", DType::f32, kGuideRows, state.guide_rows);
  tensor("optimizer.guide.columns", DType::f32, kGuideParts, state.guide_columns);
  tensor("optimizer.guide.means", DType::f32, 1, state.guide_means);
  tensor("optimizer.guide.squares", DType::u64, kGuideParts, state.guide_squares);
  tensor("optimizer.guide.alone", DType::u64, 1, state.guide_bsdf_squares);
  tensor("optimizer.guide.targets", DType::u64, 1, state.guide_targets);
  tensor("optimizer.guide.samples", DType::u64, 1, state.guide_samples);
}

constexpr const char* kGuideBox = "optimizer.guide.box";

void read_guide(const TensorReader& in, TrainingState& state) {
  ask_memory(kGuideBytes, in.file());
  in.read(in.get(kGuideBox, DType::f32, {7}), state.guide_box.data());
  each_guide_tensor(state, [&](const char* name, DType type, int of_table, auto& numbers) {
    numbers.resize(static_cast<std::size_t>(kGuideTables * of_table));
    in.read(in.get(name, type, {kGuideTables * of_table}), numbers.data());
  });
}

void write_guide(TensorWriter& out, const TrainingState& state) {
  out.add(kGuideBox, DType::f32, {7}, state.guide_box.data());
  each_guide_tensor(state, [&](const char* name, DType type, int, const auto& numbers) {
    out.add(name, type, {static_cast<std::int64_t>(numbers.size())}, numbers.data());
  });
}

}  // namespace

void save_model(const std::string& file, RadianceField& field, const ModelInfo& info, bool optimizer,
                RadianceField* trained) {
  if (optimizer && trained == nullptr && info.config.train_average > 0.0)
    throw InputError(file + ": averages (train.average) cannot be trained on without the weights that steps move");
  TensorWriter out;
  out.metadata("format", kFormat);
  out.metadata("version", kFormatVersion);
  Config config = info.config;
  config.target_scale = static_cast<double>(field.target_scale());
  out.metadata("config", json_text(to_json(config)));
  out.metadata("scene", json_text({{"file", info.scene_file}, {"fingerprint", info.scene_fingerprint}}));
  out.metadata("program", std::string("octrad ") + kVersion);
  out.metadata("step", std::to_string(info.state.step));
  out.metadata("seed", std::to_string(config.seed));
  nlohmann::json state = {{"step", info.state.step},
                          {"seconds", info.state.seconds},
                          {"lhs_samples", info.state.lhs_samples},
                          {"rhs_queries", info.state.rhs_queries}};
  if (info.state.loss >= 0.0) state["loss"] = info.state.loss;
  if (!info.state.sensors.empty()) state["sensors"] = info.state.sensors;
  if (!info.state.newer_keys.empty()) state["newer_keys"] = info.state.newer_keys;
  out.metadata("state", state.dump());
  field.save(out);
  if (optimizer && trained != nullptr) {
    for (const WeightArray& array : trained->weights())
      out.add(kTrained + array.name, DType::f32, {static_cast<std::int64_t>(array.values.size())}, array.values.data());
  }
  if (optimizer) (trained != nullptr ? *trained : field).save_optimizer(out);
  if (const auto count = static_cast<std::int64_t>(info.state.far_end_rays.size()); optimizer && count > 0) {
    out.add(kFarEndRays, DType::f32, {count, 9}, info.state.far_end_rays.data());
    out.add(kFarEndHits, DType::i32, {count, 3}, info.state.far_end_hits.data());
  }
  if (optimizer && !info.state.guide_rows.empty()) write_guide(out, info.state);
  out.write(file);
}

ModelFileSize model_file_size(const TensorReader& file) {
  ModelFileSize size;
  for (const std::string& name : file.names()) {
    const auto bytes = static_cast<double>(file.get(name).bytes);
    size.total += bytes;
    if (name.starts_with("optimizer.")) size.optimizer += bytes;
    else if (name.ends_with(".features") || name.ends_with(".table")) size.features += bytes;
  }
  return size;
}

ModelFileSize estimate_model_file_size(const Config& config, const std::vector<long long>& cells_per_level) {
  ModelFileSize size;
  for (const MemoryPart& part : estimate_memory(config, cells_per_level, true)) {
    if (part.name.ends_with(kFeaturesPart)) size.features += static_cast<double>(part.bytes);
    if (part.name.ends_with(kOptimizerPart) || part.name.ends_with(kAveragesPart))
      size.optimizer += static_cast<double>(part.bytes);
  }
  if (config.train_guide > 0.0) size.optimizer += static_cast<double>(kGuideBytes);
  size.total = size.features + size.optimizer;
  for (const long long cells : cells_per_level) size.total += static_cast<double>(cells) * sizeof(Vec3i);
  return size;
}

namespace {

// A configuration is a few words and its tables may be gigabytes: before they are allocated, what the file holds must
// be about as much (half precision takes half), and the memory budget is asked.
void check_memory(const TensorReader& in, const Config& config, const FieldDomain& domain, bool optimizer) {
  const std::vector<long long> cells = domain.cells_per_level();
  const double needed = estimate_model_file_size(config, cells).features, held = model_file_size(in).features;
  if (needed > 2.0 * held)
    throw InputError(fmt::format("{} is not a usable model file: its configuration needs tables of {}, and it holds {}",
                                 in.file(), format_bytes(needed), format_bytes(held)));
  ask_memory(total_bytes(estimate_memory(config, cells, optimizer)), in.file());
}

}  // namespace

Model load_model(const std::string& file, bool optimizer) {
  const TensorReader in(file);
  Model model;
  model.info = info_of(in);
  model.has_optimizer = optimizer && has_optimizer(in);
  const FieldDomain domain = read_domain(in, model.info.config);
  const bool averaged = optimizer && model.info.config.train_average > 0.0;
  check_memory(in, model.info.config, domain, model.has_optimizer || averaged);
  try {
    model.field = make_field(model.info.config, domain);
    if (averaged) model.trained = make_field(model.info.config, domain);
  } catch (const InputError& error) {
    throw InputError(in.file() + " is not a usable model file: " + error.what());
  }
  model.field->load(in);
  if (averaged && model.has_optimizer) load_trained(in, *model.trained);
  else if (averaged) approach(*model.trained, *model.field, 1.0f);
  if (model.has_optimizer) {
    (averaged ? model.trained : model.field)->load_optimizer(in);
    read_far_ends(in, model.info.state);
    if (model.info.config.train_guide > 0.0) read_guide(in, model.info.state);
  }
  for (RadianceField* field : {model.field.get(), model.trained.get()})
    if (field != nullptr) field->set_target_scale(static_cast<float>(model.info.config.target_scale));
  in.require_unchanged();
  return model;
}

void check_scene(const std::string& file, const ModelInfo& info, const std::string& scene_file,
                 const std::string& fingerprint, bool force, const char* way_out) {
  if (force || info.scene_fingerprint == fingerprint) return;
  const char* why =
      info.scene_file == scene_file ? " (its files have changed since, or lights or materials were edited)" : "";
  throw InputError(file + " was trained on another scene: " + info.scene_file + " (fingerprint " +
                   info.scene_fingerprint + "), not " + scene_file + " (" + fingerprint + ")" + why + "; " + way_out);
}

}  // namespace octrad
