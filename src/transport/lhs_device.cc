#include "shading/device_world.h"
#include "transport/lhs_kernels.h"

namespace octrad {

template class LhsOn<DeviceWorld>;

}  // namespace octrad
