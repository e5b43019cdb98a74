#include "app/paper/rates.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <set>
#include <thread>

#include "octrad/base/atomic_file.h"
#include "octrad/base/log.h"

namespace octrad::paper {
namespace {

double pixels(const View& view) { return static_cast<double>(view.width) * view.height; }

// Seconds of a picture's samples. One bounce over a cache costs about a path of two rays and a query.
double sampling_seconds(const nlohmann::json& rates, const Method& method, double samples) {
  const double path = std::max(1.0, rates.value("path_samples_per_s", 1e5));
  const nlohmann::json field =
      rates.value("fields", nlohmann::json::object()).value(method.field, nlohmann::json::object());
  const double query = std::max(1.0, field.value("samples_per_s", path));
  const std::string integrator = method.integrator;
  return samples / (integrator == "lhs"                               ? query
                    : integrator == "rhs" || integrator == "deferred" ? 0.5 * std::min(path, query)
                                                                      : path);
}

}  // namespace

Rates measure_rates(const Store& store, const Plan& plan, const std::vector<std::string>& device) {
  Rates rates;
  for (std::size_t s = 0; s < plan.scenes.size(); ++s) {
    const PaperScene& scene = plan.scenes[s];
    rates.scenes.push_back(nlohmann::json::object());
    if (std::none_of(plan.cells.begin(), plan.cells.end(), [&](const Cell& c) { return c.scene == s && c.selected; }))
      continue;
    const std::string base = "rates/" + scene.name, record = base + ".json";
    store.make_folder("rates");
    std::unique_ptr<WriterLock> lock;  // one process measures, others take what it found
    while (!(lock = WriterLock::try_to_take(store.path(record))))
      std::this_thread::sleep_for(std::chrono::milliseconds(200));
    nlohmann::json kept = store.read(record);
    if (!kept.is_object() || kept.value("fingerprint", "") != scene.info.at("fingerprint").get<std::string>()) {
      log_info("measuring how fast this machine is with {}", scene.name);
      const auto render = [&](std::vector<std::string> words) {
        words.insert(words.begin(), {"render", scene.file, "--width", "96", "-o", base + ".exr"});
        words.insert(words.end(), device.begin(), device.end());
        return store.ask(words, "rates/log.txt");
      };
      const nlohmann::json path = render({"--integrator", "path", "--max-depth", "-1", "--spp", "4"});
      const double seconds = path["output"]["seconds"];
      kept = {{"fingerprint", scene.info.at("fingerprint")},
              {"path_samples_per_s", path["output"]["samples_per_s"]},
              {"load_seconds", std::max(0.0, path["seconds"].get<double>() - seconds)},
              {"fields", nlohmann::json::object()}};
      std::set<std::string> fields;
      for (const Training& t : plan.trainings) {
        if (t.scene != s || !fields.insert(t.field).second) continue;
        std::vector<std::string> words = {
            "train",          scene.file,    "-o",
            base + ".octrad", "--overwrite", "--no-optimizer",
            "--preset",       t.preset,      "--field",
            t.field,          "--time",      fmt::format("{:.2f}s", std::clamp(t.seconds / 10.0, 0.1, 0.5))};
        words.insert(words.end(), device.begin(), device.end());
        try {
          const nlohmann::json trained = store.ask(words, "rates/log.txt");
          const double train_seconds = std::max(1e-3, trained["output"]["seconds"].get<double>());
          const nlohmann::json picture = render({"--model", base + ".octrad", "--spp", "1"});
          kept["fields"][t.field] = {
              {"steps_per_s", trained["output"]["steps"].get<double>() / train_seconds},
              {"work", t.work},
              {"overhead_seconds", std::max(0.0, trained["seconds"].get<double>() - train_seconds)},
              {"samples_per_s", picture["output"]["samples_per_s"]}};
        } catch (const CommandFailed& failure) {
          log_verbose("{}: {}", t.field, failure.message);
        }
      }
      store.remove(base + ".octrad");
      store.remove(base + ".exr");
      store.write(record, kept);
    }
    rates.scenes.back() = kept;
  }
  return rates;
}

double reference_cost(const Plan&, const Rates& rates, const Reference& reference) {
  const nlohmann::json& r = rates.scenes[reference.scene];
  return 2.0 * (r.value("load_seconds", 1.0) +
                pixels(reference.view) * reference.half_spp / std::max(1.0, r.value("path_samples_per_s", 1e5))) +
         0.2;
}

double training_cost(const Plan& plan, const Rates& rates, const Training& t) {
  const nlohmann::json fields = rates.scenes[t.scene].value("fields", nlohmann::json::object());
  if (!fields.contains(t.field)) return 0.1;  // it will say that it cannot
  const nlohmann::json& f = fields[t.field];
  const double steps_per_s = std::max(1e-3, f.value("steps_per_s", 10.0)) * f.value("work", t.work) / t.work;
  const double validation =
      t.reference ? 4.0 * pixels(plan.references[*t.reference].view) / std::max(1.0, f.value("samples_per_s", 1e5))
                  : 0.0;
  return f.value("overhead_seconds", 1.0) + validation +
         (t.steps > 0 ? static_cast<double>(t.steps) / steps_per_s : t.seconds);
}

double cell_cost(const Plan& plan, const Rates& rates, const Cell& cell) {
  const nlohmann::json& r = rates.scenes[cell.scene];
  double sum = 0.0;
  for (const std::size_t i : cell.references) {
    const double n = pixels(plan.references[i].view);
    const int frame_spp = cell.method->spp;
    const double samples = n * (cell.spp + frame_spp * timed_frames(plan.references[i].view, frame_spp));
    sum += r.value("load_seconds", 1.0) + sampling_seconds(r, *cell.method, samples);
    sum += 0.3 + 4e-6 * n;  // errors
    if (cell.method->denoise || std::string(cell.method->integrator) == "denoised") sum += 0.5 + 4e-6 * n;
    if (cell.learned) sum += 8.0 * (r.value("load_seconds", 1.0) + 1e-6 * n);
  }
  return sum;
}

double film_cost(const Plan&, const Rates& rates, const Film& film) {
  const nlohmann::json& r = rates.scenes[film.scene];
  const double samples = static_cast<double>(film.width) * film.height * film.spp * film.path.at("frames").get<int>();
  return r.value("load_seconds", 1.0) + samples / std::max(1.0, r.value("path_samples_per_s", 1e5));
}

double temporal_cost(const Plan& plan, const Rates& rates, const Cell& cell) {
  const Film& film = plan.films[*cell.film];
  const nlohmann::json& r = rates.scenes[cell.scene];
  const double pixels_of = static_cast<double>(film.width) * film.height * film.path.at("frames").get<int>();
  return r.value("load_seconds", 1.0) + sampling_seconds(r, *cell.method, pixels_of * cell.spp) + 2e-6 * pixels_of;
}

double plan_cost(const Plan& plan, const Rates& rates) {
  double sum = 0.0;
  for (const Reference& r : plan.references) sum += reference_cost(plan, rates, r);
  for (const Training& t : plan.trainings) sum += training_cost(plan, rates, t);
  for (const Cell& c : plan.cells) sum += cell_cost(plan, rates, c) + (c.film ? temporal_cost(plan, rates, c) : 0.0);
  for (const Film& f : plan.films) sum += film_cost(plan, rates, f);
  return sum;
}

}  // namespace octrad::paper
