#include "octrad/base/huge_pages.h"

#include <sys/mman.h>

#include <cinttypes>
#include <cstdint>
#include <fstream>
#include <string>

namespace octrad {
namespace {

#if defined(MADV_COLLAPSE)
constexpr int kCollapse = MADV_COLLAPSE;
#else
constexpr int kCollapse = 25;  // Linux 6.1 and later; others refuse it
#endif

}  // namespace

void use_huge_pages() {
  constexpr std::uintptr_t kHugePage = std::uintptr_t{2} << 20;
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);) {
    if (line.find("[heap]") == std::string::npos) continue;
    std::uintptr_t begin = 0, end = 0;
    if (std::sscanf(line.c_str(), "%" SCNxPTR "-%" SCNxPTR, &begin, &end) != 2) continue;
    begin = (begin + kHugePage - 1) / kHugePage * kHugePage;
    end = end / kHugePage * kHugePage;
    if (begin >= end) continue;
    void* const address = reinterpret_cast<void*>(begin);  // NOLINT(performance-no-int-to-ptr)
    if (madvise(address, end - begin, MADV_HUGEPAGE) == 0) madvise(address, end - begin, kCollapse);
  }
}

}  // namespace octrad
