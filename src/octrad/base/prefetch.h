// Starts loading a line of memory into the caches.
#pragma once

namespace octrad {

// `address` need not be valid. The empty assembly keeps the compiler from dropping calls of functions that do nothing
// but prefetch: GCC 12 takes them for functions without effect where it sees their bodies.
inline void prefetch_line(const void* address) {
  __builtin_prefetch(address);
  asm volatile("" : : "r"(address));
}

}  // namespace octrad
