// One side of the comparison: a renderer that changes its integrator, its model and its view, and the pictures of it.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "app/view/protocol.h"
#include "octrad/image/denoise.h"
#include "octrad/model/model_file.h"
#include "octrad/render/renderer.h"
#include "octrad/train/trainer.h"

namespace octrad::viewer {

struct ViewerModel {
  std::string file;
  ModelInfo info;
  Config config;                                          // with the keys render.* as they were asked for
  RadianceField* field = nullptr;                         // `own`, or the trainer's
  std::unique_ptr<RadianceField> own = {}, trained = {};  // as Model has them
  Trainer* trainer = nullptr;                             // that trains it: it is looked at in between (view/live.h)
};

// A picture with what it is of.
struct Picture {
  Image image;  // as octrad render saves it, with its metadata
  Side side;
  View view;
  int samples = 0;
  double seconds = 0.0;  // of sampling
};

// What pictures are made with; all of it outlives them.
struct Studio {
  const PreparedScene& scene;
  std::vector<ViewerModel> models;
  RenderSettings settings;
  Stream* stream = nullptr;                    // null: the CPU
  std::unique_ptr<Denoiser> denoiser = {};     // null: there is none
  std::shared_ptr<const Picture> stored = {};  // from a file; null: there is none

  // That a side's integrator asks; null: none.
  const ViewerModel* model_of(const Side& side) const;
};

class SideRenderer {
 public:
  explicit SideRenderer(Studio& studio) : studio_(studio) {}

  // From now on `side` seen in `view`, from an empty film, with the weights as they are now. Throws what
  // make_renderer() and set_view() throw.
  void show(const Side& side, const View& view);
  // The scene is another one: what integrators found out about it is no longer true.
  void scene_changed() { renderer_.reset(); }
  // Takes the next samples of every pixel, as render() does. False where `stop` said so: the film is as it was.
  bool add_pass(const std::function<bool()>& stop);
  bool finished() const;
  double last_pass_seconds() const { return pass_seconds_; }
  double last_sample_seconds() const { return pass_seconds_ / pass_samples_; }  // of one a pixel
  double last_queries_per_second() const { return queries_per_second_; }
  double last_rays_per_second() const { return rays_per_second_; }
  // The film as it is: all channels, denoised, where the integrator is, and with metadata.
  std::shared_ptr<const Picture> picture();
  // Quicker: those of `channels` alone, without all that.
  std::shared_ptr<const Picture> glance(const ChannelRange& channels);

 private:
  std::shared_ptr<Picture> seen(const ChannelRange& channels);

  Studio& studio_;
  Side side_;
  std::unique_ptr<Renderer> renderer_;
  int pass_samples_ = 1;
  double seconds_ = 0.0, pass_seconds_ = 0.0, queries_per_second_ = 0.0, rays_per_second_ = 0.0;
};

// Those that the screen or a question about a pixel needs: from the colour to the layer of `state`.
ChannelRange shown_channels(const ViewState& state);

// What of `picture` a screen shows: the layer of `state`, its radiance through the tone mapping where that is "".
class ToneMapper {
 public:
  Image8 show(const Image& picture, const ViewState& state);

 private:
  struct Cached;
  std::shared_ptr<const Cached> cached_;
};

}  // namespace octrad::viewer
