// Queries of a model at many points on a Stream, in chunks that fit into its memory.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "octrad/base/surface_point.h"
#include "octrad/device/stream.h"
#include "octrad/model/radiance_field.h"

namespace octrad {

struct FieldAnswers {
  std::vector<float> features;   // [n][feature_count]
  std::vector<float> disparity;  // [n], 1/world units
  std::vector<Vec3f> radiance;   // [n], linear RGB
};

// field.inspect() and field.radiance(), computed on the stream with tables of floats. `max_memory`: bytes of
// the stream (0: no limit); throws MemoryError where the field does not fit into it.
FieldAnswers ask_on_stream(Stream& stream, RadianceField& field, const Config& config,
                           std::span<const SurfacePoint> points, std::uint64_t max_memory);

}  // namespace octrad
