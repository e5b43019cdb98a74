#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "app/cli/common.h"
#include "app/selftest/entries.h"
#include "app/selftest/ground.h"
#include "octrad/base/rng.h"
#include "octrad/base/stopwatch.h"
#include "octrad/geometry/surface_sampling.h"
#include "octrad/image/metrics.h"
#include "octrad/render/renderer.h"
#include "octrad/train/trainer.h"

namespace octrad::selftest {
namespace {

Config short_run(const Context& c) {
  Config config = preset("cpu");
  const bool large = c.items(1, 0) > 0;
  config.seed = static_cast<long long>(c.seed % 1'000'000'000);
  config.octree_levels = large ? 6 : 4;
  config.disparity_log2_table = large ? 17 : 12;
  config.train_steps = large ? 200 : 40;
  config.train_points = large ? 4096 : 256;
  config.train_directions = large ? 8 : 4;
  config.adam_warmup = 1;
  return config;
}

TrainResult train_short(const PreparedScene& scene, const Config& config, Stream* stream) {
  TrainOptions options;
  options.stream = stream;
  return train(scene, config, options);
}

// Points uniform by area, seen from uniform directions of the hemisphere.
std::vector<SurfacePoint> probe_points(const PreparedScene& scene, std::size_t n, std::uint64_t seed) {
  const SurfaceSampler& sampler = scene.surfaces();
  const TransportContext context = scene.context();
  std::vector<SurfacePoint> points(n);
  for (std::size_t i = 0; i < n; ++i) {
    Rng rng(seed + 3, RngPurpose::test, i);
    const float pick = rng.uniform();
    const SurfaceInteraction surface = sampler.sample(pick, rng.uniform2());
    const Vec2f u = rng.uniform2();
    const float z = u.x, r = std::sqrt(std::max(0.0f, 1.0f - z * z)), phi = 2.0f * kPi * u.y;
    Vec3f wo{r * std::cos(phi), r * std::sin(phi), z};
    if (dot(wo, surface.geometric_normal) < 0.0f) wo = -wo;
    points[i] = surface_point(context.shade(surface, wo));
  }
  return points;
}

double mean_difference(const std::vector<Vec3f>& a, const std::vector<Vec3f>& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double x = static_cast<double>(luminance(a[i])), y = static_cast<double>(luminance(b[i]));
    sum += std::fabs(x - y) / (0.5 * (std::fabs(x) + std::fabs(y)) + 0.01);
  }
  return sum / static_cast<double>(a.size());
}

std::vector<Vec3f> radiance(const RadianceField& field, const std::vector<SurfacePoint>& points) {
  std::vector<Vec3f> out(points.size());
  field.radiance(points, out);
  return out;
}

// The same steps on both sides. Sums in another order, tables read as halves and small products of halves lead the two
// apart as they learn; the distance of two seeds on the CPU tells what that is worth.
StageResult short_training(const Context& c) {
  constexpr double kTolerance = 0.05;
  const Ground ground(c, built_in_room);
  const Config config = short_run(c);
  Config other = config;
  ++other.seed;
  const TrainResult on_stream = train_short(ground.use, config, &c.stream),
                    on_cpu = train_short(ground.use, config, nullptr);
  const TrainResult other_seed = train_short(ground.use, other, nullptr);
  const std::vector<SurfacePoint> probes = probe_points(ground.use, 4096, c.seed);
  const std::vector<Vec3f> expected = radiance(*on_cpu.field, probes);
  const double difference = mean_difference(radiance(*on_stream.field, probes), expected);
  const double seeds = mean_difference(radiance(*other_seed.field, probes), expected);
  const double loss = std::fabs(on_stream.loss - on_cpu.loss) / on_cpu.loss;

  StageResult r;
  r.passed = difference <= kTolerance && loss <= kTolerance && on_stream.steps == on_cpu.steps;
  r.report = {{"scene", ground.use.scene().file},
              {"steps", on_stream.steps},
              {"points", config.train_points},
              {"directions", config.train_directions},
              {"levels", config.octree_levels},
              {"seconds", on_stream.seconds},
              {"cpu_seconds", on_cpu.seconds},
              {"rhs_queries", on_stream.rhs_queries},
              {"stages_ms", cli::stages_json(on_stream.stages)},
              {"loss", on_stream.loss},
              {"cpu_loss", on_cpu.loss},
              {"probes", probes.size()},
              {"difference", difference},
              {"difference_of_seeds", seeds},
              {"tolerance", kTolerance}};
  r.summary = fmt::format(
      "{} steps: radiance differs from the CPU's by {:.2g} (another seed's: {:.2g}; at most {:.2g}), loss {:.4g} and {:.4g}; {:.2f} s",
      on_stream.steps, difference, seeds, kTolerance, on_stream.loss, on_cpu.loss, on_stream.seconds);
  return r;
}

// A cache trained on the stream, asked by both: the picture, and the time that frames take.
StageResult frame(const Context& c) {
  constexpr double kTolerance = 2e-3;
  const Ground ground(c, built_in_room);
  const Config config = short_run(c);
  const TrainResult trained = train_short(ground.use, config, &c.stream);
  const bool large = c.items(1, 0) > 0;
  View view{ground.use.scene().cameras.front()};
  view.width = view.height = large ? 256 : 64;
  RenderSettings settings;
  settings.film = ground.use.scene().film;
  settings.seed = c.seed;
  settings.expected_spp = 1;
  const RenderBudget budget{1};
  const auto on_cpu = make_renderer(ground.use, "lhs", settings, trained.field.get(), config);
  on_cpu->set_view(view);
  settings.max_memory = c.stream.on_device() ? c.stream.info().free_bytes / 10 * 9 : 0;
  const auto on_stream = make_renderer(ground.use, "lhs", settings, trained.field.get(), config, &c.stream);
  on_stream->set_view(view);
  const double mape = compare(render(*on_cpu, budget).image, render(*on_stream, budget).image).mape;

  View timed = view;
  timed.width = timed.height = c.stream.on_device() ? (c.quick ? 256 : 1024) : 32;
  const int frames = c.stream.on_device() ? 200 : 3;
  on_stream->set_view(timed);
  const FrameTimes times = on_stream->time_frames(frames, 1);

  StageResult r;
  r.passed = mape <= kTolerance;
  r.report = {{"scene", ground.use.scene().file},
              {"integrator", "lhs"},
              {"compared", {{"width", view.width}, {"height", view.height}, {"spp", budget.spp}}},
              {"mape", mape},
              {"tolerance", kTolerance},
              {"frames", frames},
              {"width", timed.width},
              {"height", timed.height},
              {"spp", 1},
              {"median_ms", times.median},
              {"p95_ms", times.p95},
              {"stages_ms", cli::stages_json(times.stages)}};
  r.summary =
      fmt::format("differs from the CPU's picture by MAPE {:.2g} (at most {:.2g}); {} x {}: median {:.3g} ms{} ({})",
                  mape, kTolerance, timed.width, timed.height, times.median, c.stream.on_device() ? "" : " on the host",
                  cli::format_stages(times.stages));
  return r;
}

constexpr Stage kStages[] = {
    {"short training", short_training},
    {"frame", frame},
};

}  // namespace

std::span<const Stage> stages() { return kStages; }

}  // namespace octrad::selftest
