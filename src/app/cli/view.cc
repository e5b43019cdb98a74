// octrad view: walk through a scene in a browser.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>

#include "app/cli/common.h"
#include "app/cli/open_scene.h"
#include "app/cli/render_session.h"
#include "app/cli/render_view.h"
#include "app/cli/serve.h"
#include "app/report/picture_origin.h"
#include "app/view/session.h"
#include "octrad/base/atomic_file.h"
#include "octrad/base/bytes.h"
#include "octrad/base/error.h"
#include "octrad/base/huge_pages.h"
#include "octrad/base/interrupt.h"
#include "octrad/base/json_file.h"
#include "octrad/base/log.h"
#include "octrad/image/io.h"
#include "octrad/image/tonemap.h"
#include "octrad/scene/fingerprint.h"
#include "octrad/train/trainer.h"

namespace octrad::cli {
namespace {

using viewer::LiveTraining, viewer::Session, viewer::Studio, viewer::ViewerModel, viewer::ViewState;

struct ViewVerbOptions {
  std::string scene, integrator, compare, reference;
  std::vector<std::string> models;
  ConfigOptions definitions;
  bool force = false;
  int max_depth = -2;  // -2: the scene's
  ViewOptions view;
  ServeOptions serve;
  bool train = false;
  std::string output;
};

// `held`: of the one that is trained on (load_to_train).
std::vector<ViewerModel> open_models(const ViewVerbOptions& o, const Scene& scene, std::uint64_t& held) {
  std::vector<ViewerModel> models;
  for (const std::string& file : o.models) {
    Model model = o.train && models.empty() ? load_to_train(file, held) : load_model(file, false);
    check_scene(file, model.info, scene.file, scene.fingerprint, o.force);
    ViewerModel made{file, model.info, model_config(model.info, o.definitions)};
    if (models.empty()) warn_of_ignored_keys(o.definitions, made.config);
    made.own = std::move(model.field);
    made.trained = std::move(model.trained);
    made.field = made.own.get();
    models.push_back(std::move(made));
  }
  if (models.empty()) o.definitions.refuse_config_definitions("is for a --model");
  return models;
}

// A picture to compare with. Where it says its camera, as those of octrad render do, one can go there.
std::shared_ptr<const viewer::Picture> open_reference(const std::string& file) {
  if (file.empty()) return nullptr;
  auto picture = std::make_shared<viewer::Picture>();
  picture->image = read_image(file);
  const auto lacks = [&](const char* channel) { return picture->image.channel(channel) < 0; };
  if (is_display_referred(picture->image) || lacks("R") || lacks("G") || lacks("B"))
    picture->image = linear_color(picture->image);
  picture->side.integrator = viewer::kStored;
  picture->samples = report::metadata_value(picture->image, "octrad.render", "spp", 0);
  picture->seconds = report::metadata_value(picture->image, "octrad.render", "seconds", 0.0);
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
  nlohmann::json command =
      viewer_command(common, o.scene, o.definitions.scene_definitions(), o.definitions.config_definitions());
  command["force"] = o.force;
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
  ViewState state = cli::first_state(view, o.view.width > 0 || o.view.height > 0);
  state.a.integrator = !o.integrator.empty() ? o.integrator : o.models.empty() ? "path" : "lhs";
  if (!o.compare.empty()) state.b = viewer::Side{o.compare, o.models.size() > 1 ? 1 : 0};
  else if (!o.reference.empty()) state.b = viewer::Side{viewer::kStored, 0};
  return state;
}

// Trains the model on, from where it is; it holds `held` bytes already.
std::unique_ptr<Trainer> make_trainer(const CommonOptions& common, const ViewVerbOptions& o, const PreparedScene& scene,
                                      ViewerModel& model, Stream* stream, std::uint64_t held) {
  Model resumed{.info = model.info, .field = std::move(model.own), .trained = std::move(model.trained)};
  TrainOptions options;
  options.output = o.output;
  options.stream = stream;
  options.resume = &resumed;
  options.max_memory = static_cast<double>(stream != nullptr ? common.memory_budget(*stream) : common.memory_budget());
  const std::uint64_t resident = resident_bytes();
  options.used_memory =
      static_cast<double>(stream != nullptr ? scene.bytes_to_upload(*stream) : resident - std::min(resident, held));
  options.saved = [](const std::string& file, long long step) {
    log_info("saved {} at step {}", file, format_count(step));
  };
  options.not_saved = [](const std::string& why, long long) { warn_not_saved(why); };
  if (const std::string& cameras = resumed.info.config.train_cameras; !cameras.empty()) {
    refuse_input_as_output("-o", o.output, {cameras});
    options.cameras = read_cameras(cameras);
  }
  if (resumed.info.state.has_other_sensors(sensors_fingerprint(scene.scene(), options.cameras)))
    log_warning(fmt::format("{} was trained with other sensors, cameras or sampling weights of lights", model.file));
  auto trainer = std::make_unique<Trainer>(scene, resumed.info.config, options);
  model.field = &trainer->field();
  model.trainer = trainer.get();
  return trainer;
}

// Holds the file that the training is saved to; refuses one that is read too, or that is another model.
std::unique_ptr<WriterLock> hold_output(const ViewVerbOptions& o) {
  if (o.output.empty()) return nullptr;
  auto lock = std::make_unique<WriterLock>(o.output);
  std::vector<std::string> inputs = {o.scene, o.reference, o.view.camera_file};
  inputs.insert(inputs.end(), o.models.begin() + 1, o.models.end());
  refuse_input_as_output("-o", o.output, inputs);
  std::error_code ignored;
  if (std::filesystem::is_regular_file(o.output) && !std::filesystem::equivalent(o.output, o.models.front(), ignored))
    throw UsageError(fmt::format("{} exists, and is not {}, which is trained on", o.output, o.models.front()));
  return lock;
}

void view_verb(const CommonOptions& common, ViewVerbOptions o) {
  o.serve.prepare();
  const std::unique_ptr<WriterLock> lock = hold_output(o);
  for (const std::string& name : {o.integrator, o.compare}) {
    if (!name.empty() && find_integrator(name).info->needs_model && o.models.empty())
      throw UsageError(fmt::format("integrator {} needs --model FILE.octrad", name));
  }
  std::unique_ptr<Stream> stream;  // outlives the scene's copy on it
  PreparedScene prepared(open_scene(o.scene, o.definitions.scene_definitions(), common.permissive, {{"-o", o.output}}));
  use_huge_pages();
  const Scene& scene = prepared.scene();
  std::uint64_t held = 0;
  Studio studio{prepared, open_models(o, scene, held), {}};
  const DeviceChoice device =
      studio.models.empty() ? common.choose_device() : common.choose_device(studio.models.front().config.field);
  stream = device.make_stream(o.definitions.tuning());
  studio.stream = stream.get();
  studio.denoiser = find_denoiser();
  studio.stored = open_reference(o.reference);
  ViewState first;
  try {
    first = first_state(o, scene, studio.stored.get());
  } catch (const InputError& error) {
    if (!o.view.camera_file.empty()) throw;
    throw UsageError(error.what());
  }
  prepared.tracer();  // built before anybody waits for it

  std::unique_ptr<Trainer> trainer;
  long long first_step = 0;
  std::unique_ptr<LiveTraining> live;
  if (o.train) {
    trainer = make_trainer(common, o, prepared, studio.models.front(), stream.get(), held);
    first_step = trainer->state().step;
    live = std::make_unique<LiveTraining>(prepared, *trainer, LiveTraining::Options{false, !o.output.empty(), false});
  }
  // Pictures have what the training leaves of the memory.
  studio.settings = viewer_settings(common, scene, o.view.sensor, stream.get());
  if (o.max_depth >= -1) studio.settings.max_depth = o.max_depth;
  Session session(std::move(studio), std::move(first), command_of(common, o), live.get());
  serve(o.serve, common, session, interrupted);
  // A model that nothing was added to stays as it is.
  const bool trained = trainer && trainer->state().step > first_step;
  if (trained && !o.output.empty()) trainer->checkpoint(true);
}

}  // namespace

void add_view(Program& program) {
  auto o = std::make_shared<ViewVerbOptions>();
  CLI::App* verb = add_verb(program, "view", "Walk through a scene in a browser, path traced or from trained caches.",
                            "octrad view scene.xml --model room.octrad --open", Devices::cuda);
  verb->add_option("scene", o->scene, "Mitsuba XML, glTF or pbrt")->required()->type_name("SCENE");
  CLI::Option* model = verb->add_option("--model", o->models, "trained cache; can be given more than once")
                           ->type_name("FILE.octrad")
                           ->expected(1)
                           ->allow_extra_args(false)
                           ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  add_force_option(*verb, o->force)->needs(model);
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
  o->definitions.add_definitions_to(*verb, ", or a key render.* of the models, such as render.delta=cache");
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
  CLI::Option* train =
      verb->add_flag("--train", o->train, "the page can train the (first) model on, and edit lights and materials")
          ->needs(model)
          ->group("Training");
  verb->add_option("-o,--output", o->output,
                   "file that it is saved to: at checkpoints, when the page asks for it, and at the end")
      ->type_name("MODEL.octrad")
      ->needs(train)
      ->group("Training");
  o->serve.add_to(*verb);
  verb->callback([&program, o, sensor] {
    o->view.sensor_given = sensor->count() > 0;
    program.common.own_threads = 4;  // the server, the renderer, what reads models, and the clock of a training
    program.run = [&program, o] { view_verb(program.common, *o); };
  });
}

}  // namespace octrad::cli
