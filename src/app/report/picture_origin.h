// What is written into a rendered picture beside its pixels, and read from it again (docs/formats.md).
#pragma once

#include <exception>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <type_traits>
#include <vector>

#include "octrad/base/json_file.h"
#include "octrad/image/image.h"
#include "octrad/model/config.h"
#include "octrad/render/film.h"
#include "octrad/render/integrator.h"
#include "octrad/render/renderer.h"
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
  // `name`: of the integrator, as users give it. Scene, view and settings must outlive this.
  PictureOrigin(const Scene& scene, const View& view, const RenderSettings& settings, const IntegratorInfo& integrator,
                const std::string& name);

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

// A value of what octrad wrote into a picture: `key` of the JSON object in the attribute `name`. `fallback` where there
// is none, or one of another type.
template <typename T>
T metadata_value(const Image& image, const std::string& name, const std::string& key, const T& fallback) {
  const auto found = image.metadata.find(name);
  if (found == image.metadata.end()) return fallback;
  const nlohmann::json object = parse_json_or_discard(found->second);
  if (!object.is_object() || !object.contains(key)) return fallback;
  try {
    if constexpr (std::is_integral_v<T>)
      return static_cast<T>(
          whole_number(object.at(key), std::numeric_limits<T>::min(), std::numeric_limits<T>::max(), key));
    else return object.at(key).template get<T>();
  } catch (const std::exception&) {
    return fallback;
  }
}

// The hash of the mask that a picture was rendered with (octrad render --mask); "" without one.
inline std::string mask_of(const Image& image) { return metadata_value(image, "octrad.render", "mask", std::string()); }

// The seeds of a picture, as far as its metadata say: one, or those of all that `merge` joined.
std::vector<long long> picture_seeds(const Image& image);
bool share_a_seed(const std::vector<long long>& a, const std::vector<long long>& b);
// In what two pictures differ that are not of one view, as far as their metadata says; else empty.
std::string view_difference(const Image& a, const Image& b);

}  // namespace octrad::report
