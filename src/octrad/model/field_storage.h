// The parts that fields are made of: how they begin, their tensors (docs/formats.md) and their memory.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "octrad/base/bytes.h"
#include "octrad/encoding/hash_grid.h"
#include "octrad/model/config.h"
#include "octrad/model/safetensors.h"
#include "octrad/network/adam.h"
#include "octrad/network/mlp.h"

namespace octrad {

AdamOptions adam_options(const Config& config);

// Uniform +-1e-4 (method section 5).
void initialize_hash_grid(HashGrid& grid, unsigned long long seed, unsigned long long stream);

// float32 tensor, or float16 widened, of exactly `shape` into the beginning of `out`. Numbers that are not finite are
// an InputError.
void read_floats(const TensorReader& in, const std::string& name, const std::vector<std::int64_t>& shape,
                 std::span<float> out);

// Whether the file holds what --resume needs.
bool has_optimizer(const TensorReader& in);

// "prefix.{i}.weight".
void save_mlp(TensorWriter& out, const std::string& prefix, Mlp& mlp);
void load_mlp(const TensorReader& in, const std::string& prefix, Mlp& mlp);
// "optimizer.prefix.m", ".v", ".count".
void save_adam(TensorWriter& out, const std::string& prefix, DenseAdam& adam);
void load_adam(const TensorReader& in, const std::string& prefix, DenseAdam& adam);
// "prefix.table", "prefix.offsets".
void save_hash_grid(TensorWriter& out, const std::string& prefix, HashGrid& grid);
void load_hash_grid(const TensorReader& in, const std::string& prefix, HashGrid& grid);
// "optimizer.prefix.moments", ".counts", ".count".
void save_adam(TensorWriter& out, const std::string& prefix, SparseAdam& adam, std::int64_t entries, int features);
void load_adam(const TensorReader& in, const std::string& prefix, SparseAdam& adam, std::int64_t entries, int features);

// The gradient that a look-up's features got, d_inputs [grid features ..][stride], as contributions to the grid. taps:
// of HashGrid::lookup_record() for `points` queries; `first`: the first one's place in the batch, for upstream
// [batch][level][feature].
void add_grid_taps(const HashGrid& grid, const std::vector<Tap>& taps, std::span<const float> d_inputs, int stride,
                   std::size_t points, std::size_t first, std::vector<float>& upstream, std::vector<SparseTap>& out);

// Memory of a table of features and, when training, of its optimiser's state and of its averages (train.average): parts
// whose names end with these.
inline constexpr std::string_view kFeaturesPart = " features", kOptimizerPart = " optimiser state",
                                  kAveragesPart = " averages";
void add_table_memory(std::vector<MemoryPart>& parts, const std::string& what, double entries, int features,
                      const Config& config, bool training);
// Memory of a batch: shaded points with their targets, `taps` contributions of each to the tables, and gradients.
void add_batch_memory(std::vector<MemoryPart>& parts, const Config& config, double taps);

}  // namespace octrad
