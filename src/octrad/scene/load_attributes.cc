// Textures that show attributes of a mesh (`mesh_attribute`). They become pictures: every triangle gets two by two
// texels, whose bilinear interpolation is the linear one of the triangle's corners, and the mesh gets the coordinates
// of these texels instead of its own, which run along the same directions. So shading knows nothing of attributes.
#include <algorithm>
#include <cmath>

#include "octrad/base/frame.h"
#include "octrad/base/memory_limit.h"
#include "octrad/base/number_text.h"
#include "octrad/image/tonemap_math.h"
#include "octrad/scene/builder.h"

namespace octrad {
namespace {

constexpr int kDeepest = 256;  // objects in objects; bsdfs are refused earlier

// The corners of a triangle in the square between the centres of its four texels. u and v run as the mesh's own do, so
// that anisotropic surfaces and normal maps keep their directions: each is scaled by itself, which turns neither.
struct Corners {
  double x[3] = {0.0, 1.0, 0.0}, y[3] = {0.0, 0.0, 1.0};
  // Barycentric coordinates of a point: what belongs to the second corner, and to the third.
  void barycentric(double px, double py, double& second, double& third) const {
    const double d = determinant();
    second = ((px - x[0]) * (y[2] - y[0]) - (py - y[0]) * (x[2] - x[0])) / d;
    third = ((x[1] - x[0]) * (py - y[0]) - (y[1] - y[0]) * (px - x[0])) / d;
  }
  double determinant() const { return (x[1] - x[0]) * (y[2] - y[0]) - (y[1] - y[0]) * (x[2] - x[0]); }
};

Corners corners_of(const TriangleMesh& mesh, const Vec3i& triangle) {
  if (mesh.uvs.empty()) return {};  // surfaces without coordinates have those of the corners
  Vec2f uv[3];
  for (int c = 0; c < 3; ++c) uv[c] = mesh.uvs[static_cast<std::size_t>(triangle[c])];
  const Vec2f d1 = uv[1] - uv[0], d2 = uv[2] - uv[0];
  if (d1.x * d2.y - d1.y * d2.x == 0.0f) {  // there they run along any frame: interaction_math.h
    Vec3f p[3];
    for (int c = 0; c < 3; ++c) p[c] = mesh.positions[static_cast<std::size_t>(triangle[c])];
    const Vec3d n = cross(Vec3d(p[1] - p[0]), Vec3d(p[2] - p[0]));
    if (!(length(n) > 0.0)) return {};
    const Frame frame = make_frame(Vec3f(normalize(n)));
    for (int c = 0; c < 3; ++c) uv[c] = {dot(p[c] - p[0], frame.s), dot(p[c] - p[0], frame.t)};
  }
  constexpr double kMargin = 0.01;  // rounding must not lead to the next triangle's texels
  Corners out;
  const auto spread = [&](double* to, float Vec2f::*axis) {
    const auto [low, high] = std::minmax({uv[0].*axis, uv[1].*axis, uv[2].*axis});
    const double size = static_cast<double>(high) - static_cast<double>(low);
    for (int c = 0; c < 3; ++c)
      to[c] = kMargin + (1.0 - 2.0 * kMargin) * (static_cast<double>(uv[c].*axis) - static_cast<double>(low)) / size;
  };
  spread(out.x, &Vec2f::x);
  spread(out.y, &Vec2f::y);
  // Values at the texels are continued from the triangle; from one that is hardly wider than a line that is too far.
  constexpr double kNarrow = 1e-3;
  return std::fabs(out.determinant()) > kNarrow ? out : Corners();
}

}  // namespace

int SceneBuilder::attribute_texture(const Element& element, TextureRole role) {
  Params params(description_, element, scene_.warnings);
  AttributeUse use;
  use.name = params.required_string("name");
  use.where = params.where("name");
  use.scale = params.get_float("scale", 1.0f);
  use.role = role;
  use.srgb = element.old;
  params.finish();
  if (!use.name.starts_with("vertex_") && !use.name.starts_with("face_"))
    fail(use.where, "the name of a mesh attribute begins with vertex_ or face_, not \"" + use.name + "\"");
  if (!in_shape_)
    fail(element.location, "a mesh_attribute shows nothing here: it belongs into a bsdf or an emitter of a mesh");
  use.texture = static_cast<int>(scene_.textures.size());
  Texture t;
  t.kind = Texture::Kind::bitmap;
  t.wrap = Texture::Wrap::clamp;
  t.filter = use.name.starts_with("face_") ? Texture::Filter::nearest : Texture::Filter::bilinear;
  scene_.textures.push_back(std::move(t));
  attribute_uses_.push_back(use);
  return use.texture;
}

unsigned SceneBuilder::texture_kinds(const Element& element, int depth) {
  if (depth > kDeepest) return 0;
  const auto [at, inserted] = texture_kinds_.emplace(&element, 0u);  // 0 also while an object that holds itself is open
  if (!inserted) return at->second;
  unsigned kinds = 0;
  if (element.tag == "texture") {
    const std::string& type = element.get("type");
    kinds |= type == "mesh_attribute" ? kUsesAttributes : type == "bitmap" || type == "checkerboard" ? kUsesUv : 0u;
  }
  for (const auto& child : element.children) {
    const auto target = child->tag == "ref" ? description_.ids.find(child->get("id")) : description_.ids.end();
    kinds |= texture_kinds(target != description_.ids.end() ? *target->second : *child, depth + 1);
  }
  texture_kinds_[&element] = kinds;
  return kinds;
}

void SceneBuilder::check_attribute_use(const Element& shape, bool mesh) {
  if (attribute_uses_.empty()) return;
  if (!mesh)
    fail(attribute_uses_.front().where,
         "shape \"" + shape.get("type") + "\" has no mesh attributes; only obj, ply and serialized hold a mesh");
  if (texture_kinds(shape) & kUsesUv)
    fail(
        attribute_uses_.front().where,
        "a mesh_attribute together with a bitmap or checkerboard on one shape is not supported; bake the attribute into "
        "a bitmap");
}

void SceneBuilder::place_attributes(MeshJob& job, const std::vector<MeshAttribute>& attributes) {
  TriangleMesh& mesh = scene_.meshes[static_cast<std::size_t>(job.mesh)];
  const std::size_t triangles = mesh.triangles.size();
  const auto columns = static_cast<std::size_t>(std::ceil(std::sqrt(static_cast<double>(triangles))));
  const std::size_t rows = (triangles + columns - 1) / columns, width = 2 * columns, height = 2 * rows;
  ask_memory(
      width * height * sizeof(Vec3f) * job.attributes.size() + triangles * 3 * (2 * sizeof(Vec3f) + sizeof(Vec2f)),
      job.path);
  const auto corner = [&](std::size_t triangle, int c) {
    return static_cast<std::size_t>(mesh.triangles[triangle][c]);
  };
  for (const AttributeUse& use : job.attributes) {
    const auto found =
        std::find_if(attributes.begin(), attributes.end(), [&](const MeshAttribute& a) { return a.name == use.name; });
    if (found == attributes.end())
      fail(use.where, "the mesh " + job.path + (job.path.empty() ? "of this shape" : "") + " has no attribute \"" +
                          use.name + "\"");
    const bool of_faces = use.name.starts_with("face_");
    const Range range = range_of(use.role);
    const auto value = [&](std::size_t index) {
      const float* v = found->values.data() + index * static_cast<std::size_t>(found->channels);
      Vec3f color = found->channels == 1 ? Vec3f(v[0]) : Vec3f(v[0], v[1], v[2]);
      if (use.srgb) {
        for (int c = 0; c < 3; ++c) color[c] = decode_srgb(found->bytes ? color[c] / 255.0f : color[c]);
      }
      color = color * use.scale;
      if (is_scalar(use.role)) color = Vec3f(found->channels == 1 ? color.x : luminance(color));
      for (int c = 0; c < 3; ++c) {
        if (!range.holds(color[c], range.high <= 1.0f ? 1e-3f : 0.0f))
          fail(use.where, "the attribute \"" + use.name + "\" of " + job.path + " has the value " +
                              number_text(color[c]) + ": " + range.text +
                              (color[c] > 1.0f && color[c] <= 255.0f
                                   ? "; bytes become that with <float name=\"scale\" value=\"0.003921569\"/>"
                                   : ""));
      }
      return color;
    };
    Texture& t = scene_.textures[static_cast<std::size_t>(use.texture)];
    t.width = static_cast<int>(width);
    t.height = static_cast<int>(height);
    t.pixels.assign(width * height, Vec3f(0.0f));
    for (std::size_t i = 0; i < triangles; ++i) {
      Vec3f v[3];
      for (int c = 0; c < 3; ++c) v[c] = value(of_faces ? i : corner(i, c));
      const Corners corners = corners_of(mesh, mesh.triangles[i]);
      for (std::size_t k = 0; k < 4; ++k) {
        double second = 0.0, third = 0.0;
        corners.barycentric(static_cast<double>(k % 2), static_cast<double>(k / 2), second, third);
        t.pixels[(2 * (i / columns) + k / 2) * width + 2 * (i % columns) + k % 2] =
            of_faces ? v[0]
                     : v[0] + (v[1] - v[0]) * static_cast<float>(second) + (v[2] - v[0]) * static_cast<float>(third);
      }
    }
  }
  TriangleMesh apart;
  apart.flip_normals = mesh.flip_normals;
  apart.flat = mesh.flat;
  apart.one_sided = mesh.one_sided;
  for (std::size_t i = 0; i < triangles; ++i) {
    const auto x = static_cast<float>(2 * (i % columns)), y = static_cast<float>(2 * (i / columns));
    const auto first = static_cast<int>(apart.positions.size());
    const Corners corners = corners_of(mesh, mesh.triangles[i]);
    for (int c = 0; c < 3; ++c) {
      apart.positions.push_back(mesh.positions[corner(i, c)]);
      if (!mesh.normals.empty()) apart.normals.push_back(mesh.normals[corner(i, c)]);
      apart.uvs.push_back({(x + 0.5f + static_cast<float>(corners.x[c])) / static_cast<float>(width),
                           (y + 0.5f + static_cast<float>(corners.y[c])) / static_cast<float>(height)});
    }
    apart.triangles.push_back({first, first + 1, first + 2});
  }
  mesh = std::move(apart);
}

}  // namespace octrad
