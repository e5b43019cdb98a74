#include "octrad/device/stream.h"

namespace octrad {

std::unique_ptr<LaunchGraph> Stream::capture(const std::function<void()>& work) {
  begin_capture();
  try {
    work();
  } catch (...) {
    try {
      end_capture();
    } catch (...) {  // what `work` threw is the reason
    }
    throw;
  }
  return end_capture();
}

}  // namespace octrad
