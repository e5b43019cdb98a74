// Typed memory of a Stream.
#pragma once

#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "octrad/device/stream.h"

namespace octrad {

// `size` items of T, not initialised. Movable; the stream must outlive it.
template <typename T>
class DeviceArray {
 public:
  static_assert(std::is_trivially_copyable_v<T>);
  DeviceArray() = default;
  DeviceArray(Stream& stream, std::size_t size, const std::string& what)
      : stream_(&stream),
        data_(size > 0 ? static_cast<T*>(stream.allocate(size * sizeof(T), what)) : nullptr),
        size_(size) {}
  DeviceArray(Stream& stream, std::span<const T> values, const std::string& what)
      : DeviceArray(stream, values.size(), what) {
    upload(values);
  }
  DeviceArray(DeviceArray&& b) noexcept
      : stream_(b.stream_),
        data_(std::exchange(b.data_, nullptr)),
        size_(std::exchange(b.size_, 0)) {}
  DeviceArray& operator=(DeviceArray&& b) noexcept {
    std::swap(stream_, b.stream_);
    std::swap(data_, b.data_);
    std::swap(size_, b.size_);
    return *this;
  }
  ~DeviceArray() {
    if (data_ != nullptr) stream_->release(data_);
  }

  T* data() const { return data_; }
  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  std::size_t bytes() const { return size_ * sizeof(T); }
  // values.size() may be smaller than size(): the first ones.
  void upload(std::span<const T> values) {
    if (!values.empty()) stream_->upload(data_, values.data(), values.size_bytes());
  }
  void download(std::span<T> values) const {
    if (!values.empty()) stream_->download(values.data(), data_, values.size_bytes());
  }
  std::vector<T> download() const {
    std::vector<T> values(size_);
    download(std::span<T>(values));
    return values;
  }
  void fill(int byte) {
    if (size_ > 0) stream_->fill(data_, byte, bytes());
  }

 private:
  Stream* stream_ = nullptr;
  T* data_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace octrad
