#include "app/view/inspect.h"
#include "app/report/vector_json.h"

#include "octrad/transport/first_hit_math.h"
#include "octrad/transport/query_point.h"

namespace octrad::viewer {
namespace {

// One point that the field is asked at.
nlohmann::json answer(const RadianceField& field, const Config& config, const SurfacePoint& point) {
  std::vector<float> features(static_cast<std::size_t>(field.feature_count()));
  float disparity = 0.0f;
  Vec3f radiance;
  const std::span<const SurfacePoint> one(&point, 1);
  field.inspect(one, features, std::span(&disparity, 1));
  field.radiance(one, std::span(&radiance, 1));
  const auto levels = static_cast<std::size_t>(std::max(1, field.levels()));
  nlohmann::json by_level = nlohmann::json::array();
  for (std::size_t l = 0; l < levels; ++l) {
    const std::size_t n = features.size() / levels;
    by_level.push_back(std::vector<float>(features.begin() + static_cast<std::ptrdiff_t>(l * n),
                                          features.begin() + static_cast<std::ptrdiff_t>((l + 1) * n)));
  }
  return {{"x", vector_json(point.x)},
          {"wo", vector_json(point.wo)},
          {"n", vector_json(point.n)},
          {"albedo", vector_json(point.albedo)},
          {"alpha", point.alpha},
          {"direction", vector_json(lookup_direction(lookup_rule(config), point))},
          {"disparity", disparity},
          {"features", by_level},
          {"radiance", vector_json(radiance)}};
}

}  // namespace

nlohmann::json inspect(const Studio& studio, const View& view, double x, double y, const ViewerModel* model) {
  const TransportContext context = studio.scene.context();
  const CameraView camera = view.camera.view(view.width, view.height);
  const Vec2f position{static_cast<float>(x) * static_cast<float>(view.width),
                       static_cast<float>(y) * static_cast<float>(view.height)};
  CameraSample sample{camera_ray(camera, position), Rng(studio.settings.seed, RngPurpose::pixel, 0), position};
  nlohmann::json out = {{"hit", false}};
  int traced = 0;
  const Hit hit = camera_hit(context, sample.ray, traced);
  if (!hit.valid()) {
    out["emitted"] = vector_json(context.hides_emitters() ? Vec3f(0.0f) : context.environment(sample.ray.direction));
    return out;
  }
  const SurfaceInteraction surface = context.interact(hit, sample.ray.origin, sample.ray.direction);
  const ShadingPoint shading = context.shade(surface, -sample.ray.direction);
  const Scene& scene = studio.scene.scene();
  const Shape& shape = scene.shapes[static_cast<std::size_t>(surface.shape)];
  out["hit"] = true;
  out["position"] = vector_json(surface.position);
  out["distance"] = length(surface.position - view.camera.origin);
  out["shape"] = shape.id;
  out["material_number"] = surface.material;  // -1: none
  out["material"] =
      surface.material >= 0 ? scene.materials[static_cast<std::size_t>(surface.material)].id : std::string();
  out["normal"] = vector_json(viewed_normal(shading));
  out["uv"] = {surface.uv.x, surface.uv.y};
  out["albedo"] = vector_json(shading.black ? Vec3f(0.0f) : albedo_bsdf(shading.bsdf));
  out["roughness"] = roughness_bsdf(shading.bsdf);
  out["emitted"] = vector_json(surface.emitter >= 0 ? context.emitted(surface, -sample.ray.direction) : Vec3f(0.0f));
  if (model == nullptr) return out;
  const FirstHitOptions options(first_hit_rules(model->config));
  const QueryRays rays = query_rays(model->config);
  RayEnd end;
  FirstHit first;
  const FirstHitQuery query = trace_first_hit(context, options, sample, end, first);
  out["queries"] = nlohmann::json::array();
  if (query.next != FirstHitQuery::Next::query) return out;
  out["throughput"] = vector_json(end.throughput);
  for_each_asked_lobe(options, end.point, [&] {
    out["queries"].push_back(
        answer(*model->field, model->config, field_query_point(context, end.point, rays, sample.rng)));
  });
  return out;
}

}  // namespace octrad::viewer
