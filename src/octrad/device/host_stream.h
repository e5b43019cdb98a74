// What launch.h needs of the host stream.
#pragma once

#include <cstddef>
#include <functional>

#include "octrad/device/stream.h"

namespace octrad {

// Runs body over blocks of [0, n) now, or records it while the stream captures. `stream` must be a host stream.
// `kernel`: KernelId<F>::id, which tells kernels apart. `block`: items that a thread takes at a time.
void host_launch(Stream& stream, std::size_t n, const void* kernel,
                 const std::function<void(std::size_t begin, std::size_t end)>& body, std::size_t block = 256);

template <typename F>
struct KernelId {
  static constexpr char kByte = 0;
  static constexpr const void* id = &kByte;
};

}  // namespace octrad
