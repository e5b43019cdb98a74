#include "octrad/shading/bsdf.h"

#include "octrad/shading/bsdf_math.h"

namespace octrad {

Vec3f evaluate(const Bsdf& bsdf, Vec3f wo, Vec3f wi) { return evaluate_bsdf(bsdf, wo, wi).value; }
float pdf(const Bsdf& bsdf, Vec3f wo, Vec3f wi) { return evaluate_bsdf(bsdf, wo, wi).pdf; }
BsdfValue evaluate_pdf(const Bsdf& bsdf, Vec3f wo, Vec3f wi) { return evaluate_bsdf(bsdf, wo, wi); }
BsdfSample sample(const Bsdf& bsdf, Vec3f wo, float u_lobe, Vec2f u) { return sample_bsdf(bsdf, wo, u_lobe, u); }
bool is_delta(const Bsdf& bsdf) { return is_delta_bsdf(bsdf); }
Vec3f albedo(const Bsdf& bsdf) { return albedo_bsdf(bsdf); }
float roughness(const Bsdf& bsdf) { return roughness_bsdf(bsdf); }

}  // namespace octrad
