#include "octrad/shading/device_world.h"
#include "octrad/transport/rhs_kernels.h"

namespace octrad {

template class RhsOn<DeviceWorld>;

}  // namespace octrad
