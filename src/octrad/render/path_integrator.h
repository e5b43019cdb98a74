// Path-traced pictures.
#pragma once

#include "octrad/render/render_loop.h"
#include "octrad/transport/path.h"

namespace octrad {

// Renders with trace_paths (options.max_depth, options.rr_depth) into the channels of picture_channels().
RenderResult render_path(const TransportContext& context, const RenderOptions& options);

}  // namespace octrad
