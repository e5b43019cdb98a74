#include "shading/device_world.h"
#include "transport/rhs_kernels.h"

namespace octrad {

template class RhsOn<DeviceWorld>;

}  // namespace octrad
