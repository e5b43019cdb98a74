// What is written into a rendered picture beside its pixels (docs/formats.md).
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "octrad/image/image.h"
#include "octrad/model/config.h"
#include "octrad/render/film.h"
#include "octrad/render/view.h"

namespace octrad::report {

// The attribute octrad.camera, which `render --camera` reads.
nlohmann::json camera_json(const Camera& camera);

// All that a camera is, and a film's filter, as text to compare.
std::string whole_camera(const Camera& camera);
std::string filter_text(const Film& film);
// 16 hexadecimal digits of what a picture depends on and its other metadata does not say.
std::string view_hash(const View& view, const Film& film);
// 16 hexadecimal digits of the view's mask; "" without one.
std::string mask_hash(const View& view);

struct PictureOrigin {
  const Scene& scene;
  const View& view;
  const Film& film;
  std::string integrator;
  int spp = 0;
  int max_depth = -1;  // -1 also where the integrator traces no paths
  int rr_depth = -1;   // likewise
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
