#include "transport/context.h"

#include "shading/bsdf_math.h"

namespace octrad {

SurfacePoint surface_point(const ShadingPoint& shading) {
  SurfacePoint point;
  point.x = shading.surface.position;
  point.n = dot(shading.ns, shading.wo) < 0.0f ? -shading.ns : shading.ns;
  point.wo = shading.wo;
  point.albedo = albedo_bsdf(shading.bsdf);
  point.alpha = roughness_bsdf(shading.bsdf);
  return point;
}

RayEnd follow_ray(const TransportContext& context, Vec3f position, const Vec3f* geometric_normal, Vec3f direction, Rng& rng,
                  bool follow_delta, int max_chain, float t_max, std::optional<ShadingPoint>* first_surface) {
  RayEnd end;
  Vec3f origin = geometric_normal ? offset_origin(position, *geometric_normal, direction) : position;
  for (int passed = 0; passed <= max_chain; ++passed) {
    const bool first = passed == 0;  // only here could light sampling from `position` have found the same emitter
    const Hit hit = context.tracer.intersect(origin, direction, 0.0f, passed == 0 ? t_max : kRayInfinity);
    ++end.rays;
    if (!hit.valid()) {
      const Vec3f radiance = context.lights.environment(direction);
      if (first) {
        end.first_emitted = radiance;
        end.first_light_pdf = context.lights.environment_pdf(direction);
      } else {
        end.emitted += end.throughput * radiance;
      }
      end.escaped = true;
      return end;
    }
    const SurfaceInteraction surface = interact(context.scene, hit, origin, direction);
    end.passed_emitted = end.first_emitted + end.emitted;
    end.own_emitted = Vec3f(0.0f);
    if (surface.emitter >= 0) {
      const Vec3f radiance = context.lights.emitted(surface, -direction);
      end.own_emitted = radiance;
      if (first) {
        end.first_emitted = radiance;
        end.first_light_pdf = context.lights.pdf(position, surface);
      } else {
        end.emitted += end.throughput * radiance;
      }
    }
    end.point = shade(context.materials, surface, -direction);
    if (end.point.black) {
      if (first_surface && !*first_surface) *first_surface = end.point;
      return end;
    }
    if (end.point.bsdf.opacity < 1.0f) {
      if (rng.uniform() >= end.point.bsdf.opacity) {  // straight through: the opacity is the probability, so the weight is 1
        origin = offset_origin(surface.position, surface.geometric_normal, direction);
        continue;
      }
      end.point.bsdf.opacity = 1.0f;
    }
    if (first_surface && !*first_surface) *first_surface = end.point;
    if (!follow_delta || !is_delta_bsdf(end.point.bsdf)) {
      end.surface = true;
      return end;
    }
    const float u_lobe = rng.uniform();
    const BsdfSample scattered = sample_bsdf(end.point.bsdf, end.point.to_local(end.point.wo), u_lobe, rng.uniform2());
    if (!scattered.valid) return end;
    end.throughput *= scattered.weight;
    if (max_component(end.throughput) <= 0.0f) return end;
    direction = normalize(end.point.to_world(scattered.wi));
    origin = offset_origin(surface.position, surface.geometric_normal, direction);
  }
  return end;  // longer than max_chain: what is left of the chain is lost (method section 7)
}

}  // namespace octrad
