// octrad selftest: kernels against the definitions of the CPU, then what the device can do. On the CPU the same kernels
// run on the host stream: that proves them, and says nothing about the speed of a GPU.
#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <utility>

#include "app/cli/common.h"
#include "app/cli/open_scene.h"
#include "app/selftest/selftest.h"
#include "octrad/base/atomic_file.h"
#include "octrad/base/bytes.h"
#include "octrad/base/cpu_info.h"
#include "octrad/base/error.h"
#include "octrad/base/json_file.h"
#include "octrad/base/log.h"
#include "octrad/base/lower_case.h"
#include "octrad/base/random_seed.h"
#include "octrad/base/stopwatch.h"
#include "octrad/base/threads.h"
#include "octrad/base/version.h"
#include "octrad/scene/sample_scenes.h"

namespace octrad::cli {
namespace {

using namespace selftest;

struct SelftestOptions {
  std::string scene, output, only;
  bool quick = false, no_benchmarks = false, no_checks = false;
  ConfigOptions definitions;
};

bool chosen(const SelftestOptions& o, const char* name) {
  return o.only.empty() || lower_case(name).find(lower_case(o.only)) != std::string::npos;
}

void require_a_match(const SelftestOptions& o) {
  const auto any = [&](const auto& entries) {
    return std::ranges::any_of(entries, [&](const auto& entry) { return chosen(o, entry.name); });
  };
  if ((!o.no_checks && any(checks())) || (!o.no_benchmarks && any(benchmarks())) ||
      (!o.no_checks && !o.no_benchmarks && any(stages())))
    return;
  const char* what = o.no_benchmarks ? "check" : o.no_checks ? "benchmark" : "check, benchmark or stage";
  throw UsageError(fmt::format("--only {}: no {} has this in its name", o.only, what));
}

// JSON has no infinity.
nlohmann::json number(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json("infinite");
}

nlohmann::json device_json(const Stream& stream, const DeviceChoice& choice) {
  if (!stream.on_device()) {
    const CpuInfo cpu = cpu_info();
    return {{"device", "host"}, {"name", cpu.model}, {"isa", cpu.level}, {"threads", thread_count()}};
  }
  const DeviceInfo d = stream.info();
  const DeviceSurvey survey = survey_devices();
  return {{"device", choice.name},
          {"name", d.name},
          {"compute_capability", fmt::format("{}.{}", d.major, d.minor)},
          {"multiprocessors", d.multiprocessors},
          {"memory", d.total_bytes},
          {"free_memory", d.free_bytes},
          {"l2", d.l2_bytes},
          {"driver", survey.driver},
          {"runtime", survey.runtime},
          {"built_for", survey.architectures}};
}

std::string date_now() {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  return fmt::format("{:04}-{:02}-{:02}", utc.tm_year + 1900, utc.tm_mon + 1, utc.tm_mday);
}

// Runs entries of the three lists, prints a line of each as it ends, and keeps what the report holds. An error fails
// its entry; one of the device, which holds for the rest of the process, skips those after it.
class Runner {
 public:
  Runner(const Context& context, const SelftestOptions& options, const std::string& on, bool silent)
      : context_(context),
        options_(options),
        on_(on),
        silent_(silent) {}

  void print(const std::string& text) const {
    if (!silent_) print_text(text);
  }

  // Of the entries that follow, if there are any.
  void heading(const std::string& text) { heading_ = "\n" + text + "\n"; }

  void check(const Check& check) {
    entry(check.name, checks_, true, [&](nlohmann::json& report) {
      const CheckResult r = check.run(context_);
      report.update({{"error", r.error},
                     {"items", r.items},
                     {"p50", number(r.p50)},
                     {"p99", number(r.p99)},
                     {"p99.9", number(r.p999)},
                     {"max", number(r.max)},
                     {"tolerance", r.tolerance},
                     {"allowed_above", r.allowed},
                     {"above", r.above},
                     {"passed", r.passed}});
      return verdict(r.passed) + r.text();
    });
  }

  void benchmark(const Benchmark& benchmark) {
    entry(benchmark.name, benchmarks_, false, [&](nlohmann::json& report) {
      const BenchmarkResult r = benchmark.run(context_);
      nlohmann::json sizes = nlohmann::json::object();
      for (const auto& [key, value] : r.sizes) sizes[key] = value;
      report.update({{"rate", r.rate},
                     {"unit", r.unit},
                     {"median_ms", r.median_ms},
                     {"min_ms", r.min_ms},
                     {"max_ms", r.max_ms},
                     {"runs", r.runs},
                     {"sizes", sizes}});
      return fmt::format("{} {}  ({:.3g} ms{})", format_rate(r.rate), r.unit, r.median_ms,
                         context_.stream.on_device() ? "" : ", host");
    });
  }

  void stage(const Stage& stage) {
    entry(stage.name, stages_, true, [&](nlohmann::json& report) {
      StageResult r = stage.run(context_);
      r.report["stages_ms"] = stages_json(r.stages);
      r.report["passed"] = r.passed;
      report.update(r.report);
      return fmt::format("{}{} ({})", verdict(r.passed), r.summary, format_stages(r.stages));
    });
  }

  std::size_t passed() const { return passed_; }
  std::size_t failed() const { return failed_; }
  std::size_t skipped() const { return skipped_.size(); }
  void put_into(nlohmann::json& report) const {
    report["checks"] = checks_;
    report["benchmarks"] = benchmarks_;
    report["stages"] = stages_;
    report["skipped"] = skipped_;
  }

 private:
  static std::string verdict(bool passed) { return passed ? "ok      " : "FAILED  "; }

  // `run` fills its part of the report and returns the text of the line. `judged`: it passes or fails.
  template <typename Run>
  void entry(const char* name, nlohmann::json& list, bool judged, Run&& run) {
    if (!chosen(options_, name)) return;
    if (lost_) {
      skipped_.push_back(name);
      return;
    }
    log_verbose("{}", name);
    nlohmann::json report{{"name", name}, {"on", on_}};
    std::string text;
    try {
      text = run(report);
    } catch (const Error& error) {
      lost_ = dynamic_cast<const DeviceError*>(&error) != nullptr;
      report["passed"] = false;
      report["failure"] = error.what();
      text = verdict(false) + error.what();
    }
    if (judged || report.contains("failure")) ++(report.at("passed").get<bool>() ? passed_ : failed_);
    list.push_back(std::move(report));
    print(fmt::format("{}  {:<36} {}\n", std::exchange(heading_, ""), name, text));
  }

  const Context& context_;
  const SelftestOptions& options_;
  const std::string on_;
  const bool silent_;
  std::string heading_;
  bool lost_ = false;  // the device
  std::size_t passed_ = 0, failed_ = 0;
  nlohmann::json checks_ = nlohmann::json::array(), benchmarks_ = nlohmann::json::array(),
                 stages_ = nlohmann::json::array(), skipped_ = nlohmann::json::array();
};

void selftest_verb(const CommonOptions& common, const SelftestOptions& o) {
  if (!o.output.empty()) require_writable(o.output);
  refuse_input_as_output("-o", o.output, {o.scene});
  require_a_match(o);
  o.definitions.refuse_config_definitions("selftest trains configurations of its own");
  if (o.scene.empty() && !o.definitions.scene_definitions().empty())
    throw UsageError("-D sets parameters of a SCENE, and none is given");
  if (o.scene.empty() && common.permissive) throw UsageError("--permissive belongs to a SCENE, and none is given");
  const Stopwatch watch;
  const DeviceChoice choice = common.choose_device();
  std::unique_ptr<Stream> stream = choice.make_stream(o.definitions.tuning());
  if (!stream) stream = make_host_stream();
  const bool on_device = stream->on_device();
  const std::string on = on_device ? choice.name : "host";
  const nlohmann::json device = device_json(*stream, choice);
  const std::uint64_t seed = common.has_seed() ? static_cast<std::uint64_t>(common.seed) : random_seed() & 0xffffffffu;

  std::vector<PreparedScene> scenes;  // the one given, or built-in ones
  const auto prepare = [&](Scene scene) { scenes.emplace_back(std::move(scene), PreparedScene::CpuTree::bvh8); };
  if (!o.scene.empty()) {
    prepare(open_scene(o.scene, o.definitions.scene_definitions(), common.permissive, {{"-o", o.output}}));
  } else {
    prepare(testing::triangle_soup(seed));
    prepare(testing::every_material());
    prepare(testing::open_room());
    prepare(testing::closed_room());
  }
  const auto at = [&](std::size_t k) -> const PreparedScene& { return scenes[std::min(k, scenes.size() - 1)]; };
  const Context context{*stream, seed, o.quick, at(0), at(1), at(2), at(3)};
  const Scene& scene = at(0).scene();

  Runner runner(context, o, on, common.json);
  runner.print(on_device ? fmt::format("selftest on {} ({})\n", choice.name, stream->info().name)
                         : fmt::format("selftest on the host, standing in for a GPU ({})\n", choice.why));
  runner.print(fmt::format("seed {}, scene {}: {} triangles\n", seed, scene.file,
                           format_count(static_cast<long long>(scene.triangle_count()))));
  if (!o.no_checks) {
    runner.heading("Kernels against the CPU's definitions");
    for (const Check& check : checks()) runner.check(check);
  }
  if (!o.no_benchmarks) {
    runner.heading(on_device ? "Speed, warm, median" : "Speed of the host at small sizes; no figure of a GPU");
    for (const Benchmark& benchmark : benchmarks()) runner.benchmark(benchmark);
  }
  if (!o.no_benchmarks && !o.no_checks) {
    runner.heading(
        on_device ? "Training and rendering beside the CPU's"
                  : "Training and rendering on the host stream beside the CPU's own code; small, no figure of a GPU");
    for (const Stage& stage : stages()) runner.stage(stage);
  }
  const std::size_t passed = runner.passed(), failed = runner.failed();
  runner.print(fmt::format("\n{} passed, {} failed, {} skipped\n", passed, failed, runner.skipped()));

  nlohmann::json report = {{"version", kVersion},
                           {"date", date_now()},
                           {"device", device},
                           {"emulated", !on_device},
                           {"why", choice.why},
                           {"seed", seed},
                           {"scene", {{"file", scene.file}, {"triangles", scene.triangle_count()}}},
                           {"passed", failed == 0},
                           {"peak_bytes", stream->peak_bytes()},
                           {"seconds", watch.seconds()}};
  runner.put_into(report);
  if (!o.output.empty()) write_file(o.output, json_text(report, 2) + "\n");
  if (common.json) print_json(report);
  if (failed > 0)
    throw DeviceError(
        fmt::format("{} of {} checks and stages failed on {}; seed {}", failed, passed + failed, on, seed));
}

}  // namespace

void add_selftest(Program& program) {
  auto o = std::make_shared<SelftestOptions>();
  CLI::App* verb = add_verb(
      program, "selftest", "Check the kernels of a device against the CPU, and measure them.",
      "octrad selftest --device auto --quick\n  octrad selftest scene.xml --json -o selftest.json", Devices::cuda);
  verb->add_option("scene", o->scene,
                   "Mitsuba XML, glTF or pbrt scene for rays, training and the frame; default: built-in ones")
      ->type_name("SCENE");
  verb->add_option("-o,--output", o->output, "JSON file with everything")->type_name("OUT.json");
  verb->add_option("--only", o->only, "only checks, benchmarks and stages with this in their name")->type_name("TEXT");
  verb->add_flag("--quick", o->quick, "small sizes on a GPU too");
  const auto* only_checks = verb->add_flag("--no-benchmarks", o->no_benchmarks, "only the checks");
  verb->add_flag("--no-checks", o->no_checks, "only the benchmarks")->excludes(const_cast<CLI::Option*>(only_checks));
  o->definitions.add_definitions_to(*verb);
  add_permissive_option(*verb, program.common);
  verb->callback([&program, o] { program.run = [&program, o] { selftest_verb(program.common, *o); }; });
}

}  // namespace octrad::cli
