// Under libFuzzer (scripts/fuzz.sh): OCTRAD_FUZZ names the target.
#include <cstdint>
#include <cstdlib>

#include "targets.h"

namespace {
const octrad::fuzz::Target* g_target = nullptr;
}  // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  const char* name = std::getenv("OCTRAD_FUZZ");
  g_target = &octrad::fuzz::find_target(name != nullptr ? name : "");
  octrad::fuzz::prepare();
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  g_target->run(std::string(reinterpret_cast<const char*>(data), size));
  return 0;
}
