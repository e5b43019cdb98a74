// A cache while it is trained, as the scene's first sensor sees it, in the viewer tev.
#pragma once

#include <memory>
#include <string>

#include "app/cli/tev_client.h"
#include "octrad/render/renderer.h"
#include "octrad/train/trainer.h"

namespace octrad::cli {

class TevTraining {
 public:
  // `address`: as TevClient's. scene, trainer and stream must outlive this. `max_memory`: RenderSettings.
  TevTraining(const std::string& address, std::string name, const PreparedScene& scene, Trainer& trainer,
              Stream* stream, std::uint64_t max_memory);
  // Between steps: shows the cache where a picture is due, and in the end whatever is due. Training counts neither the
  // time nor the queries.
  void update(bool last = false);

 private:
  TevClient client_;
  const std::string name_;
  Trainer& trainer_;
  std::unique_ptr<Renderer> renderer_;
};

}  // namespace octrad::cli
