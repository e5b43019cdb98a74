// For tests that run on the host stream and, where there is one, on a CUDA device.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "octrad/device/check.h"
#include "octrad/device/stream.h"

namespace octrad::testing {

inline constexpr const char* kNoDevice = "SKIPPED: no CUDA device";

// The host stream, or a CUDA stream; null where there is no device.
inline std::unique_ptr<Stream> stream_or_skip(bool cuda) {
  if (!cuda) return make_host_stream();
  return survey_devices().devices.empty() ? nullptr : make_cuda_stream(0);
}

inline std::string stream_name(const ::testing::TestParamInfo<bool>& info) { return info.param ? "Cuda" : "Host"; }

// Derive from this, and instantiate over ::testing::Bool() with stream_name.
class StreamTest : public ::testing::TestWithParam<bool> {
 protected:
  void SetUp() override {
    stream = stream_or_skip(GetParam());
    if (!stream) GTEST_SKIP() << kNoDevice;
  }
  std::unique_ptr<Stream> stream;
};

inline ::testing::AssertionResult passed(const CheckResult& result) {
  if (result.passed) return ::testing::AssertionSuccess() << result.text();
  return ::testing::AssertionFailure() << result.text();
}

}  // namespace octrad::testing
