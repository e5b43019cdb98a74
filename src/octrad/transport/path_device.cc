#include "octrad/shading/device_world.h"
#include "octrad/transport/path_kernels.h"

namespace octrad {

template class PathTracerOn<DeviceWorld>;

}  // namespace octrad
