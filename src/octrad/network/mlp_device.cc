#include "octrad/network/mlp_device.h"

#include <algorithm>
#include <stdexcept>

#include "octrad/base/error.h"
#include "octrad/device/launch.h"
#include "octrad/network/mlp_program.h"

namespace octrad {
namespace {

constexpr std::uint32_t kMostSplits = 64;  // of a weight gradient's rows
constexpr int kGroupRows = 32;             // memory is allocated for multiples of this

std::size_t whole(std::size_t n, std::size_t unit) { return (n + unit - 1) / unit * unit; }

// Weights in the layout of the kernels.
struct Pack : Kernel {
  MlpPlan plan;
  const float* weights;
  std::uint32_t* out;
  int inputs, width, outputs;  // of the network
  MlpInputMap map;
  bool reverse;

  // As the layer's inputs come.
  OCTRAD_HD float weight(int layer, int in, int out_) const {
    if (layer > 0 || !map.any()) return own_weight(layer, in, out_);
    if (map.maps(in)) return own_weight(0, in, out_) / map.scale[in - map.first];
    if (in != inputs) return own_weight(0, in, out_);
    float sum = 0.0f;
    for (int k = 0; k < 3; ++k) sum -= own_weight(0, map.first + k, out_) * map.offset[k] / map.scale[k];
    return sum;
  }
  OCTRAD_HD float own_weight(int layer, int in, int out_) const {
    const int have_in = layer == 0 ? inputs : width, have_out = layer == plan.hidden ? outputs : width;
    if (in >= have_in || out_ >= have_out) return 0.0f;
    const std::size_t before =
        layer == 0 ? 0 : static_cast<std::size_t>(width) * static_cast<std::size_t>(inputs + (layer - 1) * width);
    return weights[before + static_cast<std::size_t>(out_) * static_cast<std::size_t>(have_in) +
                   static_cast<std::size_t>(in)];
  }
  OCTRAD_HD void operator()(std::uint32_t i) const {
    const MlpBlock block = mlp_block(plan, static_cast<int>(i / kBlockWords));
    const int lane = static_cast<int>(i % kBlockWords) / 4, r = static_cast<int>(i % 4);
    const int k = block.k_tile * kTile + mlp_word_k(lane, r), n = block.n_tile * kTile + mlp_word_n(lane, r);
    if (reverse) {
      const int layer = plan.hidden - block.layer;
      out[i] = pack_halves(weight(layer, n, k), weight(layer, n, k + 1));
    } else {
      out[i] = pack_halves(weight(block.layer, k, n), weight(block.layer, k + 1, n));
    }
  }
};

struct WriteRows {
  FloatRows rows;
  float factor;
  OCTRAD_HD void operator()(std::size_t row, int col, float value) const {
    rows.data[static_cast<std::size_t>(col) * rows.stride + row] = value * factor;
  }
};
// Output of a pass; the factor is loaded once for all results of a group.
struct ScaledRows {
  FloatRows rows;
  const float* scale;  // null: 1
  OCTRAD_HD WriteRows ready() const { return {rows, scale != nullptr ? *scale : 1.0f}; }
};

// One pass of rows through the layers; kWide blocks wide.
template <int kWide, typename Input, typename Between>
struct Pass {
  static constexpr int kWidth = kWide;
  static constexpr int kTall = kWide > 8 ? 1 : 2;
  static constexpr bool kForward = !std::is_same_v<Between, MaskBetween>;
  MlpPlan plan;
  const std::uint32_t* weights;
  Input input;
  Between between;
  ScaledRows write;
  int outputs;
  std::uint32_t n;
  QueueSlice slice;

  // This pass over only the rows that the queue holds. Passes that keep activations or gradients run over whole
  // batches.
  OCTRAD_HD decltype(auto) limited() const {
    if constexpr (std::is_same_v<Between, ReluBetween<false>>) {
      Pass pass = *this;
      if (slice.count != nullptr) {
        const std::uint32_t have = *slice.count > slice.first ? *slice.count - slice.first : 0;
        pass.n = pass.input.n = have < n ? have : n;
      }
      return pass;
    } else {
      return static_cast<const Pass&>(*this);
    }
  }
  OCTRAD_HD std::uint32_t groups() const { return (n + kTall * kTile - 1) / (kTall * kTile); }
  template <typename Warp>
  OCTRAD_HD void operator()(Warp& warp, std::uint32_t group) const {
    run_mlp<kWidth, kTall>(warp, plan, input, between, write, outputs, n, group);
  }
};

#if defined(__CUDACC__)
// Threads of a block, and blocks of a multiprocessor: as many warps as the registers of the programs, which must not
// spill, allow.
template <typename P>
inline constexpr int kPassThreads = P::kWidth >= 8 && P::kForward ? 384 : 256;
template <typename P>
inline constexpr int kPassBlocks = P::kWidth >= 8 ? 1 : 2;

// Warp-uniform, and known to be so to the compiler.
__device__ inline std::uint32_t warp_of_block() { return __shfl_sync(0xffffffffu, threadIdx.x / kWarp, 0); }

template <typename P>
__global__ void __launch_bounds__(kPassThreads<P>, kPassBlocks<P>) mlp_pass(P launched, int window) {
  extern __shared__ uint4 shared[];
  const P& pass = launched.limited();
  CudaWarp warp(pass.weights, pass.plan.blocks(), reinterpret_cast<std::uint32_t*>(shared), window);
  const std::uint32_t groups = pass.groups(), warps = blockDim.x / kWarp;
  if (blockIdx.x >= groups) return;  // the queue is shorter than the launch
  const std::uint32_t warp_number = warp_of_block();
  const bool whole = window == pass.plan.blocks();
  if (whole) warp.need_weights(0, window);
  // Consecutive groups go to different multiprocessors, so that a few groups are spread evenly. Where the weights do
  // not fit into shared memory at once, all warps of a block take part in every round of loading; surplus ones repeat a
  // group.
  for (std::uint32_t first = blockIdx.x; first < groups; first += gridDim.x * warps) {
    const std::uint32_t group = first + warp_number * gridDim.x;
    if (group < groups || !whole) pass(warp, group < groups ? group : groups - 1);
  }
}

template <typename P>
void launch_on_device(Stream& stream, const DeviceInfo& device, const P& pass) {
  constexpr int kThreads = kPassThreads<P>;
  constexpr int kBlockBytes = kBlockWords * static_cast<int>(sizeof(std::uint32_t));
  const cudaStream_t handle = cuda_handle(stream);  // makes its device current
  const int shared = static_cast<int>(device.shared_bytes), window = std::min(pass.plan.blocks(), shared / kBlockBytes);
  const std::size_t bytes = static_cast<std::size_t>(window) * kBlockBytes;
  check_cuda(cudaFuncSetAttribute(mlp_pass<P>, cudaFuncAttributeMaxDynamicSharedMemorySize, shared),
             "asking for shared memory");
  int resident = 1;
  check_cuda(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&resident, mlp_pass<P>, kThreads, bytes),
             "asking how many blocks fit");
  const std::uint32_t blocks =
      std::min(pass.groups(), static_cast<std::uint32_t>(std::max(resident, 1) * device.multiprocessors));
  mlp_pass<P><<<blocks, kThreads, bytes, handle>>>(pass, window);
  check_launch(stream, "mlp_pass");
}
#endif

template <typename P>
void launch_pass(Stream& stream, [[maybe_unused]] const DeviceInfo& device, const P& pass) {
  if (pass.n == 0) return;
#if defined(__CUDACC__)
  if (stream.on_device()) {
    launch_on_device(stream, device, pass);
    return;
  }
#endif
  host_launch(
      stream, pass.groups(), KernelId<P>::id,
      [launched = pass](std::size_t begin, std::size_t end) {
        const P& part = launched.limited();
        HostWarp warp(part.weights);
        for (std::size_t g = begin; g < end && g < part.groups(); ++g) part(warp, static_cast<std::uint32_t>(g));
      },
      2);
}

template <typename Input, typename Between>
void run_pass(Stream& stream, const DeviceInfo& device, const MlpPlan& plan, const std::uint32_t* weights,
              const Input& input, const Between& between, const ScaledRows& write, int outputs, std::uint32_t n,
              QueueSlice slice) {
  switch (plan.width) {
    case 4:
      launch_pass(stream, device, Pass<4, Input, Between>{plan, weights, input, between, write, outputs, n, slice});
      return;
    case 8:
      launch_pass(stream, device, Pass<8, Input, Between>{plan, weights, input, between, write, outputs, n, slice});
      return;
    default:
      launch_pass(stream, device, Pass<16, Input, Between>{plan, weights, input, between, write, outputs, n, slice});
      return;
  }
}

// Gradient of the weights, split over the rows: part s goes to partial [s][parameters].
struct WeightGradient {
  MlpPlan plan;
  KeptBlocks activations, gradients;
  HalfInput input;
  ScaledInput d_out;
  int inputs, width, outputs;
  bool map;  // there is an input more; its gradients follow the parameters'
  std::uint32_t tiles, splits;
  std::size_t parameters, stride;
  float* partial;

  // Pieces of 2 x 4 blocks, layer by layer.
  OCTRAD_HD int pieces(int l) const { return ((plan.layer_out(l) + 1) / 2) * ((plan.layer_in(l) + 3) / 4); }
  OCTRAD_HD int all_pieces() const {
    int sum = 0;
    for (int l = 0; l < plan.layers(); ++l) sum += pieces(l);
    return sum;
  }
  template <typename Warp>
  OCTRAD_HD void operator()(Warp& warp, std::uint32_t item) const {
    const auto all = static_cast<std::uint32_t>(all_pieces());
    const std::uint32_t split = item / all;
    int piece = static_cast<int>(item % all), l = 0;
    std::size_t before = 0;
    while (piece >= pieces(l)) {
      piece -= pieces(l);
      before += static_cast<std::size_t>(l == 0 ? inputs : width) * static_cast<std::size_t>(width);
      ++l;
    }
    const int across = (plan.layer_in(l) + 3) / 4;
    const int have_in = l == 0 ? inputs : width, have_out = l == plan.hidden ? outputs : width;
    float* part = partial + split * stride;
    float* to = part + before;
    const auto run = [&](const auto& load_gradient, const auto& load_input) {
      run_weight_gradient(warp, plan.layer_out(l), plan.layer_in(l), piece / across * 2, piece % across * 4,
                          part_begin(split), part_begin(split + 1), load_gradient, load_input,
                          [&](int o, int i, float value) {
                            if (o < have_out && i < have_in) to[o * have_in + i] = value;
                            else if (map && l == 0 && i == inputs && o < width) part[parameters + o] = value;
                          });
    };
    using Word = typename Warp::Word;
    const auto kept_gradient = [&](std::uint32_t tile, int t, Word(&g)[4]) { warp.load(gradients.at(tile, l, t), g); };
    const auto kept_activation = [&](std::uint32_t tile, int t, Word(&x)[4]) {
      warp.load(activations.at(tile, l - 1, t), x);
    };
    const auto d_output = [&](std::uint32_t tile, int t, Word(&g)[4]) {
      load_operand(warp, d_out, static_cast<std::size_t>(tile) * kTile, t, g);
    };
    const auto first_input = [&](std::uint32_t tile, int t, Word(&x)[4]) {
      load_operand(warp, input, static_cast<std::size_t>(tile) * kTile, t, x);
    };
    // One loop for each kind of layer: without branches between them the latencies of loads overlap.
    if (l == 0) run(kept_gradient, first_input);
    else if (l < plan.hidden) run(kept_gradient, kept_activation);
    else run(d_output, kept_activation);
  }
  OCTRAD_HD std::uint32_t part_begin(std::uint32_t split) const {
    return static_cast<std::uint32_t>(static_cast<std::uint64_t>(tiles) * split / splits);
  }
};

#if defined(__CUDACC__)
constexpr int kGradientThreads = 256;
__global__ void __launch_bounds__(kGradientThreads, 2)
    mlp_weight_gradient(WeightGradient program, std::uint32_t items) {
  const std::uint32_t item = blockIdx.x * (kGradientThreads / kWarp) + warp_of_block();
  if (item >= items) return;
  CudaWarp warp;
  program(warp, item);
}
#endif

struct SumParts : Kernel {
  const float* partial;
  std::uint32_t splits;
  std::size_t parameters, stride;
  int inputs, width;
  MlpInputMap map;
  const float* scale;
  float* gradient;
  bool add;

  OCTRAD_HD float parts(std::size_t i) const {
    float sum = 0.0f;
    for (std::uint32_t s = 0; s < splits; ++s) sum += partial[s * stride + i];
    return sum;
  }
  OCTRAD_HD void operator()(std::uint32_t i) const {
    float sum = parts(i);
    if (map.any() && i < static_cast<std::uint32_t>(inputs * width)) {
      const int o = static_cast<int>(i) / inputs, in = static_cast<int>(i) - o * inputs;
      if (map.maps(in)) {  // d/dW = sum d x, x = (mapped - offset) / scale
        const int k = in - map.first;
        sum = (sum - map.offset[k] * parts(parameters + static_cast<std::size_t>(o))) / map.scale[k];
      }
    }
    sum *= *scale;
    gradient[i] = add ? gradient[i] + sum : sum;
  }
};

int tiles_of(int n) { return (n + kTile - 1) / kTile; }

MlpPlan plan_of(const MlpShape& s) {
  const int width = s.width <= 64 ? 4 : s.width <= 128 ? 8 : 16;
  return {tiles_of(s.inputs), width, s.hidden, tiles_of(s.outputs)};
}

std::uint32_t splits_of(std::size_t rows) {
  return static_cast<std::uint32_t>(std::clamp<std::size_t>(rows / kTile / 8, 1, kMostSplits));
}

// Words of memory for the hidden layers of that many rows.
std::size_t kept_words(const MlpPlan& plan, std::size_t rows) {
  return whole(rows, kGroupRows) / kTile * static_cast<std::size_t>(plan.hidden * plan.width) * kBlockWords;
}

}  // namespace

std::vector<MemoryPart> DeviceMlp::memory(const MlpShape& shape, std::size_t train_rows, const std::string& what) {
  const MlpPlan plan = plan_of(shape);
  const std::size_t parameters = shape.parameter_count();
  std::vector<MemoryPart> parts{
      {what + " weights",
       parameters * sizeof(float) + static_cast<std::size_t>(plan.blocks()) * kBlockWords * sizeof(std::uint32_t)}};
  if (train_rows > 0) {
    const MlpPlan reverse{plan.out, plan.width, plan.hidden, plan.in};
    parts[0].bytes += static_cast<std::size_t>(reverse.blocks()) * kBlockWords * sizeof(std::uint32_t);
    parts.push_back(
        {what + " gradients",
         sizeof(float) * (parameters + (parameters + static_cast<std::size_t>(shape.width)) * splits_of(train_rows))});
    parts.push_back({what + " activations", 2 * kept_words(plan, train_rows) * sizeof(std::uint32_t)});
  }
  return parts;
}

DeviceMlp::DeviceMlp(Stream& stream, const MlpShape& shape, std::size_t train_rows, const std::string& what,
                     const MlpInputMap& map)
    : device_(stream.info()),
      shape_(shape),
      map_(map),
      plan_(plan_of(shape)),
      reverse_{plan_.out, plan_.width, plan_.hidden, plan_.in},
      what_(what),
      train_rows_(train_rows) {
  if (shape.hidden < 1 || shape.width > 256)
    throw InputError(what + ": a network on a device has 1 hidden layer or more and a width of up to 256");
  if (map.any() && (shape.inputs % 2 == 0 || map.first + 3 > shape.inputs))
    throw std::logic_error(what + ": no place for what its inputs are mapped with");
  weights_ = DeviceArray<float>(stream, shape.parameter_count(), what + " weights");
  weights_.fill(0);
  const auto words = [](const MlpPlan& plan) { return static_cast<std::size_t>(plan.blocks()) * kBlockWords; };
  packed_ = DeviceArray<std::uint32_t>(stream, words(plan_), what + " weights");
  packed_.fill(0);
  if (train_rows == 0) return;
  splits_ = splits_of(train_rows);
  packed_reverse_ = DeviceArray<std::uint32_t>(stream, words(reverse_), what + " weights");
  packed_reverse_.fill(0);
  gradient_ = DeviceArray<float>(stream, weights_.size(), what + " gradients");
  gradient_.fill(0);
  partial_ = DeviceArray<float>(stream, partial_stride() * splits_, what + " gradients");
  activations_ = DeviceArray<std::uint32_t>(stream, kept_words(plan_, train_rows), what + " activations");
  gradients_ = DeviceArray<std::uint32_t>(stream, kept_words(plan_, train_rows), what + " activations");
}

void DeviceMlp::refresh(Stream& stream) {
  DeviceMlp* const one = this;
  refresh_all(stream, std::span(&one, 1));
}

void DeviceMlp::refresh_all(Stream& stream, std::span<DeviceMlp* const> networks) {
  std::vector<LaunchPart<Pack>> parts;
  for (const DeviceMlp* m : networks) {
    const MlpShape& s = m->shape_;
    const auto add = [&](const MlpPlan& plan, const DeviceArray<std::uint32_t>& packed, bool reverse) {
      parts.push_back({packed.size(),
                       {{}, plan, m->weights_.data(), packed.data(), s.inputs, s.width, s.outputs, m->map_, reverse}});
    };
    add(m->plan_, m->packed_, false);
    add(m->reverse_, m->packed_reverse_, true);  // none where there is no training
  }
  launch_parts(stream, parts.data(), parts.size());
}

void DeviceMlp::forward(Stream& stream, HalfRows in, FloatRows out, std::uint32_t n, QueueSlice slice) const {
  run_pass(stream, device_, plan_, packed_.data(), HalfInput{in, input_rows(), n}, ReluBetween<false>{},
           ScaledRows{out, nullptr}, shape_.outputs, n, slice);
}

void DeviceMlp::forward_keep(Stream& stream, HalfRows in, FloatRows out, std::uint32_t n) {
  if (n > train_rows_) throw DeviceError(what_ + ": more rows than there is memory for");
  const ReluBetween<true> between{{activations_.data(), plan_.hidden, plan_.width}};
  run_pass(stream, device_, plan_, packed_.data(), HalfInput{in, input_rows(), n}, between, ScaledRows{out, nullptr},
           shape_.outputs, n, {});
}

void DeviceMlp::backward(Stream& stream, HalfRows in, FloatRows d_out, const float* scale, FloatRows d_in, int d_inputs,
                         std::uint32_t n, bool add) {
  if (n > train_rows_) throw DeviceError(what_ + ": more rows than there is memory for");
  if (n == 0) {
    if (!add) gradient_.fill(0);
    return;
  }
  const KeptBlocks activations{activations_.data(), plan_.hidden, plan_.width},
      gradients{gradients_.data(), plan_.hidden, plan_.width};
  const ScaledInput d_linear{d_out, shape_.outputs, n, scale};
  // Only the blocks of the first d_inputs inputs are computed.
  MlpPlan reverse = reverse_;
  reverse.out = tiles_of(d_inputs);
  run_pass(stream, device_, reverse, packed_reverse_.data(), d_linear, MaskBetween{activations, gradients},
           ScaledRows{d_in, scale + 1}, d_inputs, n, {});

  const WeightGradient program{plan_,
                               activations,
                               gradients,
                               HalfInput{in, input_rows(), n},
                               d_linear,
                               shape_.inputs,
                               shape_.width,
                               shape_.outputs,
                               map_.any(),
                               (n + kTile - 1) / kTile,
                               splits_,
                               weights_.size(),
                               partial_stride(),
                               partial_.data()};
  const std::uint32_t items = static_cast<std::uint32_t>(program.all_pieces()) * splits_;
#if defined(__CUDACC__)
  if (stream.on_device()) {
    constexpr std::uint32_t kWarps = kGradientThreads / kWarp;
    mlp_weight_gradient<<<(items + kWarps - 1) / kWarps, kGradientThreads, 0, cuda_handle(stream)>>>(program, items);
    check_launch(stream, "mlp_weight_gradient");
  } else
#endif
  {
    host_launch(
        stream, items, KernelId<WeightGradient>::id,
        [program](std::size_t begin, std::size_t end) {
          HostWarp warp;
          for (std::size_t i = begin; i < end; ++i) program(warp, static_cast<std::uint32_t>(i));
        },
        4);
  }
  launch(stream, weights_.size(),
         SumParts{{},
                  partial_.data(),
                  splits_,
                  weights_.size(),
                  partial_stride(),
                  shape_.inputs,
                  shape_.width,
                  map_,
                  scale + 1,
                  gradient_.data(),
                  add});
}

}  // namespace octrad
