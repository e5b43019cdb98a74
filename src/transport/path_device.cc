#include "shading/device_world.h"
#include "transport/path_kernels.h"

namespace octrad {

template class PathTracerOn<DeviceWorld>;

}  // namespace octrad
