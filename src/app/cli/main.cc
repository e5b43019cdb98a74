// octrad: the command line. Parses, runs one verb, maps errors to exit codes (docs/manual.md, "Exit codes").
#include <signal.h>

#include <exception>
#include <filesystem>
#include <new>

#include "app/cli/common.h"
#include "base/error.h"
#include "base/interrupt.h"
#include "base/log.h"
#include "base/version.h"

namespace octrad::cli {
namespace {

std::vector<std::string> verb_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* verb : app.get_subcommands(nullptr)) names.push_back(verb->get_name());
  return names;
}

std::vector<std::string> option_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  return names;
}

// What CLI11 found wrong, with a suggestion where there is one.
std::string explain(const CLI::App& app, const CLI::ParseError& error) {
  const std::vector<CLI::App*> chosen = app.get_subcommands();
  const CLI::App& scope = chosen.empty() ? app : *chosen.front();
  const std::string help = chosen.empty() ? "octrad --help" : "octrad " + scope.get_name() + " --help";
  std::string text = error.what();
  const std::vector<std::string> extra = app.remaining(true);
  if (dynamic_cast<const CLI::ExtrasError*>(&error) && !extra.empty()) {
    const std::string word = extra.front().substr(0, extra.front().find('='));
    if (word.compare(0, 1, "-") == 0) text = "unknown option " + word + did_you_mean(word, option_names(scope));
    else if (chosen.empty()) text = "unknown verb \"" + word + "\"" + did_you_mean(word, verb_names(app));
    else text = "unexpected argument \"" + word + "\"";
  } else if (dynamic_cast<const CLI::RequiredError*>(&error) && chosen.empty()) {
    // CLI11 misses the verb before it looks at what else is there.
    std::string list;
    for (const std::string& name : verb_names(app)) list += (list.empty() ? "" : ", ") + name;
    if (extra.empty()) text = "which verb? there are " + list;
    else text = "unknown verb \"" + extra.front() + "\"" + did_you_mean(extra.front(), verb_names(app));
  }
  return text + "; see " + help;
}

int run(int argc, char** argv) {
  Program program;
  program.app.name("octrad");
  program.app.description("octrad trains and renders OctaOctree radiance caches of Mitsuba scenes.");
  program.app.set_version_flag("--version", std::string("octrad ") + kVersion);
  program.app.require_subcommand(1);
  program.app.footer("octrad VERB --help explains a verb and shows an example.");
  add_compare(program);
  add_info(program);
  add_tonemap(program);
  try {
    program.app.parse(argc, argv);
  } catch (const CLI::Success& success) {
    return program.app.exit(success);  // --help, --version
  } catch (const CLI::ParseError& error) {
    log_error(explain(program.app, error));
    return static_cast<int>(ExitCode::usage);
  }
  program.common.apply();
  program.run();
  return interrupted() ? static_cast<int>(ExitCode::interrupted) : 0;
}

}  // namespace
}  // namespace octrad::cli

int main(int argc, char** argv) {
  using octrad::ExitCode;
  octrad::install_interrupt_handler();
  signal(SIGPIPE, SIG_IGN);  // a closed pipe is a failed write, with a message
  signal(SIGXFSZ, SIG_IGN);  // so is a file above the size limit
  try {
    return octrad::cli::run(argc, argv);
  } catch (const octrad::Error& error) {
    octrad::log_error(error.what());
    return static_cast<int>(error.code());
  } catch (const std::bad_alloc&) {
    octrad::log_error("out of memory; --max-memory makes the estimate before the work stricter");
    return static_cast<int>(ExitCode::out_of_memory);
  } catch (const std::filesystem::filesystem_error& error) {
    octrad::log_error(error.what());
    return static_cast<int>(ExitCode::io);
  } catch (const std::exception& error) {
    octrad::log_error(std::string("internal error: ") + error.what() + "; please report it with the command line");
    return 70;  // EX_SOFTWARE of sysexits.h
  }
}
