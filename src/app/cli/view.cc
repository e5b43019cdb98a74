// octrad view: walk through a scene in a browser.
#include <fmt/format.h>
#include <spawn.h>
#include <sys/random.h>

#include <algorithm>
#include <chrono>
#include <thread>

#include "app/cli/common.h"
#include "app/cli/denoise_options.h"
#include "app/cli/open_scene.h"
#include "app/cli/render_session.h"
#include "app/cli/render_view.h"
#include "app/view/session.h"
#include "octrad/base/error.h"
#include "octrad/base/interrupt.h"
#include "octrad/base/json_file.h"
#include "octrad/base/log.h"
#include "octrad/image/io.h"
#include "octrad/image/tonemap.h"

extern char** environ;

namespace octrad::cli {
namespace {

using viewer::ServerOptions, viewer::Session, viewer::Studio, viewer::ViewerModel, viewer::ViewState, viewer::WebServer;

constexpr int kUsualSide = 1280;  // pixels of the longer side, where the scene asks for more

struct ViewVerbOptions {
  std::string scene, integrator, compare, reference;
  std::vector<std::string> models, definitions;
  bool force = false;
  int max_depth = -2;  // -2: the scene's
  ViewOptions view;
  ServerOptions server;
  bool open = false;
};

std::string random_token() {
  unsigned char bytes[16];
  if (getrandom(bytes, sizeof(bytes), 0) != static_cast<ssize_t>(sizeof(bytes)))
    throw IoError("the system gives no random numbers for a token; --token sets one");
  std::string token;
  for (const unsigned char byte : bytes) token += fmt::format("{:02x}", byte);
  return token;
}

void check_token(const std::string& token) {
  const bool plain = std::all_of(token.begin(), token.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_';
  });
  if (!plain || token.size() < 8 || token.size() > 128)
    throw UsageError("--token: expected 8 to 128 letters, digits, - or _");
}

// The page in the desktop's browser. That there is none is no error: the address was printed.
void open_page(const std::string& url) {
  std::string program = "xdg-open", address = url;
  char* words[] = {program.data(), address.data(), nullptr};
  pid_t child = 0;
  if (posix_spawnp(&child, program.c_str(), nullptr, nullptr, words, environ) != 0)
    log_warning("--open: xdg-open cannot be started");
}

ConfigOptions definitions_of(const ViewVerbOptions& o) {
  ConfigOptions definitions;
  definitions.definitions = o.definitions;
  return definitions;
}

std::vector<ViewerModel> open_models(const ViewVerbOptions& o, const Scene& scene) {
  std::vector<ViewerModel> models;
  for (const std::string& file : o.models) {
    Model model = load_model(file);
    check_scene(file, model.info, scene.file, scene.fingerprint, o.force);
    const Config config = model_config(model.info, definitions_of(o));
    models.push_back({file, std::move(model), config});
  }
  if (models.empty() && !definitions_of(o).config_definitions().empty())
    throw UsageError(fmt::format("-D {}: is for a --model", definitions_of(o).config_definitions().front().first));
  return models;
}

std::unique_ptr<Denoiser> find_denoiser() {
  try {
    return DenoiserOptions{}.make(false);
  } catch (const Error& error) {
    log_verbose("no denoiser: {}", error.what());
    return nullptr;
  }
}

// A picture to compare with. Where it says its camera, as those of octrad render do, one can go there.
std::shared_ptr<const viewer::Picture> open_reference(const std::string& file) {
  if (file.empty()) return nullptr;
  auto picture = std::make_shared<viewer::Picture>();
  picture->image = read_image(file);
  if (is_display_referred(picture->image) || picture->image.channel("R") < 0)
    picture->image = linear_color(picture->image);
  picture->side.integrator = viewer::kStored;
  picture->samples = metadata_value(picture->image, "octrad.render", "spp", 0);
  picture->seconds = metadata_value(picture->image, "octrad.render", "seconds", 0.0);
  const auto camera = picture->image.metadata.find("octrad.camera");
  if (camera == picture->image.metadata.end()) return picture;
  try {
    ViewState state;
    set_pose(state, parse_json(camera->second, "octrad.camera"));
    picture->view = {state.camera, picture->image.width, picture->image.height};
  } catch (const Error& error) {
    log_warning(fmt::format("{}: {}", file, error.what()));
  }
  return picture;
}

// What the page adds a camera, a size and an integrator to.
nlohmann::json command_of(const CommonOptions& common, const ViewVerbOptions& o) {
  const ConfigOptions definitions = definitions_of(o);
  nlohmann::json scene = nlohmann::json::array(), model = nlohmann::json::array();
  for (const auto& [key, value] : definitions.scene_definitions()) scene.push_back(key + "=" + value);
  for (const auto& [key, value] : definitions.config_definitions()) model.push_back(key + "=" + value);
  nlohmann::json command = {
      {"scene", o.scene}, {"definitions", scene}, {"model_definitions", model}, {"force", o.force}};
  if (o.max_depth >= -1) command["max_depth"] = o.max_depth;
  if (common.has_seed()) command["seed"] = common.seed;
  return command;
}

// The picture's camera, for pictures of that size.
Camera with_size(const viewer::Picture& picture) {
  Camera camera = picture.view.camera;
  camera.film_width = picture.image.width;
  camera.film_height = picture.image.height;
  return camera;
}

ViewState first_state(const ViewVerbOptions& o, const Scene& scene, const viewer::Picture* reference) {
  const bool free = !o.view.sensor_given && o.view.camera_file.empty();
  const View view = free && reference != nullptr && reference->view.width > 0
                        ? choose_view(scene, o.view, with_size(*reference))
                        : choose_view(scene, o.view, choose_camera(scene, o.view));
  ViewState state;
  set_pose(state, viewer::pose_json(view.camera));
  const bool chosen = o.view.width > 0 || o.view.height > 0;
  const double shrink =
      chosen ? 1.0 : std::min(1.0, static_cast<double>(kUsualSide) / std::max(view.width, view.height));
  state.width = static_cast<int>(view.width * shrink + 0.5);
  state.height = static_cast<int>(view.height * shrink + 0.5);
  for (const int side : {state.width, state.height}) {
    if (side < viewer::kLeastSize || side > viewer::kLargestSize)
      throw UsageError(fmt::format("a picture of {} x {} pixels: sides from {} to {} can be shown", state.width,
                                   state.height, viewer::kLeastSize, viewer::kLargestSize));
  }
  state.a.integrator = !o.integrator.empty() ? o.integrator : o.models.empty() ? "path" : "lhs";
  if (!o.compare.empty()) state.b = viewer::Side{o.compare, o.models.size() > 1 ? 1 : 0};
  else if (!o.reference.empty()) state.b = viewer::Side{viewer::kStored, 0};
  return state;
}

void view_verb(const CommonOptions& common, ViewVerbOptions o) {
  if (o.server.token.empty()) o.server.token = random_token();
  check_token(o.server.token);
  for (const std::string& name : {o.integrator, o.compare}) {
    if (!name.empty() && find_integrator(name).info->needs_model && o.models.empty())
      throw UsageError(fmt::format("integrator {} needs --model FILE.octrad", name));
  }
  const PreparedScene prepared(open_scene(o.scene, definitions_of(o).scene_definitions(), common.permissive));
  const Scene& scene = prepared.scene();
  Studio studio{prepared, open_models(o, scene), {}};
  const DeviceChoice device =
      studio.models.empty() ? common.choose_device() : common.choose_device(studio.models.front().config.field);
  const std::unique_ptr<Stream> stream = device.make_stream(definitions_of(o).tuning());
  studio.stream = stream.get();
  studio.settings.film = scene.film_of(static_cast<std::size_t>(std::max(0, o.view.sensor)));
  studio.settings.max_depth = o.max_depth >= -1 ? o.max_depth : scene.max_depth;
  studio.settings.seed = static_cast<unsigned long long>(std::max(0LL, common.seed));
  studio.settings.long_pass = 0.05;
  if (stream) studio.settings.max_memory = common.memory_budget(*stream) / 2;  // two sides
  studio.denoiser = find_denoiser();
  studio.stored = open_reference(o.reference);
  ViewState first;
  try {
    first = first_state(o, scene, studio.stored.get());
  } catch (const InputError& error) {
    throw UsageError(error.what());
  }
  prepared.tracer();  // built before anybody waits for it

  Session session(std::move(studio), std::move(first), command_of(common, o));
  WebServer server(o.server, session);
  struct Ending {
    Session& session;
    ~Ending() { session.stop(); }  // before the server ends
  } const ending{session};
  defer_interrupts();
  session.start(server);
  if (!viewer::is_loopback(o.server.address))
    log_warning(fmt::format(
        "--listen {}: whoever reaches this machine and learns the address below can watch and control, and others on the "
        "way can read along, for nothing is encrypted; ssh -L is safer (docs/viewer.md)",
        o.server.address));
  if (common.json) print_text(json_text({{"url", server.url()}}));
  else print_text(fmt::format("{}\nOpen this address in a browser; Ctrl-C ends.", server.url()));
  if (o.open) open_page(server.url());
  while (!interrupted()) {
    session.check();
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
}

}  // namespace

void add_view(Program& program) {
  auto o = std::make_shared<ViewVerbOptions>();
  CLI::App* verb = add_verb(program, "view", "Walk through a scene in a browser, path traced or from trained caches.",
                            "octrad view scene.xml --model room.octrad --open", Devices::cuda);
  verb->add_option("scene", o->scene, "Mitsuba 3 scene")->required()->type_name("SCENE.xml");
  CLI::Option* model = verb->add_option("--model", o->models, "trained cache; can be given more than once")
                           ->type_name("FILE.octrad")
                           ->expected(1)
                           ->allow_extra_args(false)
                           ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  verb->add_flag("--force", o->force, "use models although they were trained on another scene")->needs(model);
  verb->add_option("--integrator", o->integrator,
                   "what is shown first, as octrad render names it; default: lhs with a model, else path")
      ->type_name("NAME");
  verb->add_option("--compare", o->compare,
                   "integrator that is shown beside it, of the second model where there are two")
      ->type_name("NAME");
  verb->add_option("--reference", o->reference, "saved picture to compare with; of octrad render, it says its camera")
      ->type_name("PICTURE.exr");
  verb->add_option("--max-depth", o->max_depth,
                   "path: longest path as Mitsuba counts, -1 unlimited; default: the scene's")
      ->check(whole_in_range(-1, 1 << 20))
      ->type_name("D");
  verb->add_option("-D", o->definitions,
                   "set a parameter of the scene file, or a key render.* of the models, such as render.delta=cache")
      ->type_name("KEY=VALUE")
      ->expected(1)
      ->allow_extra_args(false)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  verb->add_option(
          "--width", o->view.width,
          "pixels of the picture at rest; alone, the height follows the sensor's aspect; default: the sensor's, at most 1280")
      ->check(whole_in_range(viewer::kLeastSize, viewer::kLargestSize))
      ->type_name("W")
      ->group("Camera");
  verb->add_option("--height", o->view.height, "pixels; alone, the width follows the sensor's aspect")
      ->check(whole_in_range(viewer::kLeastSize, viewer::kLargestSize))
      ->type_name("H")
      ->group("Camera");
  CLI::Option* sensor = verb->add_option("--sensor", o->view.sensor, "sensor of the scene to begin at, from 0")
                            ->check(whole_in_range(0, 1 << 20))
                            ->type_name("N")
                            ->group("Camera");
  verb->add_option("--camera", o->view.camera_file, "JSON file with origin, target, up, fov to begin at")
      ->type_name("FILE")
      ->group("Camera");
  add_permissive_option(*verb, program.common);
  verb->add_option("--port", o->server.port, "port to listen at; 0, the default: a free one")
      ->check(whole_in_range(0, 65535))
      ->type_name("N")
      ->group("Server");
  verb->add_option("--listen", o->server.address,
                   "address to listen at, in numbers; default 127.0.0.1, which this machine alone reaches")
      ->type_name("ADDRESS")
      ->group("Server");
  verb->add_option("--token", o->server.token, "secret of the printed address; default: a random one")
      ->type_name("T")
      ->group("Server");
  verb->add_flag("--open", o->open, "open the page in the desktop's browser (xdg-open)")->group("Server");
  verb->callback([&program, o, sensor] {
    o->view.sensor_given = sensor->count() > 0;
    program.run = [&program, o] { view_verb(program.common, *o); };
  });
}

}  // namespace octrad::cli
