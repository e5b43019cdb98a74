#include "octrad/transport/direction_guide_device.h"

#include "octrad/device/launch.h"

namespace octrad {
namespace {

constexpr const char* kWhat = "guide of directions";

struct MakeTables : Kernel {
  GuideView guides;
  OCTRAD_HD void operator()(std::uint32_t table) const { make_guide_table(guides, static_cast<int>(table)); }
};

}  // namespace

DeviceGuide::DeviceGuide(Stream& stream, const GuideState& guide, float share)
    : stream_(&stream),
      box_(guide.box),
      unit_(guide.unit),
      rows_(stream, std::span<const float>(guide.rows), kWhat),
      columns_(stream, std::span<const float>(guide.columns), kWhat),
      means_(stream, std::span<const float>(guide.means), kWhat),
      squares_(stream, std::span<const unsigned long long>(guide.squares), kWhat),
      bsdf_squares_(stream, std::span<const unsigned long long>(guide.bsdf_squares), kWhat),
      targets_(stream, std::span<const unsigned long long>(guide.targets), kWhat),
      samples_(stream, std::span<const unsigned long long>(guide.samples), kWhat),
      view_{PlaceGrid(guide.box, kGuideSide),
            share,
            guide.unit,
            rows_.data(),
            columns_.data(),
            means_.data(),
            squares_.data(),
            bsdf_squares_.data(),
            targets_.data(),
            samples_.data()} {}

void DeviceGuide::make_tables() { launch(*stream_, kGuideTables, MakeTables{{}, view_}); }

GuideState DeviceGuide::download() const {
  return {box_,
          unit_,
          rows_.download(),
          columns_.download(),
          means_.download(),
          squares_.download(),
          bsdf_squares_.download(),
          targets_.download(),
          samples_.download()};
}

}  // namespace octrad
