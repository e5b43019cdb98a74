#include "shading/device_world.h"
#include "transport/gbuffer_kernels.h"

namespace octrad {

template class GBufferOn<DeviceWorld>;

}  // namespace octrad
