// The renderer on a Stream. Use make_renderer().
#pragma once

#include "octrad/render/renderer.h"

namespace octrad {

// The samples, and on the host stream the sums, are those of the CPU's renderer. They are taken in jobs that fit into
// settings.max_memory.
std::unique_ptr<Renderer> make_stream_renderer(Stream& stream, const PreparedScene& scene,
                                               const IntegratorChoice& choice, const RenderSettings& settings,
                                               RadianceField* field, const Config& config);

}  // namespace octrad
