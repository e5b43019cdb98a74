// octrad paper: every method, table and figure of the paper on any scenes.
#include <fmt/format.h>

#include <cstdlib>

#include "app/cli/common.h"
#include "app/paper/run.h"
#include "octrad/base/duration.h"
#include "octrad/base/error.h"
#include "octrad/base/join.h"
#include "octrad/base/log.h"

namespace octrad::cli {
namespace {

void paper_verb(const CommonOptions& common, paper::PaperOptions o) {
  if (common.has_seed()) throw UsageError("--seed: the matrix says the seeds (\"seeds\": [0, 1])");
  if (!o.budget.empty() && parse_duration(o.budget) <= 0.0) throw UsageError("--budget must be above 0");
  if (common.threads > 0) o.common = {"--threads", std::to_string(common.threads)};
  if (!common.max_memory.empty()) o.common.insert(o.common.end(), {"--max-memory", common.max_memory});
  const auto from_environment = [](std::string& value, const char* name) {
    if (const char* text = std::getenv(name); value.empty() && text) value = text;
    unsetenv(name);  // commands are told by options, and run in another folder
  };
  from_environment(o.lpips_weights, "OCTRAD_LPIPS_WEIGHTS");
  from_environment(o.oidn_library, "OCTRAD_OIDN_LIBRARY");
  o.device = {"--device", common.device};
  if (o.matrices.empty()) o.matrices = {paper::builtin_matrices().front().first};
  const paper::PaperSummary s = run_paper(o);
  if (o.dry_run) return common.json ? print_json(s.plan_json) : print_text(s.plan);
  if (common.json) {
    print_json({{"report", o.output + "/index.html"},
                {"results", o.output + "/results.json"},
                {"done", s.done},
                {"waiting", s.waiting},
                {"not_available", s.unavailable},
                {"failed", s.failed},
                {"seconds", s.seconds},
                {"interrupted", s.interrupted}});
  } else {
    log_info("{}/index.html: {} of {} pictures are done{} ({})", o.output, s.done,
             s.done + s.waiting + s.unavailable + s.failed,
             s.unavailable > 0 ? fmt::format(", {} are not available", s.unavailable) : "", format_duration(s.seconds));
    if (s.interrupted) log_info("interrupted: the same command continues it");
  }
  if (s.failed == 0) return;
  const std::string failures = fmt::format("{} pictures failed, the others are in {}/index.html; the first: {}",
                                           s.failed, o.output, s.first_failure);
  if (!s.interrupted) throw InputError(failures);
  log_warning(failures);  // the exit code says that it was interrupted
}

}  // namespace

void add_paper(Program& program) {
  auto o = std::make_shared<paper::PaperOptions>();
  CLI::App* verb =
      add_verb(program, "paper", "Train, render and compare everything that the paper shows, and write the report.",
               "octrad paper --budget 30m --scenes scenes -o report", Devices::cuda);
  std::vector<std::string> names;
  for (const auto& [name, text] : paper::builtin_matrices()) names.emplace_back(name);
  verb->add_option("matrices", o->matrices, "what to do: " + join(names) + ", or JSON files; default: main")
      ->type_name("MATRIX");
  verb->add_option("-o,--output", o->output, "folder of the report and of all results; what is there is not done again")
      ->required()
      ->type_name("FOLDER");
  verb->add_option("--scenes", o->scenes,
                   "scene files, and folders with FOLDER/NAME/scene.xml, with commas between them")
      ->type_name("LIST")
      ->default_val("scenes");
  verb->add_option("--budget", o->budget,
                   "make everything smaller, alike for all methods, so that it takes about this long")
      ->type_name("T");
  verb->add_option("--references", o->references,
                   "folder that keeps the references, to share them; default: FOLDER/references")
      ->type_name("FOLDER");
  verb->add_option(
          "--only", o->only,
          "only cells with this in MATRIX/SCENE/METHOD/SWITCH/EQUAL/SEED; * and ? as in file names, commas between several")
      ->type_name("PATTERN");
  verb->add_option("--lpips-weights", o->lpips_weights,
                   "weights of LPIPS, as compare takes them; default: OCTRAD_LPIPS_WEIGHTS")
      ->type_name("DIR");
  verb->add_option("--oidn-library", o->oidn_library,
                   "Open Image Denoise's library, as render takes it; default: OCTRAD_OIDN_LIBRARY")
      ->type_name("PATH");
  verb->add_flag("--dry-run", o->dry_run, "only list the cells, and estimate how long they take");
  verb->add_flag("--no-viewers", o->no_viewers,
                 "a small page, to publish: pictures side by side, without viewers that flip and zoom");
  verb->callback([&program, o] {
    program.common.own_threads = 1;  // the clock of a training
    program.run = [&program, o] { paper_verb(program.common, *o); };
  });
}

}  // namespace octrad::cli
