// Under libFuzzer (scripts/fuzz.sh): OCTRAD_FUZZ names the target.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string>

#include "mutate.h"
#include "targets.h"

namespace {
const octrad::fuzz::Target* g_target = nullptr;

std::string text(const std::uint8_t* data, std::size_t size) { return {reinterpret_cast<const char*>(data), size}; }

std::size_t change(const std::string& bytes, const std::string& from, std::uint8_t* out, std::size_t max_size,
                   unsigned seed) {
  const std::size_t room = max_size - std::min(bytes.size(), max_size);
  const std::string changed = octrad::fuzz::changed_file(g_target->name, bytes, from, room, seed);
  const std::size_t size = std::min(changed.size(), max_size);
  std::memcpy(out, changed.data(), size);
  return size;
}
}  // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  const char* name = std::getenv("OCTRAD_FUZZ");
  g_target = &octrad::fuzz::find_target(name != nullptr ? name : "");
  octrad::fuzz::prepare();
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  g_target->run(text(data, size));
  return 0;
}

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned seed) {
  const std::string bytes = text(data, size);
  return change(bytes, bytes, data, max_size, seed);
}

extern "C" std::size_t LLVMFuzzerCustomCrossOver(const std::uint8_t* data, std::size_t size, const std::uint8_t* other,
                                                 std::size_t other_size, std::uint8_t* out, std::size_t max_size,
                                                 unsigned seed) {
  return change(text(data, size), text(other, other_size), out, max_size, seed);
}
