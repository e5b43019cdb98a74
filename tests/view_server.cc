// octrad view, without the command line: server and session in a program that is small enough to be built with
// sanitizers. tests/cli/test_view.py and test_live.py run it instead of the program where $OCTRAD_VIEW_SERVER names it.
//   view_server view SCENE.xml [--model FILE] [--width N] [--height N] [--train] [--json] [-q]
#include <fmt/format.h>

#include <cstdio>
#include <stdexcept>
#include <string>

#include "app/view/session.h"
#include "octrad/base/interrupt.h"
#include "octrad/base/json_file.h"
#include "octrad/scene/load.h"

namespace {

using namespace octrad;

int run(const std::vector<std::string>& words) {
  std::string file, model_file;
  int width = 32, height = 24;
  bool train = false;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string& word = words[i];
    const auto value = [&] { return words.at(++i); };
    if (word == "--model") model_file = value();
    else if (word == "--width") width = std::stoi(value());
    else if (word == "--height") height = std::stoi(value());
    else if (word == "--train") train = true;
    else if (word != "--json" && word != "-q" && file.empty() && word[0] != '-') file = word;
    else if (word != "--json" && word != "-q") throw std::runtime_error("unexpected " + word);
  }
  PreparedScene scene(load_scene(file));
  viewer::Studio studio{scene, {}, {}};
  studio.settings.film = scene.scene().film;
  studio.settings.max_depth = scene.scene().max_depth;
  studio.settings.long_pass = 0.05;
  Model model;
  std::unique_ptr<Trainer> trainer;
  std::unique_ptr<viewer::LiveTraining> live;
  if (!model_file.empty()) {
    model = load_model(model_file, true);
    viewer::ViewerModel shown{model_file, model.info, model.info.config, model.field.get()};
    if (train) {
      TrainOptions options;
      options.resume = &model;
      trainer = std::make_unique<Trainer>(scene, model.info.config, options);
      shown.field = &trainer->field();
      shown.trainer = trainer.get();
      live =
          std::make_unique<viewer::LiveTraining>(scene, *trainer, viewer::LiveTraining::Options{false, false, false});
    }
    studio.models.push_back(std::move(shown));
  }
  viewer::ViewState first;
  set_pose(first, viewer::pose_json(scene.scene().cameras.front()));
  first.width = width;
  first.height = height;
  first.a.integrator = model_file.empty() ? "path" : "lhs";
  viewer::Session session(std::move(studio), std::move(first),
                          {{"scene", file},
                           {"definitions", nlohmann::json::array()},
                           {"model_definitions", nlohmann::json::array()},
                           {"force", false}},
                          live.get());
  viewer::ServerOptions options;
  options.token = "token-of-the-test";
  viewer::WebServer server(options, session);
  defer_interrupts();
  session.start(server);
  std::puts(json_text({{"url", server.url()}}).c_str());
  std::fflush(stdout);
  session.run(interrupted);
  session.stop();
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  octrad::install_interrupt_handler();
  try {
    return run({argv + std::min(argc, 2), argv + argc});
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
