#include "octrad/model/nr_field.h"

#include <algorithm>

#include "octrad/base/threads.h"
#include "octrad/model/weight_stream.h"

namespace octrad {
namespace {

constexpr std::string_view kNrKeys[] = {"nr."};

std::vector<MemoryPart> nr_memory(const Config& config, const std::vector<long long>&, bool training) {
  std::vector<MemoryPart> parts;
  add_table_memory(parts, "hash grid", static_cast<double>(hash_grid_entries(nr_grid_options(config))),
                   config.nr_features, config, training);
  if (training) add_batch_memory(parts, config, config.nr_levels * 8.0);
  return parts;
}

}  // namespace

constinit const FieldEntry kNrField = {
    .name = "nr",
    .title = "Neural Radiosity (a hash grid)",
    .own_keys = kNrKeys,
    .cell_levels = [](const Config&) { return 0; },
    .finest_cells =
        [](const Config& config) { return hash_grid_resolution(nr_grid_options(config), config.nr_levels - 1); },
    .make = [](const Config& config, const FieldDomain& domain) -> std::unique_ptr<RadianceField> {
      return std::make_unique<NrField>(config, domain);
    },
    .memory = nr_memory,
    .make_device = make_device_nr,
    .device_memory = device_nr_memory,
    .smaller = [](const Config&) { return std::vector<std::pair<std::string, std::string>>{}; },
};

HashGridOptions nr_grid_options(const Config& config) {
  return {config.nr_levels, config.nr_features, config.nr_log2_table, config.nr_base, config.nr_scale};
}

struct NrField::Encoded {
  int stride = 0;
  std::vector<Vec3f> p, w;
  std::vector<float> inputs, linear, d_linear, d_inputs;
  std::vector<Tap> taps;
  Mlp::Workspace kept;
};

NrField::NrField(const Config& config, const FieldDomain& domain)
    : config_(config),
      origin_(domain.origin),
      size_(domain.size),
      grid_(nr_grid_options(config)),
      decoder_(config, grid_.feature_count(), config.nr_width, config.nr_hidden, config.nr_output, domain.origin,
               domain.size, kNrDecoderWeights) {
  initialize_hash_grid(grid_, static_cast<unsigned long long>(config.seed), kNrGridWeights);
}

void NrField::encode(std::span<const SurfacePoint> points, Encoded& e, bool record) const {
  const int n = static_cast<int>(points.size());
  const int stride = e.stride = padded(n);
  e.p.resize(points.size());
  e.w.resize(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    e.p[i] = (points[i].x - origin_) / size_;
    e.w[i] = reflect(points[i].wo, points[i].n);
  }
  const int features = grid_.feature_count();
  e.inputs.resize(static_cast<std::size_t>(features + kPointInputs) * static_cast<std::size_t>(stride));
  if (record) {
    e.taps.clear();
    grid_.lookup_record(e.p.data(), n, e.inputs.data(), stride, e.taps);
  } else {
    grid_.lookup(e.p.data(), n, e.inputs.data(), stride);
  }
  decoder_.fill_inputs(points, e.w.data(), e.inputs.data(), features, stride);
}

void NrField::radiance(std::span<const SurfacePoint> points, std::span<Vec3f> out) const {
  thread_local Encoded e;
  for (std::size_t begin = 0; begin < points.size(); begin += kQueryChunk) {
    const auto chunk = points.subspan(begin, std::min<std::size_t>(kQueryChunk, points.size() - begin));
    encode(chunk, e, false);
    e.linear.resize(3 * static_cast<std::size_t>(e.stride));
    decoder_.mlp().forward(e.inputs.data(), static_cast<int>(chunk.size()), e.stride, e.linear.data());
    decoder_.activate(chunk, e.linear.data(), e.stride, out.data() + begin);
  }
}

void NrField::inspect(std::span<const SurfacePoint> points, std::span<float> features,
                      std::span<float> disparity) const {
  Encoded e;
  const auto count = static_cast<std::size_t>(feature_count());
  for (std::size_t begin = 0; begin < points.size() && !features.empty(); begin += kQueryChunk) {
    const auto chunk = points.subspan(begin, std::min<std::size_t>(kQueryChunk, points.size() - begin));
    encode(chunk, e, false);
    copy_features(e.inputs, e.stride, chunk.size(), count, features.data() + begin * count);
  }
  std::fill(disparity.begin(), disparity.end(), 0.0f);
}

void NrField::make_optimizer() {
  if (!grid_adam_) grid_adam_ = make_table_adam(grid_.entry_count(), grid_.options().features, config_);
}

FieldStep NrField::train(std::span<const SurfacePoint> points, std::span<const Vec3f> targets, double epsilon,
                         RateScale scale) {
  make_optimizer();
  struct Gradients {
    std::vector<float> decoder;
    std::vector<SparseTap> grid;
    double loss = 0.0;
    long long non_finite = 0;
  };
  const std::size_t n = points.size();
  upstream_.resize(n * static_cast<std::size_t>(feature_count()));
  const GroupedBatch groups(n);
  std::vector<Gradients> gradients(groups.count());
  parallel_for(groups.count(), [&](std::size_t g) {
    thread_local Encoded e;
    Gradients& mine = gradients[g];
    mine.decoder.assign(decoder_.mlp().parameter_count(), 0.0f);
    for (std::size_t begin = groups.begin(g); begin < groups.end(g); begin += kQueryChunk) {
      const std::size_t count = std::min<std::size_t>(kQueryChunk, groups.end(g) - begin);
      const auto chunk = points.subspan(begin, count);
      encode(chunk, e, true);
      e.linear.resize(3 * static_cast<std::size_t>(e.stride));
      e.d_linear.resize(e.linear.size());
      e.d_inputs.resize(e.inputs.size());
      decoder_.mlp().forward(e.inputs.data(), static_cast<int>(count), e.stride, e.linear.data(), e.kept);
      mine.loss += decoder_.loss(chunk, targets.subspan(begin, count), e.linear.data(), e.stride, n, epsilon,
                                 e.d_linear.data(), mine.non_finite);
      decoder_.mlp().backward(e.inputs.data(), e.d_linear.data(), e.kept, mine.decoder, e.d_inputs.data());
      add_grid_taps(grid_, e.taps, e.d_inputs, e.stride, count, begin, upstream_, mine.grid);
    }
  });
  FieldStep step;
  std::vector<std::span<const float>> decoder;
  std::vector<std::span<const SparseTap>> grid;
  for (const Gradients& g : gradients) {
    decoder.push_back(g.decoder);
    grid.push_back(g.grid);
    step.loss += g.loss / (3.0 * static_cast<double>(n));
    step.non_finite += g.non_finite;
  }
  step.non_finite += step_mlp(decoder_.mlp(), decoder_.adam(), decoder, config_.adam_rate_networks * scale.networks);
  const auto sparse = grid_adam_->step(grid_.table(), grid, upstream_, config_.adam_rate_grids * scale.tables);
  step.touched = sparse.touched;
  step.non_finite += sparse.non_finite;
  return step;
}

std::vector<WeightArray> NrField::weights() {
  return {{"nr.grid.table", grid_.table()}, {"nr.mlp", decoder_.mlp().weights()}};
}

void NrField::weights_changed() { decoder_.mlp().prepare(); }

void NrField::save(TensorWriter& out) {
  out.add("octree.origin", DType::f32, {3}, &origin_);
  out.add("octree.size", DType::f32, {3}, &size_);
  save_hash_grid(out, "nr.grid", grid_);
  save_mlp(out, "nr.mlp", decoder_.mlp());
}

void NrField::save_optimizer(TensorWriter& out) {
  make_optimizer();
  save_adam(out, "nr.mlp", decoder_.adam());
  save_adam(out, "nr.grid", *grid_adam_, grid_.entry_count(), grid_.options().features);
}

void NrField::load(const TensorReader& in) {
  load_hash_grid(in, "nr.grid", grid_);
  load_mlp(in, "nr.mlp", decoder_.mlp());
}

void NrField::load_optimizer(const TensorReader& in) {
  make_optimizer();
  load_adam(in, "nr.mlp", decoder_.adam());
  load_adam(in, "nr.grid", *grid_adam_, grid_.entry_count(), grid_.options().features);
}

}  // namespace octrad
