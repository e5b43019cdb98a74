#include "octrad/encoding/planes.h"

#include "octrad/base/error.h"

namespace octrad {

Planes::Planes(int resolution, int features) : resolution_(resolution), features_(features) {
  if (resolution < 2 || resolution > 4096) throw InputError("planes: resolutions from 2 to 4096 are supported");
  if (features < 1 || features > 64) throw InputError("planes: 1 to 64 features are supported");
  table_.assign(static_cast<std::size_t>(entry_count() * features), 0.0f);
}

void Planes::lookup(const Vec3f* p, int n, float* out, int stride, Tap* taps) const {
  for (int i = 0; i < n; ++i) {
    std::uint32_t entry[kPlaneTaps];
    float weight[kPlaneTaps];
    plane_taps(resolution_, p[i], entry, weight);
    for (int f = 0; f < features_; ++f) {
      float sum = 0.0f;
      for (int k = 0; k < kPlaneTaps; ++k) {
        sum += weight[k] * table_[static_cast<std::size_t>(entry[k]) * static_cast<std::size_t>(features_) +
                                  static_cast<std::size_t>(f)];
      }
      out[static_cast<std::ptrdiff_t>(f) * stride + i] = sum;
    }
    for (int k = 0; taps != nullptr && k < kPlaneTaps; ++k) taps[i * kPlaneTaps + k] = {entry[k], weight[k]};
  }
}

}  // namespace octrad
