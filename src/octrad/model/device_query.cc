#include "octrad/model/device_query.h"

#include <algorithm>

#include "octrad/device/array.h"
#include "octrad/model/device_field.h"

namespace octrad {
namespace {

constexpr std::size_t kMostPoints = std::size_t{1} << 18, kFewestPoints = 256;  // in flight

}  // namespace

FieldAnswers ask_on_stream(Stream& stream, RadianceField& field, const Config& config,
                           std::span<const SurfacePoint> points, std::uint64_t max_memory) {
  const auto width = static_cast<std::size_t>(field.feature_count());
  FieldAnswers answers{std::vector<float>(points.size() * width), std::vector<float>(points.size()),
                       std::vector<Vec3f>(points.size())};
  if (points.empty()) return answers;

  DeviceFieldOptions options;
  options.half_features = false;
  const QueryRays rays = query_rays(config);
  const auto numbers = static_cast<std::size_t>(surface_point_numbers(rays));
  const auto memory = [&](std::size_t chunk) {
    options.max_points = chunk;
    std::vector<MemoryPart> parts = estimate_device_memory(config, field.cells_per_level(), options);
    parts.push_back({"points and answers", chunk * ((numbers + width + 1) * sizeof(float) + sizeof(Vec3f))});
    return parts;
  };
  std::size_t chunk = std::clamp(points.size(), kFewestPoints, kMostPoints);
  while (max_memory > 0 && chunk > kFewestPoints && total_bytes(memory(chunk)) > max_memory)
    chunk = std::max(kFewestPoints, chunk / 2);
  require_memory(max_memory, "the model", memory(chunk), "  --device cpu asks it on the CPU");
  options.max_points = chunk;

  const std::unique_ptr<DeviceField> device = make_device_field(stream, field, config, options);
  std::vector<float> planes(numbers * chunk), columns(width * chunk);
  const SurfacePointArray host = surface_point_array(planes.data(), chunk, rays);
  DeviceArray<float> asked(stream, planes.size(), "points"), features(stream, columns.size(), "features"),
      disparity(stream, chunk, "disparities");
  const DeviceArray<Vec3f> radiance(stream, chunk, "answers");
  const SurfacePointArray there = surface_point_array(asked.data(), chunk, rays);
  for (std::size_t begin = 0; begin < points.size(); begin += chunk) {
    const std::size_t n = std::min(chunk, points.size() - begin);
    for (std::size_t i = 0; i < n; ++i) host.store_all(i, points[begin + i]);
    asked.upload(planes);
    device->inspect(there, n, {features.data(), chunk}, disparity.data());
    device->radiance(there, nullptr, n, radiance.data());
    features.download(columns);
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t f = 0; f < width; ++f) answers.features[(begin + i) * width + f] = columns[f * chunk + i];
    }
    disparity.download(std::span(answers.disparity).subspan(begin, n));
    radiance.download(std::span(answers.radiance).subspan(begin, n));
  }
  return answers;
}

}  // namespace octrad
