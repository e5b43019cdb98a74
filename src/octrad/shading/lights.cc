#include "octrad/shading/lights.h"

#include <optional>

#include "octrad/geometry/shape_view.h"
#include "octrad/shading/environment_map.h"

namespace octrad {
namespace {

struct MeshTables {
  std::vector<LightTriangle> triangles;
  std::vector<float> cdf;
};

// Fills `tables`, and the members of `l` for mesh lights.
void prepare_mesh(const TriangleMesh& mesh, MeshTables& tables, LightRecord& l) {
  double area = 0.0;
  std::vector<double> cdf;
  for (const Vec3i& t : mesh.triangles) {
    LightTriangle triangle;
    triangle.p0 = mesh.positions[static_cast<std::size_t>(t.x)];
    triangle.e1 = mesh.positions[static_cast<std::size_t>(t.y)] - triangle.p0;
    triangle.e2 = mesh.positions[static_cast<std::size_t>(t.z)] - triangle.p0;
    const Vec3d n = cross(Vec3d(triangle.e1), Vec3d(triangle.e2));
    const double twice = length(n);
    if (twice > 0.0) triangle.normal = Vec3f(n / (mesh.flip_normals ? -twice : twice));
    area += 0.5 * twice;
    cdf.push_back(area);
    tables.triangles.push_back(triangle);
  }
  for (const double c : cdf) tables.cdf.push_back(area > 0.0 ? static_cast<float>(c / area) : 1.0f);
  l.triangles = tables.triangles.data();
  l.cdf = tables.cdf.data();
  l.triangle_count = static_cast<int>(tables.triangles.size());
  l.inv_area = area > 0.0 ? static_cast<float>(1.0 / area) : 0.0f;
}

}  // namespace

struct Lights::Impl {
  std::vector<LightRecord> area;
  std::vector<MeshTables> meshes;     // of each area light; empty for spheres
  std::vector<TextureView> textures;  // of the scene, by index
  std::optional<EnvironmentMap> environment;

  bool picks_environment(const LightsView& view, float u_pick) const {
    return environment && pick_light(view, u_pick) >= view.area_count + view.delta_count;
  }
};

Lights::Lights(const Scene& scene) : impl_(std::make_unique<Impl>()) {
  for (const Texture& t : scene.textures) impl_->textures.push_back(texture_view(t));
  impl_->meshes.resize(scene.area_lights.size());
  for (std::size_t i = 0; i < scene.area_lights.size(); ++i) {
    const AreaLight& source = scene.area_lights[i];
    const Texture& texture = scene.textures[static_cast<std::size_t>(source.radiance)];
    LightRecord l;
    l.shape_index = source.shape;
    l.shape = shape_view(scene, static_cast<std::size_t>(source.shape));
    l.texture = texture.kind == Texture::Kind::constant ? -1 : source.radiance;
    l.radiance = texture.color0;
    if (l.shape.sphere != nullptr) {
      l.side = l.shape.sphere->flip_normals ? -1.0f : 1.0f;
      l.inv_area = 1.0f / (4.0f * kPi * l.shape.sphere->radius * l.shape.sphere->radius);
    } else {
      const Shape& shape = scene.shapes[static_cast<std::size_t>(source.shape)];
      prepare_mesh(scene.meshes[static_cast<std::size_t>(shape.geometry)], impl_->meshes[i], l);
    }
    impl_->area.push_back(l);
  }
  view_.area = impl_->area.data();
  view_.textures = impl_->textures.data();
  view_.area_count = static_cast<int>(impl_->area.size());
  view_.delta = scene.delta_lights.data();
  view_.delta_count = static_cast<int>(scene.delta_lights.size());
  view_.count = view_.area_count + view_.delta_count;
  if (!scene.environments.empty()) {
    impl_->environment.emplace(scene.environments.front());
    view_.environment = impl_->environment->view();
    ++view_.count;
  }
  if (view_.count > 0) view_.pick = 1.0f / static_cast<float>(view_.count);
}

Lights::~Lights() = default;

LightSample Lights::sample(Vec3f x, float u_pick, Vec2f u) const { return sample_light(view_, x, u_pick, u); }
Vec3f Lights::emitted(const SurfaceInteraction& surface, Vec3f wo) const { return light_emitted(view_, surface, wo); }
float Lights::pdf(Vec3f x, const SurfaceInteraction& surface) const { return light_pdf(view_, x, surface); }
Vec3f Lights::environment(Vec3f direction) const { return light_environment(view_, direction); }
float Lights::environment_pdf(Vec3f direction) const { return light_environment_pdf(view_, direction); }
Vec3f Lights::environment(Vec3f direction, float& pdf) const { return light_environment(view_, direction, pdf); }

void Lights::prefetch_first(float u_pick, Vec2f u) const {
  if (impl_->picks_environment(view_, u_pick)) impl_->environment->prefetch_table(u);
}

void Lights::prefetch_second(float u_pick, Vec2f u) const {
  if (impl_->picks_environment(view_, u_pick)) impl_->environment->prefetch_pixels(u);
}

}  // namespace octrad
