// Names of scattering models and microfacet distributions. Plain data, for host and device.
#pragma once

namespace octrad {

enum class BsdfType { diffuse, plastic, roughplastic, conductor, roughconductor, dielectric, thindielectric };
enum class MicrofacetDistribution { beckmann, ggx };

}  // namespace octrad
