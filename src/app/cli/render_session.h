// What octrad render chooses and loads before the first sample, and what is done with each of its pictures.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "app/cli/common.h"
#include "app/cli/denoise_options.h"
#include "app/cli/render_view.h"
#include "app/cli/tev_client.h"
#include "octrad/base/atomic_file.h"
#include "octrad/model/model_file.h"
#include "octrad/render/renderer.h"

namespace octrad::cli {

struct RenderVerbOptions {
  std::string scene, output, integrator, model;
  bool force = false;
  int spp = 0;         // 0: the integrator's own
  int max_depth = -2;  // -2: the scene's
  int rr_depth = 0;    // 0: 5
  std::string time;
  ViewOptions view;
  ConfigOptions definitions;
  int frames = 0;
  bool denoise = false;
  DenoiserOptions denoiser;
  ExrOptions exr;
  std::string tev;
  bool overwrite = false;  // frames of a path
  bool resume = false;
  std::string save_every;
};

// Members are made in their order.
struct RenderSession {
  // Throws for options that contradict each other or cannot be used, before anything is loaded, and what loading
  // throws.
  RenderSession(const CommonOptions& common, RenderVerbOptions options);

  const CommonOptions& common;
  const RenderVerbOptions o;  // with what follows from others filled in
  const WriterLock lock;      // of o.output
  const IntegratorInfo& integrator;
  std::optional<Model> model;
  const DeviceChoice device;
  const std::unique_ptr<Stream> stream;  // null: the CPU
  const std::unique_ptr<Denoiser> denoiser;
  const PreparedScene prepared;
  const std::unique_ptr<JsonLines> log;
  const std::unique_ptr<TevClient> tev;  // null: nobody watches
  Config config;                         // of the model
  RenderSettings settings;
  RenderBudget budget;
  std::unique_ptr<Renderer> renderer;

  const Scene& scene() const { return prepared.scene(); }
  // Makes the renderer and shows it `view`.
  void start(const View& view);
  // Picture of the renderer's view, with progress: `begin` and `share` say which part of the whole work it is. From
  // here on there is something to save when a signal comes.
  RenderResult render_picture(double begin = 0.0, double share = 1.0);
  // Adds the metadata, denoises and writes the picture. When the denoiser fails the picture is saved with its noise.
  void save(RenderResult& result, const View& view, unsigned long long seed, const std::string& file);
  // In what a picture of the view that is on disk differs from what would be rendered, for a message; "" for nothing.
  // `least_spp`: that many samples a pixel or more.
  std::string difference(const Image& image, const View& view, unsigned long long seed, int least_spp) const;
  // What --json says of pictures, and `event` of the log.
  nlohmann::json report(const RenderResult& result, const View& view) const;
  void log_event(const std::string& event, nlohmann::json fields) const;

  double denoise_seconds = 0.0;  // of all pictures
  double bounce_below = 0.0;     // render/highlights.h; of lhs

 private:
  Progress progress_;
};

// The configuration of a cached picture: the model's, with what may change after training.
Config model_config(const ModelInfo& info, const ConfigOptions& definitions);

// render_frames.cc: the frames of --path.
void render_frames(RenderSession& session);

}  // namespace octrad::cli
