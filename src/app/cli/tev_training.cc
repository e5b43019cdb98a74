#include "app/cli/tev_training.h"

#include <algorithm>

#include "app/cli/render_view.h"
#include "octrad/base/stopwatch.h"

namespace octrad::cli {
namespace {

constexpr int kWidth = 512;  // at most: a picture of one sample a pixel takes tens of milliseconds

}  // namespace

TevTraining::TevTraining(const std::string& address, std::string name, const PreparedScene& scene, Trainer& trainer,
                         Stream* stream, std::uint64_t max_memory)
    : client_(address),
      name_(std::move(name)),
      trainer_(trainer) {
  ViewOptions options;
  const Camera camera = choose_camera(scene.scene(), options);
  options.width = std::min(kWidth, camera.film_width);
  RenderSettings settings;
  settings.film = scene.scene().film;
  settings.expected_spp = 1;
  settings.max_memory = max_memory;
  renderer_ = make_renderer(scene, "lhs", settings, &trainer.field(), trainer.config(), stream);
  renderer_->set_view(choose_view(scene.scene(), options, camera));
}

void TevTraining::update(bool last) {
  if (!last && !client_.due()) return;
  trainer_.untimed([&] {
    const Stopwatch watch;
    renderer_->set_model(trainer_.field(), trainer_.config());
    renderer_->add_samples(1);
    client_.show(name_, renderer_->image(), watch.seconds());
    renderer_->take_counts();
  });
}

}  // namespace octrad::cli
