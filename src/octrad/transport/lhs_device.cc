#include "octrad/shading/device_world.h"
#include "octrad/transport/lhs_kernels.h"

namespace octrad {

template class LhsOn<DeviceWorld>;

}  // namespace octrad
