#include "octrad/model/radiance_field.h"

#include <algorithm>
#include <cstring>

#include "octrad/base/threads.h"
#include "octrad/network/approach_math.h"

namespace octrad {
namespace {

constexpr std::size_t kPage = 1024;  // floats

// Equal pages are not written, so that those of a table that nothing has touched take no memory.
void approach(std::span<float> values, std::span<const float> to, float share) {
  for (std::size_t begin = 0; begin < values.size(); begin += kPage) {
    const std::size_t n = std::min(kPage, values.size() - begin);
    float* value = values.data() + begin;
    const float* target = to.data() + begin;
    if (std::memcmp(value, target, n * sizeof(float)) == 0) continue;
    for (std::size_t i = 0; i < n; ++i) value[i] = approached(value[i], target[i], share);
  }
}

}  // namespace

void approach(RadianceField& field, RadianceField& to, float share) {
  const std::vector<WeightArray> arrays = field.weights(), targets = to.weights();
  for (std::size_t a = 0; a < arrays.size(); ++a) {
    const std::span<float> values = arrays[a].values, target = targets[a].values;
    parallel_blocks(values.size(), 64 * kPage, [&](std::size_t begin, std::size_t end) {
      approach(values.subspan(begin, end - begin), target.subspan(begin, end - begin), share);
    });
  }
  field.weights_changed();
}

}  // namespace octrad
