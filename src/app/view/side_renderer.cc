#include "app/view/side_renderer.h"

#include <algorithm>
#include <cmath>

#include "app/report/picture_origin.h"
#include "octrad/base/json_file.h"
#include "octrad/base/stopwatch.h"
#include "octrad/image/tone_table.h"
#include "octrad/image/tonemap.h"

namespace octrad::viewer {
namespace {

constexpr int kMostSamples = 1 << 16, kMostCached = 256;  // a pixel: paths, and look-ups, which have little noise

}  // namespace

const ViewerModel* Studio::model_of(const Side& side) const {
  if (side.integrator == kStored || !find_integrator(side.integrator).info->needs_model) return nullptr;
  return &models.at(static_cast<std::size_t>(side.model));
}

void SideRenderer::show(const Side& side, const View& view) {
  const bool stored = side.integrator == kStored;
  const ViewerModel* model = studio_.model_of(side);
  if (model != nullptr && model->trainer != nullptr) model->trainer->field();  // brings it up to date
  if (!renderer_ || !(side == side_)) {
    renderer_.reset();
    pass_seconds_ = queries_per_second_ = rays_per_second_ = 0.0;
    side_ = side;
    if (stored) return;
    renderer_ =
        make_renderer(studio_.scene, side.integrator, studio_.settings, model != nullptr ? model->field : nullptr,
                      model != nullptr ? model->config : Config{}, studio_.stream);
  } else if (model != nullptr && model->trainer != nullptr && studio_.stream != nullptr) {
    renderer_->set_model(*model->field, model->config);  // the stream's copy of the weights
  }
  renderer_->set_view(view);
  renderer_->take_counts();
  seconds_ = 0.0;
}

bool SideRenderer::add_pass(const std::function<bool()>& stop) {
  if (!renderer_) return true;
  const Stopwatch watch;
  const int before = renderer_->samples();
  if (!renderer_->add_samples(next_pass(before, renderer_->largest_pass()), stop)) return false;
  pass_seconds_ = watch.seconds();
  pass_samples_ = std::max(1, renderer_->samples() - before);
  seconds_ += pass_seconds_;
  const SampleCounts counts = renderer_->take_counts();
  queries_per_second_ = static_cast<double>(counts.queries) / std::max(pass_seconds_, 1e-9);
  rays_per_second_ = static_cast<double>(counts.rays) / std::max(pass_seconds_, 1e-9);
  return true;
}

bool SideRenderer::finished() const {
  if (!renderer_) return true;
  const IntegratorInfo& info = renderer_->integrator();
  return renderer_->samples() >= (info.one_sample ? 1 : info.needs_model ? kMostCached : kMostSamples);
}

std::shared_ptr<Picture> SideRenderer::seen(const ChannelRange& channels) {
  auto picture = std::make_shared<Picture>();
  picture->image = renderer_->image(channels);
  picture->side = side_;
  picture->view = renderer_->view();
  picture->samples = renderer_->samples();
  picture->seconds = seconds_;
  return picture;
}

std::shared_ptr<const Picture> SideRenderer::glance(const ChannelRange& channels) {
  return renderer_ ? seen(channels) : studio_.stored;
}

std::shared_ptr<const Picture> SideRenderer::picture() {
  if (!renderer_) return studio_.stored;
  const std::shared_ptr<Picture> picture = seen({});
  const IntegratorInfo& info = renderer_->integrator();
  report::PictureOrigin origin(studio_.scene.scene(), picture->view, studio_.settings, info, side_.integrator);
  origin.spp = picture->samples;
  origin.seconds = seconds_;
  if (info.needs_model) {
    const ViewerModel& model = studio_.models.at(static_cast<std::size_t>(side_.model));
    origin.config = &model.config;
    origin.model_file = model.file;
    origin.model_step = model.trainer != nullptr ? model.trainer->state().step : model.info.state.step;
  }
  add_origin(picture->image, origin);
  if (const std::string fingerprint = studio_.scene.fingerprint(); fingerprint != studio_.scene.scene().fingerprint) {
    std::string& text = picture->image.metadata["octrad.scene"];
    nlohmann::json scene = parse_json(text, "octrad.scene");
    scene["fingerprint"] = fingerprint;
    text = json_text(scene);
  }
  if (info.denoised && studio_.denoiser) studio_.denoiser->run(picture->image, "the picture");
  return picture;
}

ChannelRange shown_channels(const ViewState& state) {
  const ChannelRange layer = channels_of(state.layer);
  return {0, layer.first + layer.count};
}

struct ToneMapper::Cached {
  ToneMapping mapping;
  Vec3f white;
  ToneTable table;
};

Image8 ToneMapper::show(const Image& picture, const ViewState& state) {
  const std::string layer = state.layer == kTrainingPoints ? "" : state.layer;
  const std::string first = layer + (layer == "normal"      ? ".X"
                                     : layer == "roughness" ? ".Y"
                                     : layer == "depth"     ? ".Z"
                                                            : ".R");
  if (!layer.empty() && picture.channel(first) < 0)
    return Image8(picture.width, picture.height, 3);  // a file without it
  if (layer == "normal") return vector_color(picture, layer);
  if (layer == "roughness") return false_color(picture, picture.channel(first), 0.0f, 1.0f);
  if (layer == "depth") {
    const int channel = picture.channel(first);
    float most = 1e-6f;
    for (std::size_t i = static_cast<std::size_t>(channel); i < picture.data.size(); i += picture.channels.size())
      if (std::isfinite(picture.data[i])) most = std::max(most, picture.data[i]);
    return false_color(picture, channel, 0.0f, most);
  }
  if (layer == "albedo") return tonemap(picture, {}, layer);
  const ToneMapping& m = state.mapping;
  if (!cached_ || cached_->mapping.exposure != m.exposure || cached_->mapping.curve != m.curve ||
      !(cached_->white == state.white))
    cached_ = std::make_shared<const Cached>(Cached{m, state.white, ToneTable(m, state.white)});
  return cached_->table(picture, picture.channel("R"));
}

}  // namespace octrad::viewer
