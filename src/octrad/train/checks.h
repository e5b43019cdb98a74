// Training on a device beside training on the CPU.
#pragma once

#include "octrad/train/trainer.h"

namespace octrad {

// Points uniform by area, seen from uniform directions of the hemisphere, with what the configuration's field wants
// traced from them.
std::vector<SurfacePoint> surface_probes(const PreparedScene& scene, std::size_t n, std::uint64_t seed,
                                         const Config& config);

// Mean relative difference of the luminance of two fields, with an absolute part of 0.01.
double mean_difference(const RadianceField& a, const RadianceField& b, std::span<const SurfacePoint> points);

// The same steps on both. Sums in another order, tables read as halves and small products of halves lead the two apart
// as they learn.
struct TrainingPair {
  TrainResult on_stream, on_cpu;
  double loss_difference;  // relative
  double difference;       // mean_difference() at the probes
};
TrainingPair train_on_both(Stream& stream, const PreparedScene& scene, const Config& config,
                           std::span<const SurfacePoint> probes);

}  // namespace octrad
