// results.json: what is in the folder of a run, in one file.
#include <fmt/format.h>

#include "app/paper/published.h"
#include "app/paper/report.h"

namespace octrad::paper {
namespace {

nlohmann::json matrix_json(const Plan& plan, const Matrix& m) {
  nlohmann::json methods = nlohmann::json::array(), switches = nlohmann::json::array(), equal = nlohmann::json::array();
  for (const Method* method : m.methods) methods.push_back(method->name);
  for (const Switch& s : m.switches) switches.push_back({{"name", s.name}, {"keys", s.keys}});
  for (const Equal e : m.equal) equal.push_back(equal_name(e));
  return {{"name", m.name},
          {"title", m.title},
          {"about", m.about},
          {"methods", methods},
          {"switches", switches},
          {"equal", equal},
          {"seeds", m.seeds},
          {"preset", m.preset},
          {"keys", m.keys},
          {"time", m.seconds},
          {"steps", m.steps},
          {"width", m.width},
          {"reference_spp", m.reference_spp},
          {"width_used", plan.scale.width(m.width)},
          {"reference_spp_used", 2 * plan.scale.half_spp(m.reference_spp)}};
}

// What a command printed and was kept of it; null where there is nothing, or it is broken.
nlohmann::json read_record(const Store& store, const std::string& name) {
  nlohmann::json record = store.read(name);
  return record.is_object() && record.contains("output") && record["output"].is_object() ? record : nlohmann::json();
}

nlohmann::json training_json(const Store& store, const Plan& plan, const Training& t) {
  nlohmann::json out = {
      {"scene", plan.scenes[t.scene].name},
      {"field", t.field},
      {"preset", t.preset},
      {"keys", t.keys},
      {"seed", t.seed},
      {"folder", t.folder},
      {"budget", t.steps > 0 ? nlohmann::json{{"steps", t.steps}} : nlohmann::json{{"seconds", t.seconds}}}};
  const nlohmann::json record = read_record(store, t.folder + "/train.json");
  if (!record.is_object()) return out;
  const nlohmann::json& o = record["output"];
  for (const char* key :
       {"steps", "seconds", "lhs_samples", "rhs_queries", "rhs_queries_per_s", "loss", "validation_mape", "device"})
    out[key] = o.value(key, nlohmann::json());
  out["bytes"] = o.value("model_bytes", std::uint64_t{0}) - o.value("optimizer_bytes", std::uint64_t{0});
  out["entries"] = record.value("entries", 0LL);
  out["peak_bytes"] = record.value("peak_bytes", nlohmann::json());
  out["wall_seconds"] = record.value("seconds", nlohmann::json());
  out["command"] = record.value("command", nlohmann::json());
  out["convergence"] = record.value("convergence", nlohmann::json::array());
  return out;
}

// One entry a view of the cell.
void add_cell(const Store& store, const Plan& plan, const Cell& cell, const std::vector<nlohmann::json>& trainings,
              nlohmann::json& cells) {
  nlohmann::json places = nlohmann::json::array();
  for (const Place& p : cell.places)
    places.push_back(
        {{"matrix", plan.matrices[p.matrix].name}, {"switch", p.switch_name}, {"equal", equal_name(p.equal)}});
  nlohmann::json base = {{"scene", plan.scenes[cell.scene].name},
                         {"method", cell.method->name},
                         {"field", *cell.method->field ? nlohmann::json(cell.method->field) : nlohmann::json()},
                         {"switch", cell.places.front().switch_name},
                         {"seed", cell.seed},
                         {"places", places},
                         {"folder", cell.folder},
                         {"spp", cell.spp},
                         {"seconds", 0.0},
                         {"steps", 0},
                         {"bytes", 0},
                         {"entries", 0},
                         {"message", ""}};
  nlohmann::json commands = nlohmann::json::object();
  if (cell.training) {
    const nlohmann::json& t = trainings[*cell.training];
    for (const char* key : {"seconds", "steps", "bytes", "entries", "loss"}) base[key] = t.value(key, nlohmann::json());
    base["training"] = t["folder"];
    if (t.contains("command")) commands["train"] = t["command"];
  }
  const nlohmann::json made = store.read(cell.folder + "/cell.json"),
                       failed = store.read(cell.folder + "/cell.json.failed");
  for (std::size_t v = 0; v < cell.references.size(); ++v) {
    nlohmann::json entry = base;
    for (const char* metric : {"mape", "mape_trimmed", "mape_glossy", "mse", "relmse", "psnr", "ssim", "flip", "lpips",
                               "mean_ratio", "relmse_noise_free", "frame_ms"})
      entry[metric] = nullptr;
    entry["view"] = plan.references[cell.references[v]].view.name;
    entry["status"] = "waiting";
    entry["commands"] = commands;
    const auto views = made.is_object() ? made.find("views") : made.end();
    const bool whole = views != made.end() && views->is_array() && views->size() > v && (*views)[v].is_object();
    if (made.is_object() && !whole) {
      entry["status"] = "failed";
      entry["message"] = "its cell.json is broken; without it the cell is made again";
    } else if (whole) {
      entry["status"] = "done";
      for (const auto& [key, value] : (*views)[v].items()) {
        if (key == "commands") entry["commands"].update(value);
        else entry[key] = value;
      }
    } else if (failed.is_object()) {
      entry["status"] = failed.value("unavailable", false) ? "not available" : "failed";
      entry["message"] = failed.value("message", "");
      entry["commands"]["failed"] = failed.value("command", "");
    }
    entry["temporal"] = nullptr;
    const std::string film = v == 0 ? temporal_folder(plan, cell) : "";
    if (const nlohmann::json t = film.empty() ? nlohmann::json() : store.read(film + "/temporal.json"); t.is_object()) {
      entry["temporal"] = t.value("temporal", nlohmann::json());
      entry["temporal_displayed"] = t.value("temporal_displayed", nlohmann::json());
      entry["commands"]["temporal"] = t.value("commands", nlohmann::json());
    }
    cells.push_back(entry);
  }
}

nlohmann::json reference_json(const Store& store, const Plan& plan, const Reference& r) {
  nlohmann::json out = {
      {"scene", plan.scenes[r.scene].name}, {"view", r.view.name}, {"picture", r.picture()}, {"spp", 2 * r.half_spp}};
  const nlohmann::json merged = read_record(store, r.folder + "/ref.json");
  if (!merged.is_object()) return out;
  out["noise"] = merged["output"].value("noise", nlohmann::json());
  out["commands"] = {{"merge", merged.value("command", nlohmann::json())}};
  double seconds = 0.0;
  for (const char* half : {"a", "b"}) {
    const nlohmann::json record = read_record(store, fmt::format("{}/{}.json", r.folder, half));
    if (!record.is_object()) continue;
    seconds += record["output"].value("seconds", 0.0);
    out["commands"][half] = record.value("command", nlohmann::json());
  }
  out["seconds"] = seconds;
  return out;
}

nlohmann::json published_json() {
  nlohmann::json table = nlohmann::json::array(), switches = nlohmann::json::array();
  for (const PublishedCell& c : published_cells())
    table.push_back(
        {{"method", c.method}, {"scene", c.scene}, {"mape", c.mape}, {"lpips", c.lpips}, {"frame_ms", c.ms}});
  for (const PublishedSwitch& s : published_switches())
    switches.push_back({{"matrix", s.matrix}, {"switch", s.name}, {"mape", s.mape}, {"lpips", s.lpips}});
  return {{"how", kPublishedHow}, {"cells", table}, {"switches", switches}};
}

}  // namespace

nlohmann::json write_results(const Store& store, const Plan& plan, const nlohmann::json& head) {
  nlohmann::json results = head;
  results["scale"] = {{"factor", plan.scale.factor}, {"batch", plan.scale.batch()}};
  for (const char* list : {"matrices", "references", "trainings", "cells", "learned", "path"})
    results[list] = nlohmann::json::array();
  for (const Matrix& m : plan.matrices) results["matrices"].push_back(matrix_json(plan, m));
  for (const Reference& r : plan.references) results["references"].push_back(reference_json(store, plan, r));
  std::vector<nlohmann::json> trainings;
  for (const Training& t : plan.trainings) trainings.push_back(training_json(store, plan, t));
  results["trainings"] = trainings;
  for (const Cell& cell : plan.cells) {
    add_cell(store, plan, cell, trainings, results["cells"]);
    const std::string ladder = ladder_folder(plan, cell);
    for (const auto& [list, file] : {std::pair{"learned", cell.folder + "/learned/learned.json"},
                                     {"path", ladder.empty() ? "" : ladder + "/ladder.json"}}) {
      nlohmann::json extra = file.empty() ? nlohmann::json() : store.read(file);
      if (!extra.is_object()) continue;
      extra["scene"] = plan.scenes[cell.scene].name;
      extra["view"] = plan.references[cell.references.front()].view.name;
      results[list].push_back(extra);
    }
  }
  results["published"] = published_json();
  store.write("results.json", results);
  return results;
}

}  // namespace octrad::paper
