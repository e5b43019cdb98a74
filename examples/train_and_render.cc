// Loads a scene, trains a radiance cache for ten seconds, and renders the scene's view with one query a sample.
//   train_and_render SCENE.xml MODEL.octrad PICTURE.png [SECONDS]
#include <octrad/octrad.h>

#include <cstdio>

int main(int argc, char** argv) {
  if (argc < 4) {
    std::fprintf(stderr, "usage: train_and_render SCENE.xml MODEL.octrad PICTURE.png [SECONDS]\n");
    return 1;
  }
  try {
    const octrad::PreparedScene scene(octrad::load_scene(argv[1]));

    octrad::Config config = octrad::preset("cpu");
    config.train_seconds = argc > 4 ? std::atof(argv[4]) : 10.0;
    octrad::TrainOptions options;
    options.output = argv[2];
    options.progress = [](const octrad::TrainProgress& p) { std::printf("\rstep %lld, loss %.4f ", p.step, p.loss); };
    const octrad::TrainResult trained = octrad::train(scene, config, options);

    octrad::RenderSettings settings;
    settings.film = scene.scene().film;
    const auto renderer = octrad::make_renderer(scene, "lhs", settings, trained.field.get(), config);
    renderer->set_view({scene.scene().cameras.front(), 320, 240, {}});
    octrad::RenderBudget budget;
    budget.spp = 16;
    const octrad::RenderResult picture = octrad::render(*renderer, budget);
    octrad::write_image(argv[3], picture.image);  // PNG by its ending: tone-mapped
    std::printf("\n%lld steps, then %lld queries in %.2f s\n", trained.steps, picture.counts.queries, picture.seconds);
  } catch (const octrad::Error& error) {  // what a user can mend; the message says how
    std::fprintf(stderr, "%s\n", error.what());
    return static_cast<int>(error.code());
  }
  return 0;
}
