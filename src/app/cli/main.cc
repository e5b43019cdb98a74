// octrad: the command line. Parses, runs one verb, maps errors to exit codes (docs/manual.md, "Exit codes").
#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <iostream>
#include <new>
#include <string>
#include <string_view>
#include <system_error>

#include "app/cli/common.h"
#include "app/cli/open_scene.h"
#include "octrad/base/atomic_file.h"
#include "octrad/base/error.h"
#include "octrad/base/escape.h"
#include "octrad/base/interrupt.h"
#include "octrad/base/join.h"
#include "octrad/base/log.h"
#include "octrad/base/version.h"

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
    for (const std::string& name : option->get_snames()) names.push_back("-" + name);
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
  // Unknown words first: CLI11 may complain about something that is missing because of them.
  const auto option = std::find_if(extra.begin(), extra.end(),
                                   [](const std::string& word) { return word.size() > 1 && word[0] == '-'; });
  const bool missing = dynamic_cast<const CLI::RequiredError*>(&error) != nullptr;
  const bool unknown_verb = chosen.empty() && !extra.empty() && extra.front()[0] != '-';
  if (option != extra.end() && !unknown_verb) {
    const std::string word = option->substr(0, option->find('='));
    text = "unknown option " + word + did_you_mean(word, option_names(scope));
  } else if (unknown_verb) {
    text = "unknown verb \"" + extra.front() + "\"" + did_you_mean(extra.front(), verb_names(app));
  } else if (chosen.empty() && missing) {
    text = "which verb? there are " + join(verb_names(app));
  } else if (!extra.empty()) {
    text = "unexpected argument \"" + extra.front() + "\"";
  } else if (missing) {
    for (const CLI::Option* needed : scope.get_options()) {
      if (text == needed->get_name() + " is required") text += ": " + needed->get_description();
    }
  }
  return text + "; see " + help;
}

// A value without a character, or the name of another option, is most likely a variable that is not set. The first must
// not count as an option not given, and the second not as a file's name.
void refuse_lost_values(const CLI::App& verb) {
  const std::vector<std::string> names = option_names(verb);
  for (const CLI::Option* option : verb.get_options()) {
    for (const std::string& value : option->results()) {
      if (std::find(names.begin(), names.end(), value) != names.end())
        throw UsageError(fmt::format("{}: the value is missing, and {} is an option; see octrad {} --help",
                                     option->get_name(), value, verb.get_name()));
      if (value.empty())
        throw UsageError(
            fmt::format("{}: the value is empty; see octrad {} --help", option->get_name(), verb.get_name()));
    }
  }
}

int run(int argc, char** argv) {
  Program program;
  program.app.name("octrad");
  program.app.description("octrad trains and renders OctaOctree radiance caches of Mitsuba, glTF and pbrt scenes.");
  program.app.set_version_flag("--version", std::string("octrad ") + kVersion);
  program.app.require_subcommand(1);
  program.app.footer("octrad VERB --help explains a verb and shows an example.");
  add_train(program);
  add_render(program);
  add_view(program);
  add_compare(program);
  add_convert(program);
  add_merge(program);
  add_denoise(program);
  add_info(program);
  add_query(program);
  add_tonemap(program);
  add_selftest(program);
  add_paper(program);
  try {
    program.app.parse(argc, argv);
  } catch (const CLI::Success& success) {
    const int code = program.app.exit(success);  // --help, --version
    if (!std::cout.flush()) throw IoError("cannot write to standard output");
    return code;
  } catch (const CLI::ParseError& error) {
    log_error(explain(program.app, error));
    return static_cast<int>(ExitCode::usage);
  }
  const CLI::App& chosen = *program.app.get_subcommands().front();
  refuse_lost_values(chosen);
  const std::string verb = chosen.get_name();
  program.common.support = {"octrad " + verb, program.devices[verb] == Devices::cuda};
  program.common.apply();
  program.run();
  return interrupted() ? static_cast<int>(ExitCode::interrupted) : 0;
}

const std::string kNoThread = "a thread cannot be started (a limit of the user or of the container): ";

// The system's reason where the error is TBB's, that it could start no thread; else empty.
std::string refused_thread(const std::exception& error) {
  constexpr std::string_view of_tbb = "pthread_create has failed: ";
  const std::string_view what = error.what();
  return std::string(what.starts_with(of_tbb) ? what.substr(of_tbb.size()) : std::string_view());
}

// Who says so first ends the process, which another one waits for.
void say_no_thread(const std::string& reason) {
  static std::atomic_flag said = ATOMIC_FLAG_INIT;
  while (said.test_and_set()) pause();
  log_error(kNoThread + reason);
}

// TBB's threads start each other: where one is refused by then, nobody can catch the error.
[[noreturn]] void terminate() {
  try {
    if (const std::exception_ptr error = std::current_exception()) std::rethrow_exception(error);
  } catch (const std::exception& error) {
    if (const std::string reason = refused_thread(error); !reason.empty()) {
      remove_temporary_files();
      say_no_thread(reason);
      _exit(static_cast<int>(ExitCode::io));
    }
  } catch (...) {
  }
  std::abort();
}

// Where a standard stream is closed, the next file that is opened would take its place and get its text. What is opened
// here cannot be used: to print is then an error.
void fill_standard_streams() {
  for (int descriptor = STDIN_FILENO; descriptor <= STDERR_FILENO; ++descriptor) {
    if (fcntl(descriptor, F_GETFD) >= 0) continue;
    const int opened = open("/dev/null", descriptor == STDIN_FILENO ? O_WRONLY : O_RDONLY);
    if (opened != descriptor && opened >= 0) close(opened);
  }
}

}  // namespace
}  // namespace octrad::cli

int main(int argc, char** argv) {
  using octrad::ExitCode;
  octrad::cli::fill_standard_streams();
  std::set_terminate(octrad::cli::terminate);
  octrad::install_interrupt_handler();
  signal(SIGPIPE, SIG_IGN);  // a closed pipe is a failed write, with a message
  signal(SIGXFSZ, SIG_IGN);  // so is a file above the size limit
  try {
    return octrad::cli::run(argc, argv);
  } catch (const octrad::cli::SceneRefused& error) {
    octrad::log_error(error.what());
    std::fputs(octrad::printable(octrad::cli::way_out(error)).c_str(), stderr);
    return static_cast<int>(error.code());
  } catch (const octrad::Error& error) {
    octrad::log_error(error.what());
    return static_cast<int>(error.code());
  } catch (const std::bad_alloc&) {
    octrad::log_error("out of memory; --max-memory makes the estimate before the work stricter");
    return static_cast<int>(ExitCode::out_of_memory);
  } catch (const std::system_error& error) {
    const bool thread = error.code() == std::errc::resource_unavailable_try_again;
    if (thread) octrad::cli::say_no_thread(error.code().message());
    else octrad::log_error(error.what());  // of the file system
    return static_cast<int>(ExitCode::io);
  } catch (const std::exception& error) {
    if (const std::string reason = octrad::cli::refused_thread(error); !reason.empty()) {
      octrad::cli::say_no_thread(reason);
      return static_cast<int>(ExitCode::io);
    }
    octrad::log_error(std::string("internal error: ") + error.what() + "; please report it with the command line");
    return 70;  // EX_SOFTWARE of sysexits.h
  }
}
