#include "octrad/shading/lights.h"

#include <algorithm>
#include <cassert>
#include <numeric>
#include <optional>

#include "octrad/base/cdf.h"
#include "octrad/geometry/shape_view.h"
#include "octrad/shading/environment_map.h"

namespace octrad {
namespace {

struct MeshTables {
  std::vector<LightTriangle> triangles;
  std::vector<CdfEntry> cdf;
  std::vector<CdfEntry> grid;
};

// Where two triangles are one parallelogram, the triangle of one of its corners, which spans it.
std::optional<LightTriangle> spanning_triangle(const TriangleMesh& mesh, const std::vector<LightTriangle>& triangles) {
  if (triangles.size() != 2) return {};
  const auto vertex = [&mesh](std::size_t triangle, int k) {
    return mesh.positions[static_cast<std::size_t>(mesh.triangles[triangle][k % 3])];
  };
  for (int k = 0; k < 3; ++k) {
    const Vec3f p = vertex(0, k), e1 = vertex(0, k + 1) - p, e2 = vertex(0, k + 2) - p;
    for (int m = 0; m < 3; ++m) {
      const Vec3f off[] = {vertex(1, m) - (p + e1 + e2), vertex(1, m + 1) - (p + e2), vertex(1, m + 2) - (p + e1)};
      const float largest = std::max({length(off[0]), length(off[1]), length(off[2])});
      if (largest <= 1e-6f * length(e1 - e2)) return LightTriangle{p, e1, e2, triangles[0].normal};
    }
  }
  return {};
}

// Fills `tables`, and the members of `l` for mesh lights.
void prepare_mesh(const TriangleMesh& mesh, MeshTables& tables, LightRecord& l) {
  double area = 0.0;
  std::vector<double> areas;
  for (const Vec3i& t : mesh.triangles) {
    LightTriangle triangle;
    triangle.p0 = mesh.positions[static_cast<std::size_t>(t.x)];
    triangle.e1 = mesh.positions[static_cast<std::size_t>(t.y)] - triangle.p0;
    triangle.e2 = mesh.positions[static_cast<std::size_t>(t.z)] - triangle.p0;
    const Vec3d n = cross(Vec3d(triangle.e1), Vec3d(triangle.e2));
    const double twice = length(n);
    if (twice > 0.0) triangle.normal = Vec3f(n / (mesh.flip_normals ? -twice : twice));
    area += 0.5 * twice;
    areas.push_back(area);
    tables.triangles.push_back(triangle);
  }
  // No triangle has to be picked then, and close points of the square stay close.
  if (l.shape.mesh.normals == nullptr && l.texture < 0) {
    if (const auto spanning = spanning_triangle(mesh, tables.triangles)) {
      tables.triangles[0] = *spanning;
      l.parallelogram = true;
    }
  }
  tables.cdf = make_cdf(areas);
  l.triangles = tables.triangles.data();
  l.cdf = tables.cdf.data();
  l.triangle_count = static_cast<int>(tables.triangles.size());
  l.inv_area = area > 0.0 ? static_cast<float>(1.0 / area) : 0.0f;
}

// Whether both triangles are one parallelogram with affine texture coordinates that fill [0, 1]^2.
bool shows_whole_picture(const TriangleMesh& mesh) {
  if (mesh.triangles.size() != 2 || mesh.uvs.size() != mesh.positions.size()) return false;
  const MeshView view = mesh_view(mesh);
  unsigned corners = 0;
  for (const Vec3i& t : mesh.triangles) {
    for (int k = 0; k < 3; ++k) {
      const Vec2f uv = mesh.uvs[static_cast<std::size_t>(t[k])];
      if ((uv.x != 0.0f && uv.x != 1.0f) || (uv.y != 0.0f && uv.y != 1.0f)) return false;
      corners |= 1u << (static_cast<int>(uv.x) + 2 * static_cast<int>(uv.y));
      // Where the first triangle's plane and coordinates put it.
      const Vec2f b = lights_detail::barycentric_of_uv(view, 0, uv);
      const Vec3i f = mesh.triangles[0];
      const auto at = [&](int i) { return mesh.positions[static_cast<std::size_t>(i)]; };
      const Vec3f p = at(f.x) + (at(f.y) - at(f.x)) * b.x + (at(f.z) - at(f.x)) * b.y;
      if (!(length(p - at(t[k])) <= 1e-4f * length(at(f.y) - at(f.z)))) return false;
    }
  }
  return corners == 15;
}

// Cells of about a texel, up to 128 a side; also dark ones are drawn sometimes, as their edges may not be.
void prepare_grid(const TextureView& texture, MeshTables& tables, LightRecord& l) {
  constexpr int kMostSide = 128, kPoints = 3;
  constexpr double kUniformShare = 0.02;
  l.grid_side = std::clamp(std::max(texture.width, texture.height), 16, kMostSide);
  const auto side = static_cast<float>(l.grid_side * kPoints);
  std::vector<double> sums;
  double sum = 0.0;
  for (int i = 0; i < l.grid_side * l.grid_side; ++i) {
    for (int k = 0; k < kPoints * kPoints; ++k) {
      const Vec2f uv{(static_cast<float>(i % l.grid_side * kPoints + k % kPoints) + 0.5f) / side,
                     (static_cast<float>(i / l.grid_side * kPoints + k / kPoints) + 0.5f) / side};
      sum += static_cast<double>(luminance(evaluate_texture(texture, uv)));
    }
    sums.push_back(sum);
  }
  if (!(sum > 0.0)) return;
  const auto count = static_cast<double>(sums.size());
  for (std::size_t i = 0; i < sums.size(); ++i)
    sums[i] = (1.0 - kUniformShare) * sums[i] / sum + kUniformShare * static_cast<double>(i + 1) / count;
  tables.grid = make_cdf(sums);
  l.grid = tables.grid.data();
}

}  // namespace

struct Lights::Impl {
  const Scene& scene;
  std::vector<LightRecord> area;
  std::vector<MeshTables> meshes;     // of each area light; empty for spheres
  std::vector<TextureView> textures;  // of the scene, by index
  std::vector<DeltaLight> delta;
  std::vector<CdfEntry> cdf;  // of picking
  std::optional<EnvironmentMap> environment;

  Vec3f area_radiance(std::size_t i) const {
    const Texture& texture = scene.textures[static_cast<std::size_t>(scene.area_lights[i].radiance)];
    return texture.kind == Texture::Kind::constant ? texture.color0 : Vec3f(1.0f);
  }
};

Lights::Lights(const Scene& scene) : impl_(new Impl{scene, {}, {}, {}, scene.delta_lights, {}, {}}) {
  for (const Texture& t : scene.textures) impl_->textures.push_back(texture_view(t));
  impl_->meshes.resize(scene.area_lights.size());
  for (std::size_t i = 0; i < scene.area_lights.size(); ++i) {
    const AreaLight& source = scene.area_lights[i];
    const Texture& texture = scene.textures[static_cast<std::size_t>(source.radiance)];
    LightRecord l;
    l.shape_index = source.shape;
    l.shape = shape_view(scene, static_cast<std::size_t>(source.shape));
    l.texture = texture.kind == Texture::Kind::constant ? -1 : source.radiance;
    l.radiance = impl_->area_radiance(i);
    if (l.shape.sphere != nullptr) {
      l.side = l.shape.sphere->flip_normals ? -1.0f : 1.0f;
      l.inv_area = 1.0f / (4.0f * kPi * l.shape.sphere->radius * l.shape.sphere->radius);
    } else {
      const Shape& shape = scene.shapes[static_cast<std::size_t>(source.shape)];
      const TriangleMesh& mesh = scene.meshes[static_cast<std::size_t>(shape.geometry)];
      prepare_mesh(mesh, impl_->meshes[i], l);
      if (l.texture >= 0 && shows_whole_picture(mesh))
        prepare_grid(impl_->textures[static_cast<std::size_t>(l.texture)], impl_->meshes[i], l);
    }
    impl_->area.push_back(l);
  }
  view_.area = impl_->area.data();
  view_.textures = impl_->textures.data();
  view_.area_count = static_cast<int>(impl_->area.size());
  view_.delta = impl_->delta.data();
  view_.delta_count = static_cast<int>(scene.delta_lights.size());
  view_.count = view_.area_count + view_.delta_count;
  if (!scene.environments.empty()) {
    impl_->environment.emplace(scene.environments.front(), scene.file);
    view_.environment = impl_->environment->view();
    ++view_.count;
  }
  std::vector<float> weights = scene.sampling_weights();
  if (weights.empty()) weights.assign(static_cast<std::size_t>(view_.count), 1.0f);
  set_weights(weights);
}

Lights::~Lights() = default;

void Lights::set_weights(std::span<const float> weights) {
  assert(weights.size() == static_cast<std::size_t>(view_.count));
  std::vector<double> sums(weights.begin(), weights.end());
  std::partial_sum(sums.begin(), sums.end(), sums.begin());
  impl_->cdf = make_cdf(sums);
  view_.cdf = impl_->cdf.data();
  for (int i = 0; i < view_.area_count; ++i) impl_->area[static_cast<std::size_t>(i)].pick = light_pick(view_, i);
  if (impl_->environment) view_.environment_pick = light_pick(view_, view_.count - 1);
}

const EnvironmentMap* Lights::environment_map() const { return impl_->environment ? &*impl_->environment : nullptr; }

void Lights::set_environment_places(const EnvironmentPlaces& places) {
  if (!impl_->environment) return;
  impl_->environment->set_places(places);
  view_.environment = impl_->environment->view();
}

void Lights::set_factor(int index, Vec3f factor) {
  const int delta = index - view_.area_count;
  if (delta < 0) {
    const auto i = static_cast<std::size_t>(index);
    impl_->area[i].radiance = impl_->area_radiance(i) * factor;
  } else if (delta < view_.delta_count) {
    const auto i = static_cast<std::size_t>(delta);
    impl_->delta[i].intensity = impl_->scene.delta_lights[i].intensity * factor;
  } else {
    view_.environment_factor = factor;
  }
}

LightSample Lights::sample(Vec3f x, float u_pick, Vec2f u) const { return sample_light(view_, x, u_pick, u); }
Vec3f Lights::emitted(const SurfaceInteraction& surface, Vec3f wo) const { return light_emitted(view_, surface, wo); }
float Lights::pdf(Vec3f x, const SurfaceInteraction& surface) const { return light_pdf(view_, x, surface); }
Vec3f Lights::environment(Vec3f direction) const { return light_environment(view_, direction); }
float Lights::environment_pdf(Vec3f x, Vec3f direction) const { return light_environment_pdf(view_, x, direction); }
Vec3f Lights::environment(Vec3f x, Vec3f direction, float& pdf) const {
  return light_environment(view_, x, direction, pdf);
}

Lights::Draw Lights::begin(Vec3f x, float u_pick, Vec2f u) const {
  Draw draw{u_pick, u, false, {}};
  const EnvironmentView& map = view_.environment;
  draw.in_map = map.parts != nullptr && pick_light(view_, u_pick) >= view_.area_count + view_.delta_count;
  if (draw.in_map) {
    draw.pick = pick_row(map, x, u);
    impl_->environment->prefetch_table(draw.pick);
  }
  return draw;
}

void Lights::go_on(Draw& draw) const {
  if (!draw.in_map) return;
  pick_column(view_.environment, draw.pick);
  impl_->environment->prefetch_pixels(draw.pick);
}

}  // namespace octrad
