#include "octrad/device/sort.h"

#include <array>

#include "octrad/base/error.h"
#include "octrad/device/host_stream.h"
#if defined(OCTRAD_CUDA)
#include "octrad/device/sort_cub.h"
#endif

namespace octrad {
namespace {

constexpr int kDigitBits = 8;

// A stable radix sort from the lowest digit on (Knuth, TAOCP 5.2.5). `scratch` holds 2 n numbers.
void host_sort_pairs(std::uint32_t* scratch, std::size_t n, const std::uint32_t* keys_in, std::uint32_t* keys_out,
                     const std::uint32_t* values_in, std::uint32_t* values_out, int bits) {
  const std::uint32_t *keys = keys_in, *values = values_in;
  std::uint32_t *other_keys = scratch, *other_values = scratch + n;
  // The last pass has to write to the outputs.
  const int passes = (bits + kDigitBits - 1) / kDigitBits;
  for (int pass = 0; pass < passes; ++pass) {
    const bool to_output = (passes - pass) % 2 == 1;
    std::uint32_t* next_keys = to_output ? keys_out : other_keys;
    std::uint32_t* next_values = to_output ? values_out : other_values;
    const int shift = pass * kDigitBits;
    const std::uint32_t mask = (1u << (bits - shift < kDigitBits ? bits - shift : kDigitBits)) - 1u;
    std::array<std::size_t, (1u << kDigitBits) + 1> starts{};
    for (std::size_t i = 0; i < n; ++i) ++starts[((keys[i] >> shift) & mask) + 1];
    for (std::size_t d = 1; d < starts.size(); ++d) starts[d] += starts[d - 1];
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t to = starts[(keys[i] >> shift) & mask]++;
      next_keys[to] = keys[i];
      next_values[to] = values[i];
    }
    keys = next_keys;
    values = next_values;
  }
}

// Halves, so that the rounding error grows with the logarithm of n.
float host_sum(const float* in, std::size_t n) {
  if (n <= 64) {
    float total = 0.0f;
    for (std::size_t i = 0; i < n; ++i) total += in[i];
    return total;
  }
  return host_sum(in, n / 2) + host_sum(in + n / 2, n - n / 2);
}

void check(const SortWorkspace& workspace, std::size_t n) {
  if (n > workspace.capacity()) {
    throw DeviceError("a sort or scan of " + std::to_string(n) + " items in a workspace for " +
                      std::to_string(workspace.capacity()));
  }
}

std::size_t workspace_bytes(Stream& stream, std::size_t capacity) {
  if (capacity == 0) return 0;
#if defined(OCTRAD_CUDA)
  if (stream.on_device()) return cub_workspace_bytes(stream, capacity);
#else
  (void)stream;
#endif
  return 2 * capacity * sizeof(std::uint32_t);
}

}  // namespace

SortWorkspace::SortWorkspace(Stream& stream, std::size_t capacity, const std::string& what)
    : capacity_(capacity),
      memory_(stream, workspace_bytes(stream, capacity), what) {}

void sort_pairs(Stream& stream, const SortWorkspace& workspace, std::size_t n, const std::uint32_t* keys_in,
                std::uint32_t* keys_out, const std::uint32_t* values_in, std::uint32_t* values_out, int bits) {
  check(workspace, n);
  if (bits < 1 || bits > 32) throw DeviceError("a sort by " + std::to_string(bits) + " bits");
  if (n == 0) return;
#if defined(OCTRAD_CUDA)
  if (stream.on_device()) {
    cub_sort_pairs(stream, workspace.data(), workspace.bytes(), n, keys_in, keys_out, values_in, values_out, bits);
    return;
  }
#endif
  auto* scratch = reinterpret_cast<std::uint32_t*>(workspace.data());
  host_launch(stream, 1, KernelId<struct SortPairsOnHost>::id, [=](std::size_t, std::size_t) {
    host_sort_pairs(scratch, n, keys_in, keys_out, values_in, values_out, bits);
  });
}

void exclusive_sum(Stream& stream, const SortWorkspace& workspace, std::size_t n, const std::uint32_t* in,
                   std::uint32_t* out) {
  check(workspace, n);
  if (n == 0) return;
#if defined(OCTRAD_CUDA)
  if (stream.on_device()) {
    cub_exclusive_sum(stream, workspace.data(), workspace.bytes(), n, in, out);
    return;
  }
#endif
  host_launch(stream, 1, KernelId<struct ScanOnHost>::id, [=](std::size_t, std::size_t) {
    std::uint32_t total = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const std::uint32_t value = in[i];  // out may be in
      out[i] = total;
      total += value;
    }
  });
}

void sum(Stream& stream, const SortWorkspace& workspace, std::size_t n, const float* in, float* out) {
  check(workspace, n);
#if defined(OCTRAD_CUDA)
  if (stream.on_device() && n > 0) {
    cub_sum(stream, workspace.data(), workspace.bytes(), n, in, out);
    return;
  }
#endif
  if (n == 0) {
    stream.fill(out, 0, sizeof(float));
    return;
  }
  host_launch(stream, 1, KernelId<struct SumOnHost>::id, [=](std::size_t, std::size_t) { *out = host_sum(in, n); });
}

}  // namespace octrad
