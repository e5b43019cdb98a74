// Intel Open Image Denoise (OIDN), version 2, loaded while the program runs: nothing of it is needed to build octrad.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace octrad {

// The functions of its C API that are used, as its documentation describes them. Devices, buffers and filters are
// opaque pointers; enumerations are ints, with the values below.
struct OidnFunctions {
  void* (*oidnNewDevice)(int type);
  void (*oidnSetDeviceInt)(void* device, const char* name, int value);
  void (*oidnSetDeviceBool)(void* device, const char* name, bool value);
  int (*oidnGetDeviceInt)(void* device, const char* name);
  void (*oidnCommitDevice)(void* device);
  int (*oidnGetDeviceError)(void* device, const char** message);  // device null: of the calling thread
  void (*oidnReleaseDevice)(void* device);
  void* (*oidnNewBuffer)(void* device, std::size_t bytes);
  void (*oidnReadBuffer)(void* buffer, std::size_t offset, std::size_t bytes, void* to);
  void (*oidnWriteBuffer)(void* buffer, std::size_t offset, std::size_t bytes, const void* from);
  void (*oidnReleaseBuffer)(void* buffer);
  void* (*oidnNewFilter)(void* device, const char* type);
  void (*oidnSetFilterImage)(void* filter, const char* name, void* buffer, int format, std::size_t width,
                             std::size_t height, std::size_t offset, std::size_t pixel_stride, std::size_t row_stride);
  void (*oidnSetFilterBool)(void* filter, const char* name, bool value);
  void (*oidnSetFilterInt)(void* filter, const char* name, int value);
  void (*oidnCommitFilter)(void* filter);
  void (*oidnExecuteFilter)(void* filter);
  void (*oidnReleaseFilter)(void* filter);
};

namespace oidn {
inline constexpr int kDeviceCpu = 1, kDeviceCuda = 3;                           // OIDNDeviceType
inline constexpr int kFormatFloat3 = 3;                                         // OIDNFormat
inline constexpr int kErrorOutOfMemory = 4;                                     // OIDNError
inline constexpr int kQualityFast = 4, kQualityBalanced = 5, kQualityHigh = 6;  // OIDNQuality
inline constexpr const char* kLibraryVariable = "OCTRAD_OIDN_LIBRARY";          // of the environment
}  // namespace oidn

class OidnLibrary {
 public:
  // `given`: the library, or the folder that it is in; empty: the environment's OCTRAD_OIDN_LIBRARY, then the first of
  // search_places() that can be used. Throws IoError when there is none, with a sentence that says how to get it, or
  // when a given one does not exist; InputError when a given file is not this library, or not its version 2.
  explicit OidnLibrary(const std::string& given = "");
  const OidnFunctions& functions() const { return functions_; }
  const std::string& file() const { return file_; }  // what was loaded

  // Beside the program; ~/.local/lib/octrad, which scripts/install_oidn.sh fills; the dynamic linker's own places;
  // PyPI's pyoidn, where Python keeps its packages.
  static std::vector<std::string> search_places();

 private:
  void load(const std::string& file);  // throws IoError, InputError
  OidnFunctions functions_{};
  std::string file_;
};

}  // namespace octrad
