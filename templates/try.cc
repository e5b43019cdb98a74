// Run by tests/test_templates.py: what the templates do in a picture, in numbers. try SCENE.xml FIELD STEPS
#include <octrad/octrad.h>

#include <cmath>
#include <cstdio>

namespace {

octrad::Image picture(const octrad::PreparedScene& scene, const char* integrator,
                      octrad::RadianceField* field = nullptr, const octrad::Config& config = {},
                      octrad::Stream* stream = nullptr) {
  const auto renderer = octrad::make_renderer(scene, integrator, {}, field, config, stream);
  renderer->set_view({scene.scene().cameras.front(), 48, 36, {}});
  octrad::RenderBudget budget;
  budget.spp = 16;
  return octrad::render(*renderer, budget).image;
}

double mean(const octrad::Image& image) {
  double sum = 0.0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) sum += static_cast<double>(image.rgb(x, y).y);
  }
  return sum / static_cast<double>(image.pixel_count());
}

}  // namespace

int main(int, char** argv) {
  const auto stream = octrad::make_host_stream();  // outlives the scene, which keeps a copy on it
  const octrad::PreparedScene scene(octrad::load_scene(argv[1]));
  octrad::Config config = octrad::preset("cpu");
  octrad::set(config, "field", argv[2]);
  octrad::set(config, "train.steps", argv[3]);
  const octrad::TrainResult trained = octrad::train(scene, config, {});
  const octrad::Image lhs = picture(scene, "lhs", trained.field.get(), config);
  const octrad::Image occlusion = picture(scene, "occlusion");
  const octrad::Image again = picture(scene, "occlusion", nullptr, {}, stream.get());
  int differing = 0;
  for (std::size_t i = 0; i < again.data.size(); ++i)
    differing += std::fabs(again.data[i] - occlusion.data[i]) > 1e-3f * (1.0f + std::fabs(occlusion.data[i]));
  std::printf(R"({"fingerprint": "%s", "path": %.6g, "loss": %.6g, "lhs": %.6g, "occlusion": %.6g, "differing": %.6g})",
              scene.scene().fingerprint.c_str(), mean(picture(scene, "path")), trained.loss, mean(lhs), mean(occlusion),
              static_cast<double>(differing) / static_cast<double>(again.data.size()));
  return 0;
}
