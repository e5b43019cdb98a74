// The CUDA runtime behind device/stream.h. The runtime library is linked statically and loads the driver when it is
// first asked for something, so that the program starts where there is none.
#include "octrad/device/cuda_stream.h"

#include <cxxabi.h>

#include <cassert>
#include <cstdlib>
#include <unordered_map>

#include "octrad/base/bytes.h"
#include "octrad/base/error.h"
#include "octrad/device/choose.h"

namespace octrad {
namespace {

std::string version(int number) { return std::to_string(number / 1000) + "." + std::to_string(number % 1000 / 10); }

DeviceInfo describe(int index) {
  DeviceInfo info;
  cudaDeviceProp p{};
  check_cuda(cudaGetDeviceProperties(&p, index), "asking for the device's properties");
  info.index = index;
  info.name = p.name;
  info.major = p.major;
  info.minor = p.minor;
  info.multiprocessors = p.multiProcessorCount;
  info.l2_bytes = static_cast<std::size_t>(p.l2CacheSize);
  info.shared_bytes = p.sharedMemPerBlockOptin;
  info.total_bytes = p.totalGlobalMem;
  return info;
}

struct CudaGraph : LaunchGraph {
  cudaGraphExec_t executable = nullptr;
  std::size_t nodes = 0;
  std::size_t size() const override { return nodes; }
  ~CudaGraph() override {
    if (executable != nullptr) cudaGraphExecDestroy(executable);
  }
};

struct CudaEvent : StreamEvent {
  cudaEvent_t event = nullptr;
  ~CudaEvent() override {
    if (event != nullptr) cudaEventDestroy(event);
  }
};

class CudaStream : public Stream {
 public:
  explicit CudaStream(int index) : index_(index) {
    check_cuda(cudaSetDevice(index), "choosing the device");
    check_cuda(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking), "creating a stream");
  }
  ~CudaStream() override {
    for (const auto& [memory, bytes] : sizes_) cudaFree(memory);
    cudaStreamDestroy(stream_);
  }
  bool on_device() const override { return true; }
  DeviceInfo info() const override {
    DeviceInfo info = describe(index_);
    std::size_t total = 0;
    use_device();
    check_cuda(cudaMemGetInfo(&info.free_bytes, &total), "asking for free memory");
    return info;
  }

  void* allocate(std::size_t bytes, const std::string& what) override {
    not_while_recording("allocation of " + what);
    void* memory = nullptr;
    const cudaError_t status = cudaMalloc(&memory, bytes);
    if (status == cudaErrorMemoryAllocation) {
      cudaGetLastError();  // not sticky
      std::size_t free = 0, total = 0;
      cudaMemGetInfo(&free, &total);
      cudaGetLastError();
      throw MemoryError("no device memory for " + what + " (" + format_bytes(static_cast<double>(bytes)) + "; " +
                        format_bytes(static_cast<double>(free)) + " of " + format_bytes(static_cast<double>(total)) +
                        " are free)");
    }
    check_cuda(status, ("allocating " + what).c_str());
    sizes_[memory] = bytes;
    allocated_ += bytes;
    if (allocated_ > peak_) peak_ = allocated_;
    return memory;
  }
  void release(void* memory) noexcept override {
    assert(!capturing_);  // the recorded graph would use it
    const auto found = sizes_.find(memory);
    if (found == sizes_.end()) return;
    allocated_ -= found->second;
    sizes_.erase(found);
    cudaFree(memory);  // waits for work that uses it
  }
  std::size_t allocated_bytes() const override { return allocated_; }
  std::size_t peak_bytes() const override { return peak_; }

  void upload(void* to, const void* from, std::size_t bytes) override {
    not_while_recording("an upload");
    check_cuda(cudaMemcpyAsync(to, from, bytes, cudaMemcpyHostToDevice, stream_), "copying to the device");
    synchronize();  // pinned sources would otherwise still be read
  }
  void download(void* to, const void* from, std::size_t bytes) override {
    not_while_recording("a download");
    check_cuda(cudaMemcpyAsync(to, from, bytes, cudaMemcpyDeviceToHost, stream_), "copying from the device");
    synchronize();
  }
  void copy(void* to, const void* from, std::size_t bytes) override {
    use_device();
    check_cuda(cudaMemcpyAsync(to, from, bytes, cudaMemcpyDeviceToDevice, stream_), "copying on the device");
  }
  void fill(void* memory, int byte, std::size_t bytes) override {
    use_device();
    check_cuda(cudaMemsetAsync(memory, byte, bytes, stream_), "filling memory");
  }
  void synchronize() override {
    not_while_recording("waiting");
    check_cuda(cudaStreamSynchronize(stream_), "waiting for the device");
  }

  void begin_capture() override {
    if (capturing_) throw DeviceError("a graph is being recorded already");
    use_device();
    check_cuda(cudaStreamBeginCapture(stream_, cudaStreamCaptureModeThreadLocal), "recording a graph");
    capturing_ = true;
  }
  std::unique_ptr<LaunchGraph> end_capture() override {
    capturing_ = false;
    cudaGraph_t graph = nullptr;
    check_cuda(cudaStreamEndCapture(stream_, &graph), "recording a graph");
    auto result = std::make_unique<CudaGraph>();
    cudaError_t status = cudaGraphGetNodes(graph, nullptr, &result->nodes);
    if (status == cudaSuccess) status = cudaGraphInstantiate(&result->executable, graph, 0);
    cudaGraphDestroy(graph);
    check_cuda(status, "preparing a graph");
    return result;
  }
  void replay(LaunchGraph& graph) override {
    not_while_recording("a graph replayed");
    check_cuda(cudaGraphLaunch(static_cast<CudaGraph&>(graph).executable, stream_), "replaying a graph");
  }

  std::unique_ptr<StreamEvent> record() override {
    not_while_recording("a time taken");
    auto result = std::make_unique<CudaEvent>();
    check_cuda(cudaEventCreate(&result->event), "creating an event");
    check_cuda(cudaEventRecord(result->event, stream_), "recording an event");
    return result;
  }
  double milliseconds(StreamEvent& from, StreamEvent& to) override {
    check_cuda(cudaEventSynchronize(static_cast<CudaEvent&>(to).event), "waiting for an event");
    float ms = 0.0f;
    check_cuda(cudaEventElapsedTime(&ms, static_cast<CudaEvent&>(from).event, static_cast<CudaEvent&>(to).event),
               "reading a time");
    return static_cast<double>(ms);
  }

  std::unique_ptr<Stream> sibling() override {
    auto other = std::make_unique<CudaStream>(index_);
    other->tuning = tuning;
    return other;
  }
  void wait(StreamEvent& event) override {
    not_while_recording("waiting for a sibling");
    check_cuda(cudaStreamWaitEvent(stream_, static_cast<CudaEvent&>(event).event, 0), "waiting for an event");
  }

  cudaStream_t handle() {
    use_device();
    return stream_;
  }
  cudaError_t finish_launch() { return capturing_ ? cudaSuccess : cudaStreamSynchronize(stream_); }

 private:
  // Threads that did not make the stream may have another current device.
  void use_device() const {
    int current = -1;
    check_cuda(cudaGetDevice(&current), "asking for the current device");
    if (current != index_) check_cuda(cudaSetDevice(index_), "choosing the device");
  }
  void not_while_recording(const std::string& what) const {
    if (capturing_) throw DeviceError(what + " inside a recorded graph");
    use_device();
  }

  int index_;
  cudaStream_t stream_ = nullptr;
  std::unordered_map<void*, std::size_t> sizes_;
  std::size_t allocated_ = 0, peak_ = 0;
  bool capturing_ = false;
};

}  // namespace

cudaStream_t cuda_handle(Stream& stream) { return static_cast<CudaStream&>(stream).handle(); }

void check_launch(Stream& stream, const char* kernel) {
  static const bool waits = std::getenv("OCTRAD_CUDA_SYNC") != nullptr;
  cudaError_t status = cudaGetLastError();
  if (status == cudaSuccess && waits) status = static_cast<CudaStream&>(stream).finish_launch();
  if (status == cudaSuccess) return;
  int failed = 0;
  char* const name = abi::__cxa_demangle(kernel, nullptr, nullptr, &failed);
  const std::string what = std::string("running ") + (name != nullptr ? name : kernel);
  std::free(name);
  check_cuda(status, what.c_str());
}

void check_cuda(cudaError_t status, const char* what) {
  if (status == cudaSuccess) return;
  cudaGetLastError();  // reported here: the next launch must not report it again
  const std::string message = std::string("CUDA: ") + what + ": " + cudaGetErrorString(status);
  if (status == cudaErrorMemoryAllocation) throw MemoryError(message);
  throw DeviceError(message);
}

DeviceSurvey survey_devices() {
  DeviceSurvey survey;
  int runtime = 0, driver = 0, count = 0;
  cudaRuntimeGetVersion(&runtime);
  survey.runtime = version(runtime);
  survey.architectures = OCTRAD_CUDA_ARCHITECTURES;
  cudaDriverGetVersion(&driver);
  if (driver > 0) survey.driver = version(driver);
  const cudaError_t status = cudaGetDeviceCount(&count);
  cudaGetLastError();
  if (driver == 0) {
    survey.why_none = why_no_driver();
  } else if (status == cudaErrorInsufficientDriver) {
    survey.why_none = "the NVIDIA driver supports CUDA " + survey.driver + "; this program needs " + survey.runtime;
  } else if (status == cudaErrorNoDevice) {
    survey.why_none = "the NVIDIA driver found no CUDA device";
  } else if (status != cudaSuccess) {
    survey.why_none = std::string("CUDA: ") + cudaGetErrorString(status);
  } else if (count == 0) {
    survey.why_none = "no CUDA device was found";
  }
  if (!survey.why_none.empty()) return survey;
  for (int i = 0; i < count; ++i) survey.devices.push_back(describe(i));
  return survey;
}

std::unique_ptr<Stream> make_cuda_stream(int index) {
  const DeviceSurvey survey = survey_devices();
  if (survey.devices.empty()) throw DeviceError(survey.why_none);
  if (index < 0 || index >= static_cast<int>(survey.devices.size())) {
    throw DeviceError("there is no CUDA device " + std::to_string(index) + "; found: 0 to " +
                      std::to_string(survey.devices.size() - 1));
  }
  return std::make_unique<CudaStream>(index);
}

bool built_with_cuda() { return true; }

}  // namespace octrad
