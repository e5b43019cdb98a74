// The renderer on the CPU. Use make_renderer().
#pragma once

#include "octrad/render/renderer.h"

namespace octrad {

std::unique_ptr<Renderer> make_cpu_renderer(const PreparedScene& scene, const IntegratorChoice& choice,
                                            const RenderSettings& settings, RadianceField* field, const Config& config);

}  // namespace octrad
