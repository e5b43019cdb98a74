// Which device work runs on: the user's request, the devices found, the choice and its reason.
#pragma once

#include <memory>
#include <string>

#include "octrad/device/stream.h"

namespace octrad {

// --device.
struct DeviceRequest {
  enum class Kind { automatic, cpu, cuda, host } kind = Kind::automatic;
  int index = -1;  // cuda: the device's number; -1: the first that can be used
};

// "auto", "cpu", "cuda" or "cuda:N", and for tests and rehearsals "host": the kernels on the CPU. Throws UsageError
// naming --device.
DeviceRequest parse_device(const std::string& text);

struct DeviceChoice {
  bool cuda = false;
  int index = 0;      // of the CUDA device
  std::string name;   // "cpu", "cuda:0", "host"
  std::string why;    // a clause: "no NVIDIA driver is installed", "asked for"
  bool host = false;  // the host stream

  // The stream that the choice runs on; null for the CPU, which has code of its own.
  std::unique_ptr<Stream> make_stream(const DeviceTuning& tuning = {}) const;
};

// Whether what is to be done has a path on devices, as `what` ("octrad train"). A request for CUDA without one throws,
// and automatic takes the CPU.
struct DeviceSupport {
  std::string what;
  bool cuda = false;
};

// Throws DeviceError, with the reason, when a CUDA device is asked for and cannot be used.
DeviceChoice choose_device(const DeviceRequest& request, const DeviceSupport& support, const DeviceSurvey& survey);
// Surveys the devices only where that can matter: the driver takes a moment to start.
DeviceChoice choose_device(const DeviceRequest& request, const DeviceSupport& support);

// Whether a program compiled for these architectures (as CMake names them, with commas: "75-real,120"; empty: unknown,
// taken for yes) has code for a device of this compute capability: machine code of the same major and no later minor
// version, or code that the driver can translate.
bool runs_on(const std::string& architectures, int major, int minor);

// Why there is no driver, where the runtime found no libcuda: whether there is none, or one that is hidden from it.
// `root` is put before the paths of the device files.
std::string why_no_driver(const std::string& root = "");

}  // namespace octrad
