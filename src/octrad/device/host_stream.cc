#include "octrad/device/host_stream.h"

#include <cassert>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include "octrad/base/bytes.h"
#include "octrad/base/error.h"
#include "octrad/base/threads.h"

namespace octrad {
namespace {

constexpr std::size_t kAlignment = 256;  // as cudaMalloc
constexpr std::size_t kMostBytes = std::size_t{1}
                                   << 40;  // more is refused beforehand: sanitizers end the program on such requests

// New device memory is not zero. With assertions on all bits are set here: NaNs as floats, and out of range as counts
// and indices.
void poison([[maybe_unused]] void* memory, [[maybe_unused]] std::size_t bytes) {
#if !defined(NDEBUG)
  std::memset(memory, 0xff, bytes);
#endif
}

struct HostGraph : LaunchGraph {
  std::vector<std::function<void()>> work;
  std::size_t size() const override { return work.size(); }
};

struct HostEvent : StreamEvent {
  std::chrono::steady_clock::time_point time = std::chrono::steady_clock::now();
};

class HostStream : public Stream {
 public:
  ~HostStream() override {
    for (const auto& [memory, bytes] : sizes_) std::free(memory);
  }
  bool on_device() const override { return false; }
  DeviceInfo info() const override {
    DeviceInfo info;
    info.name = "host";
    info.total_bytes = info.free_bytes = static_cast<std::size_t>(usable_memory());
    return info;
  }

  void* allocate(std::size_t bytes, const std::string& what) override {
    not_while_recording("allocation of " + what);
    void* memory = bytes > kMostBytes
                       ? nullptr
                       : std::aligned_alloc(kAlignment, (bytes + kAlignment - 1) / kAlignment * kAlignment);
    if (memory == nullptr)
      throw MemoryError("no memory for " + what + " (" + format_bytes(static_cast<double>(bytes)) + ")");
    poison(memory, bytes);
    sizes_[memory] = bytes;
    allocated_ += bytes;
    if (allocated_ > peak_) peak_ = allocated_;
    return memory;
  }
  void release(void* memory) noexcept override {
    assert(!capture_);  // as on a device: the recorded graph would use it
    const auto found = sizes_.find(memory);
    if (found == sizes_.end()) return;
    allocated_ -= found->second;
    sizes_.erase(found);
    std::free(memory);
  }
  std::size_t allocated_bytes() const override { return allocated_; }
  std::size_t peak_bytes() const override { return peak_; }

  void upload(void* to, const void* from, std::size_t bytes) override {
    not_while_recording("an upload");
    std::memcpy(to, from, bytes);
  }
  void download(void* to, const void* from, std::size_t bytes) override {
    not_while_recording("a download");
    std::memcpy(to, from, bytes);
  }
  void copy(void* to, const void* from, std::size_t bytes) override {
    run([=] { std::memmove(to, from, bytes); });
  }
  void fill(void* memory, int byte, std::size_t bytes) override {
    run([=] { std::memset(memory, byte, bytes); });
  }
  void synchronize() override { not_while_recording("waiting"); }

  void begin_capture() override {
    if (capture_) throw DeviceError("a graph is being recorded already");
    capture_ = std::make_unique<HostGraph>();
  }
  std::unique_ptr<LaunchGraph> end_capture() override { return std::move(capture_); }
  void replay(LaunchGraph& graph) override {
    not_while_recording("a graph replayed");
    for (const auto& work : static_cast<HostGraph&>(graph).work) run(work);
  }

  std::unique_ptr<StreamEvent> record() override {
    not_while_recording("a time taken");
    return std::make_unique<HostEvent>();
  }
  double milliseconds(StreamEvent& from, StreamEvent& to) override {
    return std::chrono::duration<double, std::milli>(static_cast<HostEvent&>(to).time -
                                                     static_cast<HostEvent&>(from).time)
        .count();
  }

  void know(const void* kernel) {
    if (!capture_) known_.insert(kernel);
    else if (known_.count(kernel) == 0) throw DeviceError("a kernel inside a recorded graph that has not run before");
  }
  std::unique_ptr<Stream> sibling() override {
    auto other = make_host_stream();
    other->tuning = tuning;
    return other;
  }
  void wait(StreamEvent&) override { not_while_recording("waiting for a sibling"); }  // its work is done when recorded

  void run(std::function<void()> work) {
    if (capture_) capture_->work.push_back(std::move(work));
    else work();
  }

 private:
  void not_while_recording(const std::string& what) const {
    if (capture_) throw DeviceError(what + " inside a recorded graph");
  }

  std::unordered_map<void*, std::size_t> sizes_;
  std::size_t allocated_ = 0, peak_ = 0;
  std::unique_ptr<HostGraph> capture_;
  std::unordered_set<const void*> known_;  // kernels that have run
};

}  // namespace

std::unique_ptr<Stream> make_host_stream() { return std::make_unique<HostStream>(); }

void host_launch(Stream& stream, std::size_t n, const void* kernel,
                 const std::function<void(std::size_t, std::size_t)>& body, std::size_t block) {
  auto& host = static_cast<HostStream&>(stream);
  host.know(kernel);
  host.run([=] { parallel_blocks(n, block, body); });
}

}  // namespace octrad
