#include "octrad/model/field_base.h"

#include "octrad/base/threads.h"
#include "octrad/model/field_storage.h"

namespace octrad {
namespace {

// Cuts a batch into at most 32 groups of at least 64 points. Depends on the batch alone, so that sums over groups in
// their order are the same at any thread count.
class GroupedBatch {
 public:
  explicit GroupedBatch(std::size_t n) : n_(n), count_(std::clamp<std::size_t>(n / 64, 1, 32)) {}
  std::size_t count() const { return count_; }
  std::size_t begin(std::size_t g) const { return n_ * g / count_; }
  std::size_t size(std::size_t g) const { return begin(g + 1) - begin(g); }

 private:
  std::size_t n_, count_;
};

// Sums the groups' gradients in order, takes one Adam step and repacks the kernels. Returns dropped gradients.
long long step_network(FieldNetwork& network, const std::vector<std::span<const float>>& gradients, double rate) {
  std::vector<float> sum(network.mlp->parameter_count());
  parallel_blocks(sum.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (const auto& g : gradients) {
      for (std::size_t i = begin; i < end; ++i) sum[i] += g[i];
    }
  });
  const long long dropped = network.adam.step(network.mlp->weights(), sum, rate);
  network.mlp->prepare();
  return dropped;
}

}  // namespace

FieldBase::FieldBase(const Config& config, const FieldDomain& domain, const std::string& decoder_name,
                     const MlpShape& shape, Activation activation, unsigned long long stream)
    : config_(config),
      origin_(domain.origin),
      size_(domain.size),
      decoder_(config, shape, activation, domain.origin, domain.size, stream) {
  add_network(decoder_name, decoder_.mlp());
}

void FieldBase::add_network(const std::string& name, Mlp& mlp) {
  networks_.push_back({name, &mlp, DenseAdam(mlp.parameter_count(), adam_options(config_))});
}

FieldTable& FieldBase::add_table(const std::string& name, std::span<float> values, int features, double rate,
                                 std::size_t sources) {
  FieldTable& table = tables_.emplace_back();
  table.name = name;
  table.weights_name = name + ".table";
  table.values = values;
  table.features = features;
  table.rate = rate;
  table.sources = sources;
  const std::vector<std::int64_t> shape{table.entries(), features};
  table.save = [tensor = table.weights_name, shape, values](TensorWriter& out) {
    out.add(tensor, DType::f32, shape, values.data());
  };
  table.load = [tensor = table.weights_name, shape, values](const TensorReader& in) {
    read_floats(in, tensor, shape, values);
  };
  return table;
}

FieldTable& FieldBase::add_grid(const std::string& name, HashGrid& grid, std::size_t sources) {
  FieldTable& table = add_table(name, grid.table(), grid.options().features, config_.adam_rate_grids, sources);
  table.save = [name, &grid](TensorWriter& out) { save_hash_grid(out, name, grid); };
  table.load = [name, &grid](const TensorReader& in) { load_hash_grid(in, name, grid); };
  return table;
}

void FieldBase::make_optimizers() {
  for (FieldTable& table : tables_) {
    if (table.adam) continue;
    table.adam = std::make_unique<SparseAdam>(table.entries(), table.features, adam_options(config_));
    table.adam->set_dense(config_.adam_mode == AdamMode::dense);
  }
}

void FieldBase::copy_features(const DecoderRows& rows, std::size_t first, std::size_t points,
                              std::span<float> out) const {
  const auto count = static_cast<std::size_t>(feature_count()), stride = static_cast<std::size_t>(rows.stride);
  for (std::size_t i = 0; i < points; ++i) {
    for (std::size_t f = 0; f < count; ++f) out[(first + i) * count + f] = rows.inputs[f * stride + i];
  }
}

void FieldBase::decode(std::span<const SurfacePoint> points, DecoderRows& rows, Vec3f* radiance) const {
  rows.linear.resize(3 * static_cast<std::size_t>(rows.stride));
  decoder_.mlp().forward(rows.inputs.data(), static_cast<int>(points.size()), rows.stride, rows.linear.data());
  decoder_.activate(points, rows.linear.data(), rows.stride, radiance);
}

void FieldBase::differentiate_decoder(std::span<const SurfacePoint> points, std::span<const Vec3f> targets,
                                      const BatchPart& part, DecoderRows& rows, Gradients& gradients) const {
  rows.linear.resize(3 * static_cast<std::size_t>(rows.stride));
  decoder_.mlp().forward(rows.inputs.data(), static_cast<int>(points.size()), rows.stride, rows.linear.data(),
                         rows.kept);
  decoder_loss(points, targets, part, rows, gradients);
  decoder_backward(rows, gradients);
}

void FieldBase::decoder_loss(std::span<const SurfacePoint> points, std::span<const Vec3f> targets,
                             const BatchPart& part, DecoderRows& rows, Gradients& gradients) const {
  rows.d_linear.resize(rows.linear.size());
  gradients.loss += decoder_.loss(points, targets, rows.linear.data(), rows.stride, part.batch, part.epsilon,
                                  rows.d_linear.data(), gradients.non_finite);
}

void FieldBase::decoder_backward(DecoderRows& rows, Gradients& gradients) const {
  rows.d_inputs.resize(rows.inputs.size());
  decoder_.mlp().backward(rows.inputs.data(), rows.d_linear.data(), rows.kept, gradients.networks[kDecoder],
                          rows.d_inputs.data());
}

FieldStep FieldBase::train(std::span<const SurfacePoint> points, std::span<const Vec3f> targets, double epsilon,
                           RateScale scale) {
  make_optimizers();
  const std::size_t n = points.size();
  for (FieldTable& table : tables_) table.upstream.resize(n * table.sources * static_cast<std::size_t>(table.features));
  const GroupedBatch groups(n);
  std::vector<Gradients> gradients(groups.count());
  parallel_for(groups.count(), [&](std::size_t g) {
    Gradients& mine = gradients[g];
    mine.networks.resize(networks_.size());
    mine.tables.resize(tables_.size());
    for (std::size_t i = 0; i < networks_.size(); ++i)
      mine.networks[i].assign(networks_[i].mlp->parameter_count(), 0.0f);
    for_chunks(points.subspan(groups.begin(g), groups.size(g)),
               [&](std::span<const SurfacePoint> chunk, std::size_t first) {
                 first += groups.begin(g);
                 differentiate(chunk, targets.subspan(first, chunk.size()), {first, n, epsilon}, mine);
               });
  });

  FieldStep step;
  for (const Gradients& g : gradients) {
    step.loss += g.loss / (3.0 * static_cast<double>(n));
    step.non_finite += g.non_finite;
  }
  for (std::size_t i = 0; i < networks_.size(); ++i) {
    std::vector<std::span<const float>> parts;
    for (const Gradients& g : gradients) parts.emplace_back(g.networks[i]);
    step.non_finite += step_network(networks_[i], parts, config_.adam_rate_networks * scale.networks);
  }
  for (std::size_t i = 0; i < tables_.size(); ++i) {
    FieldTable& table = tables_[i];
    std::vector<std::span<const SparseTap>> parts;
    for (const Gradients& g : gradients) parts.emplace_back(g.tables[i]);
    const SparseAdam::Result done = table.adam->step(table.values, parts, table.upstream, table.rate * scale.tables);
    step.touched += done.touched;
    step.non_finite += done.non_finite;
  }
  return step;
}

std::vector<WeightArray> FieldBase::weights() {
  std::vector<WeightArray> arrays;
  for (const FieldTable& table : tables_) arrays.push_back({table.weights_name, table.values});
  for (const FieldNetwork& network : networks_) arrays.push_back({network.name, network.mlp->weights()});
  return arrays;
}

void FieldBase::weights_changed() {
  for (FieldNetwork& network : networks_) network.mlp->prepare();
}

void FieldBase::save(TensorWriter& out) {
  out.add("octree.origin", DType::f32, {3}, &origin_);
  out.add("octree.size", DType::f32, {3}, &size_);
  for (FieldTable& table : tables_) table.save(out);
  for (FieldNetwork& network : networks_) save_mlp(out, network.name, *network.mlp);
}

void FieldBase::save_optimizer(TensorWriter& out) {
  make_optimizers();  // a run stopped before its first step can be resumed too
  for (FieldNetwork& network : networks_) save_adam(out, network.name, network.adam);
  for (FieldTable& table : tables_) save_adam(out, table.name, *table.adam, table.entries(), table.features);
}

void FieldBase::load(const TensorReader& in) {
  for (FieldTable& table : tables_) table.load(in);
  for (FieldNetwork& network : networks_) load_mlp(in, network.name, *network.mlp);
}

void FieldBase::load_optimizer(const TensorReader& in) {
  make_optimizers();
  for (FieldNetwork& network : networks_) load_adam(in, network.name, network.adam);
  for (FieldTable& table : tables_) load_adam(in, table.name, *table.adam, table.entries(), table.features);
}

}  // namespace octrad
