#include "octrad/encoding/huge_array.h"

#include <sys/mman.h>

#include <cstdint>
#include <limits>
#include <string>
#include <utility>

#include "octrad/base/error.h"

namespace octrad {

HugeArray::HugeArray(std::size_t count, const char* what) : count_(count) {
  if (count == 0) return;
  constexpr std::size_t kHugePage = std::size_t{2} << 20;
  const std::size_t bytes = count * sizeof(float);
  const bool overflow = count > (std::numeric_limits<std::size_t>::max() - 2 * kHugePage) / sizeof(float);
  // A small array needs no alignment to huge pages.
  const std::size_t padding = bytes >= kHugePage ? kHugePage : 0;
  mapped_bytes_ = bytes + padding;
  void* p = overflow ? MAP_FAILED
                     : mmap(nullptr, mapped_bytes_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE,
                            -1, 0);
  if (p == MAP_FAILED) {
    count_ = 0;
    throw MemoryError(std::string("cannot allocate ") + std::to_string(bytes >> 20) + " MiB for " + what);
  }
  mapping_ = p;
  std::uintptr_t address = reinterpret_cast<std::uintptr_t>(p);
  if (padding != 0) {
    address = (address + kHugePage - 1) / kHugePage * kHugePage;
    madvise(reinterpret_cast<void*>(address), bytes, MADV_HUGEPAGE);  // advice: without huge pages it is only slower
  }
  data_ = reinterpret_cast<float*>(address);
}

HugeArray::~HugeArray() { release(); }

HugeArray::HugeArray(HugeArray&& other) noexcept { *this = std::move(other); }

HugeArray& HugeArray::operator=(HugeArray&& other) noexcept {
  if (this != &other) {
    release();
    data_ = std::exchange(other.data_, nullptr);
    count_ = std::exchange(other.count_, 0);
    mapping_ = std::exchange(other.mapping_, nullptr);
    mapped_bytes_ = std::exchange(other.mapped_bytes_, 0);
  }
  return *this;
}

void HugeArray::release() noexcept {
  if (mapping_ != nullptr) munmap(mapping_, mapped_bytes_);
  mapping_ = nullptr;
}

}  // namespace octrad
