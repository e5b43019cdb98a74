#include "octrad/device/choose.h"

#include <cctype>
#include <charconv>
#include <filesystem>
#include <sstream>

#include "octrad/base/error.h"

namespace octrad {
namespace {

std::string cuda_name(int index) { return "cuda:" + std::to_string(index); }

// Why the device cannot be used; empty: it can.
std::string refusal(const DeviceSurvey& survey, const DeviceInfo& device) {
  if (runs_on(survey.architectures, device.major, device.minor)) return "";
  return cuda_name(device.index) + " (" + device.name + ") has compute capability " + std::to_string(device.major) +
         "." + std::to_string(device.minor) + "; this program was built for " + survey.architectures;
}

}  // namespace

DeviceRequest parse_device(const std::string& text) {
  if (text == "auto") return {};
  if (text == "cpu") return {DeviceRequest::Kind::cpu, -1};
  if (text == "host") return {DeviceRequest::Kind::host, -1};
  if (text == "cuda") return {DeviceRequest::Kind::cuda, -1};
  if (text.rfind("cuda:", 0) == 0) {
    int index = -1;
    const char *begin = text.data() + 5, *end = text.data() + text.size();
    const auto [stop, status] = std::from_chars(begin, end, index);
    if (status == std::errc() && stop == end && index >= 0 && std::isdigit(static_cast<unsigned char>(*begin))) {
      return {DeviceRequest::Kind::cuda, index};
    }
  }
  // By letters alone "gpu" is near to "cpu".
  throw UsageError("--device \"" + text + "\": expected auto, cpu, cuda or cuda:N with N from 0" +
                   did_you_mean(text.find("gpu") != std::string::npos ? "cuda" : text, {"auto", "cpu", "cuda"}));
}

std::unique_ptr<Stream> DeviceChoice::make_stream(const DeviceTuning& tuning) const {
  std::unique_ptr<Stream> stream = cuda ? make_cuda_stream(index) : host ? make_host_stream() : nullptr;
  if (stream) stream->tuning = tuning;
  return stream;
}

DeviceChoice choose_device(const DeviceRequest& request, const DeviceSupport& support, const DeviceSurvey& survey) {
  using Kind = DeviceRequest::Kind;
  if (request.kind == Kind::cpu) return {false, 0, "cpu", "asked for"};
  const bool asked = request.kind == Kind::cuda;
  const std::string no_path = support.what + " runs on the CPU only";
  if (request.kind == Kind::host) {
    if (!support.cuda) throw DeviceError("--device host: " + no_path);
    return {false, 0, "host", "asked for", true};
  }
  if (!asked && !support.cuda) return {false, 0, "cpu", no_path};

  std::string why = survey.why_none;
  for (const DeviceInfo& device : survey.devices) {
    if (request.index >= 0 && device.index != request.index) continue;
    const std::string refused = refusal(survey, device);
    if (refused.empty()) {
      if (!support.cuda) throw DeviceError("--device cuda: " + no_path);
      return {true, device.index, cuda_name(device.index), asked ? "asked for" : "the first device that can be used"};
    }
    if (why.empty()) why = refused;
  }
  if (why.empty()) {
    why = "there is no device " + std::to_string(request.index) + "; there are 0 to " +
          std::to_string(survey.devices.size() - 1);
  }
  if (asked) throw DeviceError("--device " + (request.index >= 0 ? cuda_name(request.index) : "cuda") + ": " + why);
  return {false, 0, "cpu", why};
}

DeviceChoice choose_device(const DeviceRequest& request, const DeviceSupport& support) {
  const bool matters =
      request.kind == DeviceRequest::Kind::cuda || (request.kind == DeviceRequest::Kind::automatic && support.cuda);
  return choose_device(request, support, matters ? survey_devices() : DeviceSurvey{});
}

std::string why_no_driver(const std::string& root) {
  for (const char* file : {"/dev/nvidiactl", "/dev/nvidia0", "/dev/dxg"}) {
    std::error_code failed;
    if (std::filesystem::exists(root + file, failed))
      return std::string("an NVIDIA device is there (") + file +
             "), but the driver's library libcuda.so.1 is not found: name its folder in LD_LIBRARY_PATH, or make it "
             "visible in the container";
  }
  return "no NVIDIA driver is installed";
}

bool runs_on(const std::string& architectures, int major, int minor) {
  if (architectures.empty()) return true;
  std::istringstream words(architectures);
  for (std::string word; std::getline(words, word, ',');) {
    int number = 0;
    const auto parsed = std::from_chars(word.data(), word.data() + word.size(), number);
    if (parsed.ec != std::errc()) return true;  // "native", "all": CMake's own words
    const std::string suffix = word.substr(static_cast<std::size_t>(parsed.ptr - word.data()));
    const int has_major = number / 10, has_minor = number % 10;
    if (suffix[0] == 'a' || suffix[0] == 'f') {  // code of one architecture or family only
      if (has_major == major && (suffix[0] == 'f' ? has_minor <= minor : has_minor == minor)) return true;
      continue;
    }
    const bool same = has_major == major && has_minor <= minor;
    const bool later = has_major < major || same;
    if (suffix == "-virtual" ? later : suffix == "-real" ? same : same || later) return true;
  }
  return false;
}

}  // namespace octrad
