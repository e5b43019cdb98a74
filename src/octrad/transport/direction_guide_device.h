// The tables of transport/direction_guide_math.h in memory of a Stream.
#pragma once

#include "octrad/device/array.h"
#include "octrad/transport/direction_guide.h"

namespace octrad {

class DeviceGuide {
 public:
  // `share`: train.guide. Takes kGuideBytes of the stream's memory.
  DeviceGuide(Stream& stream, const GuideState& guide, float share);

  // In device memory, valid as long as this.
  const GuideView& view() const { return view_; }
  // make_guide_table() for all tables.
  void make_tables();
  GuideState download() const;

 private:
  Stream* stream_;
  Bounds3f box_;
  float unit_;
  DeviceArray<float> rows_, columns_, means_;
  DeviceArray<unsigned long long> squares_, bsdf_squares_, targets_, samples_;
  GuideView view_;
};

}  // namespace octrad
