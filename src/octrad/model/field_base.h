// What fields on the CPU are made of: a decoder, more networks and tables of features, each with its optimiser. The
// training step, the arrays of weights, the tensors of model files (docs/formats.md) and copies on devices follow from
// the lists of them.
#pragma once

#include <algorithm>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "octrad/encoding/hash_grid.h"
#include "octrad/model/config.h"
#include "octrad/model/decoder_head.h"
#include "octrad/model/radiance_field.h"
#include "octrad/model/safetensors.h"
#include "octrad/network/adam.h"
#include "octrad/network/mlp.h"

namespace octrad {

constexpr int kQueryChunk = 128;  // queries that go through a field together: activations stay in the L2 cache

// Calls body(chunk, first) for chunks of at most kQueryChunk consecutive points; `first`: the number of its first one.
template <typename Body>
void for_chunks(std::span<const SurfacePoint> points, const Body& body) {
  for (std::size_t first = 0; first < points.size(); first += kQueryChunk)
    body(points.subspan(first, std::min<std::size_t>(kQueryChunk, points.size() - first)), first);
}

struct FieldNetwork {
  std::string name;  // of its tensors and of its optimiser's
  Mlp* mlp;
  DenseAdam adam;
};

struct FieldTable {
  std::string name;          // of its tensors and of its optimiser's
  std::string weights_name;  // of its WeightArray
  std::span<float> values;   // [entries][features]
  int features = 0;
  double rate = 0.0;        // adam.rate.*
  std::size_t sources = 1;  // look-ups of a point, each with a gradient of `features` numbers
  std::function<void(TensorWriter&)> save;
  std::function<void(const TensorReader&)> load;
  std::vector<float> upstream;       // gradients of a step: [point][source][features], or as differentiate() has it
  std::unique_ptr<SparseAdam> adam;  // null until make_optimizers(): it is larger than the table
  std::int64_t entries() const { return static_cast<std::int64_t>(values.size()) / features; }
};

class FieldBase : public RadianceField {
 public:
  FieldBase(const FieldBase&) = delete;  // networks() and tables() refer to members
  FieldBase& operator=(const FieldBase&) = delete;

  FieldStep train(std::span<const SurfacePoint> points, std::span<const Vec3f> targets, double epsilon,
                  RateScale scale) override;
  void set_target_scale(float scale) override { decoder_.set_target_scale(scale); }
  float target_scale() const override { return decoder_.target_scale(); }
  Vec3f normalized(Vec3f x) const override { return (x - origin_) / size_; }
  std::vector<WeightArray> weights() override;
  void weights_changed() override;
  void save(TensorWriter& out) override;
  void save_optimizer(TensorWriter& out) override;
  void load(const TensorReader& in) override;
  void load_optimizer(const TensorReader& in) override;

  // For the counterpart on a device.
  Vec3f origin() const { return origin_; }
  Vec3f size() const { return size_; }
  DecoderHead& decoder() { return decoder_; }
  std::span<FieldNetwork> networks() { return networks_; }  // the decoder first
  std::span<FieldTable> tables() { return tables_; }
  void make_optimizers();

 protected:
  // Gradients of a group of a batch's points.
  struct Gradients {
    std::vector<std::vector<float>> networks;    // in the order of networks()
    std::vector<std::vector<SparseTap>> tables;  // in the order of tables()
    double loss = 0.0;                           // sum over points and channels
    long long non_finite = 0;
  };
  struct BatchPart {
    std::size_t first, batch;  // number of its first point, and how many the batch has
    double epsilon;
  };
  // Values of a chunk on their way through the decoder, [row][stride].
  struct DecoderRows {
    int stride = 0;
    std::vector<float> inputs;  // the encoding's features, then the point's own inputs
    std::vector<float> linear, d_linear, d_inputs;
    Mlp::Workspace kept;
  };
  static constexpr std::size_t kDecoder = 0;  // among the networks

  FieldBase(const Config& config, const FieldDomain& domain, const std::string& decoder_name, const MlpShape& shape,
            Activation activation, unsigned long long stream);
  // In constructors. A table that is returned stays there until the next one is added.
  void add_network(const std::string& name, Mlp& mlp);
  // One tensor, "name.table".
  FieldTable& add_table(const std::string& name, std::span<float> values, int features, double rate,
                        std::size_t sources);
  FieldTable& add_grid(const std::string& name, HashGrid& grid, std::size_t sources);

  // Adds loss and gradients of at most kQueryChunk points, and sets their sources of the tables' upstream gradients.
  // Thread-safe for parts that do not overlap.
  virtual void differentiate(std::span<const SurfacePoint> points, std::span<const Vec3f> targets,
                             const BatchPart& part, Gradients& gradients) = 0;

  // out[first + i][f]: feature f of the chunk's point i, from rows.inputs. For inspect().
  void copy_features(const DecoderRows& rows, std::size_t first, std::size_t points, std::span<float> out) const;
  // Radiance of a chunk from rows.inputs.
  void decode(std::span<const SurfacePoint> points, DecoderRows& rows, Vec3f* radiance) const;
  // The decoder's forward pass, loss and backward pass.
  void differentiate_decoder(std::span<const SurfacePoint> points, std::span<const Vec3f> targets,
                             const BatchPart& part, DecoderRows& rows, Gradients& gradients) const;
  // Adds the loss of rows.linear, and sets its gradient rows.d_linear.
  void decoder_loss(std::span<const SurfacePoint> points, std::span<const Vec3f> targets, const BatchPart& part,
                    DecoderRows& rows, Gradients& gradients) const;
  // From rows.d_linear: adds the network's gradient, and sets rows.d_inputs.
  void decoder_backward(DecoderRows& rows, Gradients& gradients) const;
  std::vector<float>& upstream(std::size_t table) { return tables_[table].upstream; }

  const Config config_;
  const Vec3f origin_, size_;
  DecoderHead decoder_;

 private:
  std::vector<FieldNetwork> networks_;
  std::vector<FieldTable> tables_;
};

}  // namespace octrad
