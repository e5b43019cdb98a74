// Where parallel work runs: a CUDA device, or the host emulating one. Code above this file is written once: it
// allocates arrays (device/array.h) from a Stream and launches functors (device/launch.h) on it, in order. The host
// stream runs the same functors on the CPU, so that every element-wise kernel is tested where there is no GPU.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "octrad/device/tuning.h"

namespace octrad {

struct DeviceInfo {
  int index = 0;
  std::string name;          // "NVIDIA H200"
  int major = 0, minor = 0;  // compute capability
  int multiprocessors = 0;
  std::size_t l2_bytes = 0, shared_bytes = 0;  // shared memory that one block may ask for
  std::size_t total_bytes = 0, free_bytes = 0;
};

// What was found: `why_none` says in a sentence why `devices` is empty.
struct DeviceSurvey {
  std::vector<DeviceInfo> devices;
  std::string driver, runtime;  // CUDA versions, "13.0"; empty where absent
  std::string architectures;    // that this program was compiled for: "75-real,90"; empty without CUDA
  std::string why_none;
};
DeviceSurvey survey_devices();

// Recorded launches that replay as one submission.
class LaunchGraph {
 public:
  virtual ~LaunchGraph() = default;
  virtual std::size_t size() const = 0;  // launches, copies and fills; a GPU's sorts and sums are several launches each
};

// A point in a stream's work.
class StreamEvent {
 public:
  virtual ~StreamEvent() = default;
};

// Memory is not initialised (in builds with assertions the host stream sets all of its bits). Threads may use a
// stream one at a time. Work is done in the order of the calls. Failures throw: MemoryError (naming `what`) for
// allocations, DeviceError for everything else, at the latest in synchronize().
class Stream {
 public:
  virtual ~Stream() = default;
  virtual bool on_device() const = 0;  // false: the host stream
  virtual DeviceInfo info() const = 0;

  virtual void* allocate(std::size_t bytes, const std::string& what) = 0;
  virtual void release(void* memory) noexcept = 0;
  virtual std::size_t allocated_bytes() const = 0;
  virtual std::size_t peak_bytes() const = 0;
  virtual void upload(void* to, const void* from_host, std::size_t bytes) = 0;    // `from_host` may be reused on return
  virtual void download(void* to_host, const void* from, std::size_t bytes) = 0;  // waits for all work before
  virtual void copy(void* to, const void* from, std::size_t bytes) = 0;
  virtual void fill(void* memory, int byte, std::size_t bytes) = 0;
  virtual void synchronize() = 0;

  // Records the launches, copies and fills of `work` instead of running them; everything else throws DeviceError there,
  // on either kind of stream. Kernels must have run before: a device loads them when they are first launched, which
  // must not be recorded; the host stream refuses others. Where `work` throws, nothing is recorded. The host stream
  // records closures.
  std::unique_ptr<LaunchGraph> capture(const std::function<void()>& work);
  virtual void replay(LaunchGraph& graph) = 0;

  virtual std::unique_ptr<StreamEvent> record() = 0;
  virtual double milliseconds(StreamEvent& from, StreamEvent& to) = 0;  // waits for `to`

  // Another queue of the same device, for work that may run beside this one's; arrays are of both. It must not outlive
  // this stream.
  virtual std::unique_ptr<Stream> sibling() = 0;
  // What follows here begins after `event` of a sibling.
  virtual void wait(StreamEvent& event) = 0;

  // For drivers: the launches since the mark before were this stage. Does nothing unless somebody listens
  // (device/stage_times.h), who does not while the stream records.
  void mark(const char* stage) const {
    if (listener_) listener_(stage);
  }
  void listen(std::function<void(const char*)> listener) { listener_ = std::move(listener); }

  DeviceTuning tuning;  // of what is made for this stream from now on

 private:
  std::function<void(const char*)> listener_;
  virtual void begin_capture() = 0;
  virtual std::unique_ptr<LaunchGraph> end_capture() = 0;
};

// The emulated stream: runs kernels on the CPU, a launch in parallel on its threads.
std::unique_ptr<Stream> make_host_stream();
// CUDA device `index`. Throws DeviceError where it cannot be used, or where octrad was built without CUDA.
std::unique_ptr<Stream> make_cuda_stream(int index);
// Whether octrad was built with CUDA.
bool built_with_cuda();

}  // namespace octrad
