#include <fmt/format.h>

#include "app/selftest/selftest.h"
#include "octrad/image/metrics.h"
#include "octrad/render/renderer.h"
#include "octrad/train/checks.h"

namespace octrad::selftest {
namespace {

Config short_run(const Context& c, const std::string& field = "octaoctree") {
  Config config = preset("cpu");
  config.field = field;
  config.ncr_log2_table = config.ncr_cone_log2_table = c.large() ? 17 : 12;
  config.seed = static_cast<long long>(c.seed % 1'000'000'000);
  config.octree_levels = c.large() ? 6 : 4;
  config.disparity_log2_table = c.large() ? 17 : 12;
  config.train_steps = c.large() ? 200 : 40;
  config.train_points = c.large() ? 4096 : 256;
  config.train_directions = c.large() ? 8 : 4;
  config.adam_warmup = 1;
  return config;
}

// The distance of two seeds on the CPU shows what that of stream and CPU is worth.
StageResult short_training(const Context& c, const std::string& field) {
  constexpr double kTolerance = 0.05;
  const Config config = short_run(c, field);
  Config other = config;
  ++other.seed;
  const std::vector<SurfacePoint> probes = surface_probes(c.closed, 4096, c.seed + 3, config);
  const TrainingPair pair = train_on_both(c.stream, c.closed, config, probes);
  const TrainResult& on_stream = pair.on_stream;
  const double seeds = mean_difference(*train(c.closed, other, TrainOptions{}).field, *pair.on_cpu.field, probes);

  StageResult r;
  r.passed =
      pair.difference <= kTolerance && pair.loss_difference <= kTolerance && on_stream.steps == pair.on_cpu.steps;
  r.stages = on_stream.stages;
  r.report = {{"scene", c.closed.scene().file},
              {"field", field},
              {"steps", on_stream.steps},
              {"points", config.train_points},
              {"directions", config.train_directions},
              {"levels", config.octree_levels},
              {"seconds", on_stream.seconds},
              {"cpu_seconds", pair.on_cpu.seconds},
              {"rhs_queries", on_stream.rhs_queries},
              {"loss", on_stream.loss},
              {"cpu_loss", pair.on_cpu.loss},
              {"probes", probes.size()},
              {"difference", pair.difference},
              {"difference_of_seeds", seeds},
              {"tolerance", kTolerance}};
  r.summary = fmt::format(
      "{} steps: radiance differs from the CPU's by {:.2g} (another seed's: {:.2g}; at most {:.2g}), loss {:.4g} and {:.4g}; {:.2f} s",
      on_stream.steps, pair.difference, seeds, kTolerance, on_stream.loss, pair.on_cpu.loss, on_stream.seconds);
  return r;
}

// A cache trained on the stream, asked by both: the picture, and the time that frames take.
StageResult frame(const Context& c, const std::string& field) {
  constexpr double kTolerance = 2e-3;
  const Config config = short_run(c, field);
  TrainOptions options;
  options.stream = &c.stream;
  const TrainResult trained = train(c.closed, config, options);
  View view{c.closed.scene().cameras.front()};
  view.width = view.height = c.large() ? 256 : 64;
  RenderSettings settings;
  settings.film = c.closed.scene().film;
  settings.seed = c.seed;
  settings.expected_spp = 1;
  const RenderBudget budget{1};
  const auto on_cpu = make_renderer(c.closed, "lhs", settings, trained.field.get(), config);
  on_cpu->set_view(view);
  settings.max_memory = c.stream.on_device() ? c.stream.info().free_bytes / 10 * 9 : 0;
  const auto on_stream = make_renderer(c.closed, "lhs", settings, trained.field.get(), config, &c.stream);
  on_stream->set_view(view);
  const double mape = compare(render(*on_cpu, budget).image, render(*on_stream, budget).image).mape;

  View timed = view;
  timed.width = timed.height = c.stream.on_device() ? (c.quick ? 256 : 1024) : 32;
  const int frames = c.stream.on_device() ? 200 : 3;
  on_stream->set_view(timed);
  const FrameTimes times = on_stream->time_frames(frames, 1);

  StageResult r;
  r.passed = mape <= kTolerance;
  r.report = {{"scene", c.closed.scene().file},
              {"field", field},
              {"integrator", "lhs"},
              {"compared", {{"width", view.width}, {"height", view.height}, {"spp", budget.spp}}},
              {"mape", mape},
              {"tolerance", kTolerance},
              {"frames", frames},
              {"width", timed.width},
              {"height", timed.height},
              {"spp", 1},
              {"median_ms", times.median},
              {"p95_ms", times.p95}};
  r.stages = times.stages;
  r.summary =
      fmt::format("differs from the CPU's picture by MAPE {:.2g} (at most {:.2g}); {} x {}: median {:.3g} ms{}", mape,
                  kTolerance, timed.width, timed.height, times.median, c.stream.on_device() ? "" : " on the host");
  return r;
}

constexpr Stage kStages[] = {
    {"short training", [](const Context& c) { return short_training(c, "octaoctree"); }},
    {"frame", [](const Context& c) { return frame(c, "octaoctree"); }},
    {"short training, ncr", [](const Context& c) { return short_training(c, "ncr"); }},
    {"frame, ncr", [](const Context& c) { return frame(c, "ncr"); }},
};

}  // namespace

std::span<const Stage> stages() { return kStages; }

}  // namespace octrad::selftest
