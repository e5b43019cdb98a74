// What octrad view and octrad train --view have in common: the server's options, its address, the page.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "app/cli/common.h"
#include "app/cli/render_view.h"
#include "app/view/session.h"

namespace octrad::cli {

struct ServeOptions {
  viewer::ServerOptions server;
  bool open = false;

  // `needs`: another option that they only mean something with; null: none.
  void add_to(CLI::App& verb, CLI::Option* needs = nullptr);
  // A random token where none was given. Throws UsageError for one that is no good.
  void prepare();
};

// Serves while session.run() does, printing the address first. The result is its.
bool serve(const ServeOptions& options, const CommonOptions& common, viewer::Session& session,
           const std::function<bool()>& interrupted);

// What the page needs for a command line of octrad render (docs/viewer.md, "hello").
nlohmann::json viewer_command(const CommonOptions& common, const std::string& scene,
                              const std::map<std::string, std::string>& of_scene,
                              const std::vector<std::pair<std::string, std::string>>& of_model);

// What the viewer shows first: pose and size of a view, smaller where it was not asked for in so many pixels
// (`chosen`). Throws UsageError for a size that cannot be shown.
viewer::ViewState first_state(const View& view, bool chosen);

// How the viewer renders; `sensor` gives the filter.
RenderSettings viewer_settings(const CommonOptions& common, const Scene& scene, int sensor, Stream* stream);

// The denoiser, where it can be had.
std::unique_ptr<Denoiser> find_denoiser();

}  // namespace octrad::cli
