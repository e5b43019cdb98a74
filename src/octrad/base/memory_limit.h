// The memory budget (--max-memory) as those ask it who allocate what a file demands.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

namespace octrad {

// Bytes that the process may have in all from now on; 0: no limit. Call once, from main.
void set_memory_limit(std::uint64_t bytes);
std::uint64_t memory_limit();

// Asks before memory is allocated whose size comes from a file. Throws MemoryError when what is resident, what other
// open scopes were promised, and `bytes` together exceed the limit; the message begins with `what`. Costs a look at
// /proc: ask for much at once, not for every small thing.
void ask_memory(std::uint64_t bytes, std::string_view what);

// What is asked for while this exists, in the same thread, counts from the asking on. Memory is resident only after it
// was touched: without a scope, two threads could both be promised what is there once.
class MemoryScope {
 public:
  MemoryScope();
  ~MemoryScope();
  MemoryScope(const MemoryScope&) = delete;
  MemoryScope& operator=(const MemoryScope&) = delete;

 private:
  friend void ask_memory(std::uint64_t, std::string_view);
  std::uint64_t promised_ = 0;
  MemoryScope* outer_;
};

// Before push_back: asks for what a vector will take when it grows, once that is much.
template <typename Vector>
void ask_to_grow(const Vector& v, std::string_view what) {
  constexpr std::uint64_t kMuch = 1 << 20;
  const std::uint64_t bytes = 2 * v.capacity() * sizeof(typename Vector::value_type);
  if (v.size() == v.capacity() && bytes >= kMuch) ask_memory(bytes, what);
}

// For many small things: adds up, and asks each time a few megabytes have come together.
class MemoryMeter {
 public:
  explicit MemoryMeter(std::string what) : what_(std::move(what)) {}
  void add(std::uint64_t bytes) {
    sum_ += bytes;
    if (sum_ < kStep) return;
    ask_memory(sum_, what_);
    sum_ = 0;
  }

 private:
  static constexpr std::uint64_t kStep = 4 << 20;
  std::string what_;
  std::uint64_t sum_ = 0;
};

}  // namespace octrad
