// What is written into a rendered picture beside its pixels (docs/formats.md).
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "octrad/image/image.h"
#include "octrad/model/config.h"
#include "octrad/render/view.h"

namespace octrad::report {

// The attribute octrad.camera, which `render --camera` reads.
nlohmann::json camera_json(const Camera& camera);

// 16 hexadecimal digits of the view's mask; "" without one.
std::string mask_hash(const View& view);

struct PictureOrigin {
  const Scene& scene;
  const View& view;
  std::string integrator;
  int spp = 0;
  int max_depth = -1;          // -1 also where the integrator traces no paths
  std::string view_hash = {};  // what `render` compares beside the rest; "": left out
  unsigned long long seed = 0;
  double seconds = 0.0;  // of sampling
  // Null without a model.
  const Config* config = nullptr;
  std::string model_file = {};
  long long model_step = 0;
};

// Adds the attributes to the picture.
void add_origin(Image& image, const PictureOrigin& origin);

}  // namespace octrad::report
