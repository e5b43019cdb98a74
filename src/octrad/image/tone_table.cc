#include "octrad/image/tone_table.h"

#include "octrad/base/half.h"
#include "octrad/base/threads.h"

namespace octrad {
namespace {
constexpr std::size_t kHalves = 1 << 16;
}

ToneTable::ToneTable(const ToneMapping& mapping, Vec3f white) : table_(3 * kHalves) {
  parallel_blocks(table_.size(), 1 << 12, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const float gain = white[static_cast<int>(i / kHalves)];
      const float value = to_float(Half{static_cast<std::uint16_t>(i % kHalves)});
      table_[i] = to_byte(tonemap(value * gain, mapping));
    }
  });
}

Image8 ToneTable::operator()(const Image& image, int first) const {
  Image8 out(image.width, image.height, 3);
  const std::size_t channels = image.channels.size();
  parallel_blocks(image.pixel_count(), 1 << 14, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      for (std::size_t c = 0; c < 3; ++c) {
        const float value = image.data[i * channels + static_cast<std::size_t>(first) + c];
        out.data[3 * i + c] = table_[c * kHalves + to_half(value).bits];
      }
    }
  });
  return out;
}

}  // namespace octrad
