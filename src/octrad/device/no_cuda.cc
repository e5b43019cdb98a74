// device/stream.h in a build without CUDA.
#if !defined(OCTRAD_CUDA)
#include "octrad/base/error.h"
#include "octrad/device/stream.h"

namespace octrad {

DeviceSurvey survey_devices() {
  DeviceSurvey survey;
  survey.why_none = "this program was built without CUDA";
  return survey;
}

std::unique_ptr<Stream> make_cuda_stream(int) { throw DeviceError(survey_devices().why_none); }

bool built_with_cuda() { return false; }

}  // namespace octrad
#endif
