#include "octrad/shading/device_world.h"
#include "octrad/transport/gbuffer_kernels.h"

namespace octrad {

template class GBufferOn<DeviceWorld>;

}  // namespace octrad
