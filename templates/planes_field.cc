#include "octrad/model/planes_field.h"

#include <algorithm>

#include "octrad/base/rng.h"
#include "octrad/base/threads.h"

namespace octrad {
namespace {

constexpr int kFeatures = 8, kWidth = 64, kHidden = 3;

double entries(const Config& config) { return 3.0 * config.planes_resolution * config.planes_resolution; }

constexpr std::string_view kPlanesKeys[] = {"planes."};

}  // namespace

constinit const FieldEntry kPlanesField = {
    .name = "planes",
    .title = "three feature planes",
    .own_keys = kPlanesKeys,
    .cell_levels = [](const Config&) { return 0; },
    .make = [](const Config& config, const FieldDomain& domain) -> std::unique_ptr<RadianceField> {
      return std::make_unique<PlanesField>(config, domain);
    },
    .memory =
        [](const Config& config, const std::vector<long long>&, bool training) {
          std::vector<MemoryPart> parts;
          add_table_memory(parts, "planes", entries(config), kFeatures, config, training);
          if (training) add_batch_memory(parts, config, kPlaneTaps);
          return parts;
        },
    .make_device = nullptr,
    .device_memory = nullptr,
    .smaller = [](const Config&) { return std::vector<std::pair<std::string, std::string>>{}; },
};

// What is known of a chunk of points on its way through the field.
struct PlanesField::Encoded {
  int stride = 0;
  std::vector<Vec3f> p, w;
  std::vector<float> inputs, linear, d_linear, d_inputs;  // [row][stride]
  std::vector<Tap> taps;
  Mlp::Workspace kept;
};

PlanesField::PlanesField(const Config& config, const FieldDomain& domain)
    : config_(config),
      origin_(domain.origin),
      size_(domain.size),
      planes_(config.planes_resolution, kFeatures),
      decoder_(config, kFeatures, kWidth, kHidden, Activation::exp, domain.origin, domain.size,
               6) {  // model/weight_stream.h
  Rng rng(static_cast<unsigned long long>(config.seed), RngPurpose::weights, 7);
  for (float& v : planes_.table()) v = 1e-2f * (2.0f * rng.uniform() - 1.0f);
}

void PlanesField::encode(std::span<const SurfacePoint> points, Encoded& e) const {
  const int n = static_cast<int>(points.size());
  e.stride = padded(n);
  e.p.clear();
  e.w.clear();
  for (const SurfacePoint& point : points) {
    e.p.push_back(normalized(point.x));
    e.w.push_back(reflect(point.wo, point.n));
  }
  const auto stride = static_cast<std::size_t>(e.stride);
  e.inputs.assign((kFeatures + kPointInputs) * stride, 0.0f);
  e.linear.resize(3 * stride);
  e.taps.resize(points.size() * kPlaneTaps);
  planes_.lookup(e.p.data(), n, e.inputs.data(), e.stride, e.taps.data());
  decoder_.fill_inputs(points, e.w.data(), e.inputs.data(), kFeatures, e.stride);
}

void PlanesField::radiance(std::span<const SurfacePoint> points, std::span<Vec3f> out) const {
  thread_local Encoded e;
  for (std::size_t begin = 0; begin < points.size(); begin += kQueryChunk) {
    const auto chunk = points.subspan(begin, std::min<std::size_t>(kQueryChunk, points.size() - begin));
    encode(chunk, e);
    decoder_.mlp().forward(e.inputs.data(), static_cast<int>(chunk.size()), e.stride, e.linear.data());
    decoder_.activate(chunk, e.linear.data(), e.stride, out.data() + begin);
  }
}

void PlanesField::inspect(std::span<const SurfacePoint> points, std::span<float> features,
                          std::span<float> disparity) const {
  Encoded e;
  for (std::size_t i = 0; i < points.size() && !features.empty(); ++i) {
    encode(points.subspan(i, 1), e);
    for (std::size_t f = 0; f < kFeatures; ++f)
      features[i * kFeatures + f] = e.inputs[f * static_cast<std::size_t>(e.stride)];
  }
  std::fill(disparity.begin(), disparity.end(), 0.0f);
}

void PlanesField::make_optimizer() {
  if (!adam_) adam_ = make_table_adam(planes_.entry_count(), kFeatures, config_);
}

// Groups depend on the batch alone, and their gradients are added in order: the same bits at any thread count.
FieldStep PlanesField::train(std::span<const SurfacePoint> points, std::span<const Vec3f> targets, double epsilon,
                             RateScale scale) {
  make_optimizer();
  struct Gradients {
    std::vector<float> decoder;
    std::vector<SparseTap> planes;
    double loss = 0.0;
    long long non_finite = 0;
  };
  const std::size_t n = points.size();
  std::vector<float> upstream(n * kFeatures);
  const GroupedBatch groups(n);
  std::vector<Gradients> gradients(groups.count());
  parallel_for(groups.count(), [&](std::size_t g) {
    thread_local Encoded e;
    Gradients& mine = gradients[g];
    mine.decoder.assign(decoder_.mlp().parameter_count(), 0.0f);
    for (std::size_t begin = groups.begin(g); begin < groups.end(g); begin += kQueryChunk) {
      const std::size_t count = std::min<std::size_t>(kQueryChunk, groups.end(g) - begin);
      const auto chunk = points.subspan(begin, count);
      encode(chunk, e);
      e.d_linear.resize(e.linear.size());
      e.d_inputs.resize(e.inputs.size());
      decoder_.mlp().forward(e.inputs.data(), static_cast<int>(count), e.stride, e.linear.data(), e.kept);
      mine.loss += decoder_.loss(chunk, targets.subspan(begin, count), e.linear.data(), e.stride, n, epsilon,
                                 e.d_linear.data(), mine.non_finite);
      decoder_.mlp().backward(e.inputs.data(), e.d_linear.data(), e.kept, mine.decoder, e.d_inputs.data());
      for (std::size_t i = 0; i < count; ++i) {
        for (std::size_t f = 0; f < kFeatures; ++f)
          upstream[(begin + i) * kFeatures + f] = e.d_inputs[f * static_cast<std::size_t>(e.stride) + i];
        for (std::size_t k = 0; k < kPlaneTaps; ++k) {
          const Tap& tap = e.taps[i * kPlaneTaps + k];
          mine.planes.push_back({tap.entry, static_cast<std::uint32_t>(begin + i), tap.weight});
        }
      }
    }
  });
  FieldStep step;
  std::vector<std::span<const float>> decoder;
  std::vector<std::span<const SparseTap>> planes;
  for (const Gradients& g : gradients) {
    decoder.push_back(g.decoder);
    planes.push_back(g.planes);
    step.loss += g.loss / (3.0 * static_cast<double>(n));
    step.non_finite += g.non_finite;
  }
  step.non_finite += step_mlp(decoder_.mlp(), decoder_.adam(), decoder, config_.adam_rate_networks * scale.networks);
  const auto sparse = adam_->step(planes_.table(), planes, upstream, config_.adam_rate_grids * scale.tables);
  step.touched = sparse.touched;
  step.non_finite += sparse.non_finite;
  return step;
}

std::vector<WeightArray> PlanesField::weights() {
  return {{"planes.grid.table", planes_.table()}, {"planes.mlp", decoder_.mlp().weights()}};
}

void PlanesField::weights_changed() { decoder_.mlp().prepare(); }

void PlanesField::save(TensorWriter& out) {
  out.add("octree.origin", DType::f32, {3}, &origin_);
  out.add("octree.size", DType::f32, {3}, &size_);
  out.add("planes.grid.table", DType::f32, {planes_.entry_count(), kFeatures}, planes_.table().data());
  save_mlp(out, "planes.mlp", decoder_.mlp());
}

void PlanesField::save_optimizer(TensorWriter& out) {
  make_optimizer();
  save_adam(out, "planes.mlp", decoder_.adam());
  save_adam(out, "planes.grid", *adam_, planes_.entry_count(), kFeatures);
}

void PlanesField::load(const TensorReader& in) {
  read_floats(in, "planes.grid.table", {planes_.entry_count(), kFeatures}, planes_.table());
  load_mlp(in, "planes.mlp", decoder_.mlp());
}

void PlanesField::load_optimizer(const TensorReader& in) {
  make_optimizer();
  load_adam(in, "planes.mlp", decoder_.adam());
  load_adam(in, "planes.grid", *adam_, planes_.entry_count(), kFeatures);
}

}  // namespace octrad
