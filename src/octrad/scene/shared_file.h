// A file that several objects of a scene name: read once. Internal to the module.
#pragma once

#include <exception>
#include <memory>
#include <mutex>
#include <utility>

namespace octrad {

// Its content is read by the first who takes it and kept until the last has it. For several threads.
template <typename T>
class SharedFile {
 public:
  void expect() { ++users_, ++left_; }           // one more who will take it; before any does
  bool is_shared() const { return users_ > 1; }  // otherwise the content may be changed

  // A mistake in the file is one of each who takes it. `read` must not wait for parallel work: a thread that waits may
  // take up another object's, and come back here.
  template <typename Read>
  std::shared_ptr<T> take(Read&& read) {
    const std::lock_guard lock(mutex_);
    if (mistake_) std::rethrow_exception(mistake_);
    if (!content_) {
      try {
        content_ = std::make_shared<T>(read());
      } catch (...) {
        mistake_ = std::current_exception();
        throw;
      }
    }
    return --left_ > 0 ? content_ : std::move(content_);
  }

 private:
  std::mutex mutex_;
  int users_ = 0, left_ = 0;
  std::shared_ptr<T> content_;
  std::exception_ptr mistake_;
};

}  // namespace octrad
