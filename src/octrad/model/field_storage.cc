#include "octrad/model/field_storage.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "octrad/base/error.h"
#include "octrad/base/half.h"
#include "octrad/base/rng.h"
#include "octrad/base/threads.h"

namespace octrad {
namespace {

constexpr std::int64_t kBlock = 1 << 16;

// Copies a tensor whose numbers are of type T in the file.
template <typename T, typename Convert>
void read_finite(const TensorReader& in, const TensorReader::Tensor& tensor, const std::string& name,
                 std::span<float> out, const Convert& convert) {
  std::atomic<bool> finite = true;
  out = out.first(static_cast<std::size_t>(tensor.count));
  in.read_blocks(tensor, kBlock, [&](const void* values, std::int64_t first, std::int64_t count) {
    const std::span block(static_cast<const T*>(values), static_cast<std::size_t>(count));
    float* to = out.data() + first;
    bool good = true;
    for (const T value : block) {
      *to = convert(value);
      good &= std::isfinite(*to++);
    }
    if (!good) finite = false;
  });
  if (!finite) throw InputError(in.file() + " is not a usable model file: tensor \"" + name + "\" is not finite");
}

void read_count(const TensorReader& in, const std::string& name, std::int64_t& count) {
  in.read(in.get(name, DType::i64, {1}), &count);
  if (count < 0) throw InputError(in.file() + " is not a usable model file: tensor \"" + name + "\" is negative");
}

}  // namespace

AdamOptions adam_options(const Config& config) { return {config.adam_beta1, config.adam_beta2, config.adam_epsilon}; }

void initialize_hash_grid(HashGrid& grid, unsigned long long seed, unsigned long long stream) {
  const std::span<float> table = grid.table();
  parallel_blocks(table.size(), 65536, [&](std::size_t begin, std::size_t end) {
    Rng rng(seed, RngPurpose::weights, (stream << 32) + begin);
    for (std::size_t i = begin; i < end; ++i) table[i] = (rng.uniform() * 2.0f - 1.0f) * 1e-4f;
  });
}

void read_floats(const TensorReader& in, const std::string& name, const std::vector<std::int64_t>& shape,
                 std::span<float> out) {
  if (in.get(name).type == DType::f16)
    read_finite<std::uint16_t>(in, in.get(name, DType::f16, shape), name, out,
                               [](std::uint16_t bits) { return to_float(Half{bits}); });
  else read_finite<float>(in, in.get(name, DType::f32, shape), name, out, [](float v) { return v; });
}

bool has_optimizer(const TensorReader& in) {
  const std::vector<std::string> names = in.names();
  return std::any_of(names.begin(), names.end(),
                     [](const std::string& name) { return name.starts_with("optimizer."); });
}

void save_mlp(TensorWriter& out, const std::string& prefix, Mlp& mlp) {
  for (int i = 0; i < mlp.layer_count(); ++i) {
    out.add(prefix + "." + std::to_string(i) + ".weight", DType::f32, {mlp.layer_outputs(i), mlp.layer_inputs(i)},
            mlp.layer(i).data());
  }
}

void load_mlp(const TensorReader& in, const std::string& prefix, Mlp& mlp) {
  for (int i = 0; i < mlp.layer_count(); ++i) {
    read_floats(in, prefix + "." + std::to_string(i) + ".weight", {mlp.layer_outputs(i), mlp.layer_inputs(i)},
                mlp.layer(i));
  }
  mlp.prepare();
}

void save_adam(TensorWriter& out, const std::string& prefix, DenseAdam& adam) {
  const auto n = static_cast<std::int64_t>(adam.m().size());
  out.add("optimizer." + prefix + ".m", DType::f32, {n}, adam.m().data());
  out.add("optimizer." + prefix + ".v", DType::f32, {n}, adam.v().data());
  out.add("optimizer." + prefix + ".count", DType::i64, {1}, &adam.count());
}

void load_adam(const TensorReader& in, const std::string& prefix, DenseAdam& adam) {
  const auto n = static_cast<std::int64_t>(adam.m().size());
  read_floats(in, "optimizer." + prefix + ".m", {n}, adam.m());
  read_floats(in, "optimizer." + prefix + ".v", {n}, adam.v());
  read_count(in, "optimizer." + prefix + ".count", adam.count());
}

void save_hash_grid(TensorWriter& out, const std::string& prefix, HashGrid& grid) {
  out.add(prefix + ".table", DType::f32, {grid.entry_count(), grid.options().features}, grid.table().data());
  out.add(prefix + ".offsets", DType::i64, {static_cast<std::int64_t>(grid.offsets().size())}, grid.offsets().data());
}

void load_hash_grid(const TensorReader& in, const std::string& prefix, HashGrid& grid) {
  std::vector<std::int64_t> offsets(grid.offsets().size());
  in.read(in.get(prefix + ".offsets", DType::i64, {static_cast<std::int64_t>(offsets.size())}), offsets.data());
  if (!std::equal(offsets.begin(), offsets.end(), grid.offsets().begin())) {
    throw InputError(in.file() + ": " + prefix + ".offsets does not fit the configuration stored beside it");
  }
  read_floats(in, prefix + ".table", {grid.entry_count(), grid.options().features}, grid.table());
}

void save_adam(TensorWriter& out, const std::string& prefix, SparseAdam& adam, std::int64_t entries, int features) {
  out.add("optimizer." + prefix + ".moments", DType::f32, {entries, 2, features}, adam.moments().data());
  out.add("optimizer." + prefix + ".counts", DType::u16, {entries}, adam.counts().data());
  out.add("optimizer." + prefix + ".count", DType::i64, {1}, &adam.global_count());
}

void load_adam(const TensorReader& in, const std::string& prefix, SparseAdam& adam, std::int64_t entries,
               int features) {
  read_floats(in, "optimizer." + prefix + ".moments", {entries, 2, features}, adam.moments());
  in.read(in.get("optimizer." + prefix + ".counts", DType::u16, {entries}), adam.counts().data());
  read_count(in, "optimizer." + prefix + ".count", adam.global_count());
}

void add_grid_taps(const HashGrid& grid, const std::vector<Tap>& taps, std::span<const float> d_inputs, int stride,
                   std::size_t points, std::size_t first, std::vector<float>& upstream, std::vector<SparseTap>& out) {
  const auto levels = static_cast<std::size_t>(grid.options().levels),
             width = static_cast<std::size_t>(grid.options().features);
  for (std::size_t i = 0; i < points; ++i) {
    for (std::size_t l = 0; l < levels; ++l) {
      const std::size_t source = (first + i) * levels + l;
      for (std::size_t c = 0; c < width; ++c)
        upstream[source * width + c] = d_inputs[(l * width + c) * static_cast<std::size_t>(stride) + i];
      const Tap* tap = taps.data() + (i * levels + l) * 8;
      for (int k = 0; k < 8; ++k) out.push_back({tap[k].entry, static_cast<std::uint32_t>(source), tap[k].weight});
    }
  }
}

void add_table_memory(std::vector<MemoryPart>& parts, const std::string& what, double entries, int features,
                      const Config& config, bool training) {
  const auto add = [&](std::string_view of, double bytes) {
    parts.push_back({what + std::string(of), static_cast<std::uint64_t>(bytes)});
  };
  add(kFeaturesPart, entries * features * 4.0);
  if (training) add(kOptimizerPart, entries * static_cast<double>(SparseAdam::bytes(1, features)));  // dense: the same
  if (training && config.train_average > 0.0) add(kAveragesPart, entries * features * 4.0);
}

void add_batch_memory(std::vector<MemoryPart>& parts, const Config& config, double taps) {
  parts.push_back({"batch", static_cast<std::uint64_t>(config.train_points * (600.0 + taps * 36.0))});
}

}  // namespace octrad
