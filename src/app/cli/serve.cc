#include "app/cli/serve.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/random.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>

#include "app/cli/denoise_options.h"
#include "octrad/base/error.h"
#include "octrad/base/interrupt.h"
#include "octrad/base/json_file.h"
#include "octrad/base/log.h"

extern char** environ;

namespace octrad::cli {
namespace {

constexpr int kUsualSide = 1280;  // pixels of the longer side, where the scene asks for more

std::string random_token() {
  unsigned char bytes[16];
  if (getrandom(bytes, sizeof(bytes), 0) != static_cast<ssize_t>(sizeof(bytes)))
    throw IoError("the system gives no random numbers for a token; --token sets one");
  std::string token;
  for (const unsigned char byte : bytes) token += fmt::format("{:02x}", byte);
  return token;
}

// The page in the desktop's browser. That there is none is no error: the address was printed. The browser goes on when
// this process is interrupted, and what it prints is not among the results of this one.
void open_page(const std::string& url) {
  std::string program = "xdg-open", address = url;
  char* words[] = {program.data(), address.data(), nullptr};
  posix_spawnattr_t attributes;
  posix_spawn_file_actions_t files;
  posix_spawnattr_init(&attributes);
  posix_spawn_file_actions_init(&files);
  sigset_t ignored_here;
  sigemptyset(&ignored_here);
  for (const int signal : {SIGPIPE, SIGXFSZ, SIGHUP}) sigaddset(&ignored_here, signal);
  posix_spawnattr_setsigdefault(&attributes, &ignored_here);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSID | POSIX_SPAWN_SETSIGDEF);
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&files, STDERR_FILENO, STDOUT_FILENO);
  pid_t child = 0;
  if (posix_spawnp(&child, program.c_str(), &files, &attributes, words, environ) != 0)
    log_warning("--open: xdg-open cannot be started");
  posix_spawn_file_actions_destroy(&files);
  posix_spawnattr_destroy(&attributes);
}

}  // namespace

void ServeOptions::add_to(CLI::App& verb, CLI::Option* needs) {
  CLI::Option* const options[] = {
      verb.add_option("--port", server.port, "port to listen at; 0, the default: a free one")
          ->check(whole_in_range(0, 65535))
          ->type_name("N"),
      verb.add_option("--listen", server.address,
                      "address to listen at, in numbers; default 127.0.0.1, which this machine alone reaches")
          ->type_name("ADDRESS"),
      verb.add_option("--token", server.token, "secret of the printed address; default: a random one")->type_name("T"),
      verb.add_flag("--open", open, "open the page in the desktop's browser (xdg-open)")};
  for (CLI::Option* option : options) {
    option->group("Server");
    if (needs != nullptr) option->needs(needs);
  }
}

void ServeOptions::prepare() {
  std::string& token = server.token;
  if (token.empty()) token = random_token();
  const bool plain = std::all_of(token.begin(), token.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_';
  });
  if (!plain || token.size() < 8 || token.size() > 128)
    throw UsageError("--token: expected 8 to 128 letters, digits, - or _");
}

bool serve(const ServeOptions& options, const CommonOptions& common, viewer::Session& session,
           const std::function<bool()>& interrupted) {
  viewer::WebServer server(options.server, session);
  struct Ending {
    viewer::Session& session;
    ~Ending() { session.stop(); }  // before the server ends
  } const ending{session};
  defer_interrupts();
  session.start(server);
  if (!viewer::is_loopback(options.server.address))
    log_warning(fmt::format(
        "--listen {}: whoever reaches this machine and learns the address below can watch and control, and others on the "
        "way can read along, for nothing is encrypted; ssh -L is safer (docs/viewer.md)",
        options.server.address));
  if (common.json) print_text(json_text({{"url", server.url()}}));
  else print_text(fmt::format("{}\nOpen this address in a browser; Ctrl-C ends.", server.url()));
  if (options.open) open_page(server.url());
  return session.run(interrupted);
}

nlohmann::json viewer_command(const CommonOptions& common, const std::string& scene,
                              const std::map<std::string, std::string>& of_scene,
                              const std::vector<std::pair<std::string, std::string>>& of_model) {
  const auto listed = [](const auto& definitions) {
    nlohmann::json list = nlohmann::json::array();
    for (const auto& [key, value] : definitions) list.push_back(key + "=" + value);
    return list;
  };
  return {{"scene", scene},
          {"definitions", listed(of_scene)},
          {"model_definitions", listed(of_model)},
          {"force", false},
          {"permissive", common.permissive}};
}

viewer::ViewState first_state(const View& view, bool chosen) {
  viewer::ViewState state;
  set_pose(state, viewer::pose_json(view.camera));
  const double shrink =
      chosen ? 1.0 : std::min(1.0, static_cast<double>(kUsualSide) / std::max(view.width, view.height));
  const int least = chosen ? 1 : viewer::kLeastSize;  // of a very long picture, unless a size was asked for
  state.width = std::max(least, static_cast<int>(view.width * shrink + 0.5));
  state.height = std::max(least, static_cast<int>(view.height * shrink + 0.5));
  for (const int side : {state.width, state.height}) {
    if (side < viewer::kLeastSize || side > viewer::kLargestSize)
      throw UsageError(fmt::format("a picture of {} x {} pixels: sides from {} to {} can be shown", state.width,
                                   state.height, viewer::kLeastSize, viewer::kLargestSize));
  }
  return state;
}

RenderSettings viewer_settings(const CommonOptions& common, const Scene& scene, int sensor, Stream* stream) {
  RenderSettings settings;
  settings.film = scene.film_of(static_cast<std::size_t>(std::max(0, sensor)));
  settings.max_depth = scene.max_depth;
  settings.seed = static_cast<unsigned long long>(std::max(0LL, common.seed));
  settings.long_pass = 0.05;
  if (stream != nullptr) settings.max_memory = common.memory_budget(*stream) / 2;  // two sides
  return settings;
}

std::unique_ptr<Denoiser> find_denoiser() {
  try {
    return DenoiserOptions{}.make(false);
  } catch (const Error& error) {
    log_verbose("no denoiser: {}", error.what());
    return nullptr;
  }
}

}  // namespace octrad::cli
