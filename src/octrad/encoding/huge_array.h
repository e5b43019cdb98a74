// A large zeroed array of floats whose pages are touched only when used, on huge pages where the system has them
// (random reads from a gigabyte run at half speed without).
#pragma once

#include <cstddef>
#include <span>

namespace octrad {

class HugeArray {
 public:
  HugeArray() = default;
  // All elements 0; 64-byte aligned at least. Throws MemoryError when the system refuses; `what` names the array.
  HugeArray(std::size_t count, const char* what);
  ~HugeArray();
  HugeArray(HugeArray&& other) noexcept;
  HugeArray& operator=(HugeArray&& other) noexcept;
  HugeArray(const HugeArray&) = delete;
  HugeArray& operator=(const HugeArray&) = delete;

  std::size_t size() const { return count_; }
  float* data() { return data_; }
  const float* data() const { return data_; }
  std::span<float> span() { return {data_, count_}; }
  std::span<const float> span() const { return {data_, count_}; }

 private:
  void release() noexcept;
  float* data_ = nullptr;
  std::size_t count_ = 0;
  void* mapping_ = nullptr;
  std::size_t mapped_bytes_ = 0;
};

}  // namespace octrad
