#include "octrad/scene/pbrt/shape.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>

#include "octrad/base/input_file.h"
#include "octrad/base/memory_limit.h"
#include "octrad/scene/limits.h"

namespace octrad {
namespace {

// `count` numbers an element.
std::size_t elements(const PbrtParameter& p, std::size_t count) {
  if (p.numbers.empty() || p.numbers.size() % count != 0)
    fail(p.where, "the parameter \"" + p.name + "\" must hold " + std::to_string(count) + " numbers for each element");
  if (p.numbers.size() / count > kMostMeshElements) fail(p.where, "the mesh is too large");
  return p.numbers.size() / count;
}

std::vector<Vec3f> vectors(const PbrtParameter& p) {
  std::vector<Vec3f> result(elements(p, 3));
  ask_memory(result.size() * sizeof(Vec3f), p.where.file->name());
  for (std::size_t i = 0; i < result.size(); ++i) {
    const Vec3d v(p.numbers[3 * i], p.numbers[3 * i + 1], p.numbers[3 * i + 2]);
    if (!within(v, 1e30f)) fail(p.where, "a number of \"" + p.name + "\" is too large");
    result[i] = Vec3f(v);
  }
  return result;
}

const PbrtParameter& required(const PbrtObject& shape, std::string_view name,
                              std::initializer_list<const char*> types) {
  const PbrtParameter* p = shape.find(name, types);
  if (!p) fail(shape.location(), shape.what() + " needs the parameter \"" + std::string(name) + "\"");
  return *p;
}

// Positions, normals and texture coordinates of the vertices.
RawMesh vertices(const PbrtObject& shape) {
  RawMesh mesh;
  mesh.positions = vectors(required(shape, "P", {"point", "point3"}));
  if (const PbrtParameter* n = shape.find("N", {"normal", "normal3"})) {
    mesh.normals = vectors(*n);
    if (mesh.normals.size() != mesh.positions.size()) fail(n->where, "there must be as many normals as points");
  }
  for (const char* name : {"uv", "st"}) {
    const PbrtParameter* uv = mesh.uvs.empty() ? shape.find(name, {"point2", "vector2", "float"}) : nullptr;
    if (!uv) continue;
    if (elements(*uv, 2) != mesh.positions.size())
      fail(uv->where, "there must be as many texture coordinates as points");
    for (const double v : uv->numbers) {
      if (!(std::fabs(v) <= 1e30)) fail(uv->where, "a texture coordinate is too large");
    }
    for (std::size_t i = 0; i < uv->numbers.size(); i += 2)
      mesh.uvs.push_back({static_cast<float>(uv->numbers[i]), static_cast<float>(1.0 - uv->numbers[i + 1])});
  }
  return mesh;
}

// The indices of corners, `corners` a face; where there are none, those of one face.
std::vector<int> corner_indices(const PbrtObject& shape, std::size_t corners, std::size_t points) {
  std::vector<int> result;
  const PbrtParameter* p = shape.find("indices", {"integer"});
  if (!p) {
    if (points != corners) fail(shape.location(), shape.what() + " needs the parameter \"indices\"");
    for (std::size_t i = 0; i < corners; ++i) result.push_back(static_cast<int>(i));
    return result;
  }
  elements(*p, corners);
  ask_memory(p->numbers.size() * sizeof(int), p->where.file->name());
  for (const double index : p->numbers) {
    if (!(index >= 0.0 && index < static_cast<double>(points) && index == std::floor(index)))
      fail(p->where, "an index of a vertex is out of range: there are " + std::to_string(points) + " points");
    result.push_back(static_cast<int>(index));
  }
  return result;
}

RawMesh triangles(const PbrtObject& shape) {
  RawMesh mesh = vertices(shape);
  const std::vector<int> corners = corner_indices(shape, 3, mesh.positions.size());
  for (std::size_t i = 0; i < corners.size(); i += 3)
    mesh.triangles.push_back({corners[i], corners[i + 1], corners[i + 2]});
  return mesh;
}

// At the end of `to`, at `uv`, whose v runs down.
void copy_vertex(RawMesh& to, const RawMesh& from, int vertex, Vec2f uv) {
  const auto i = static_cast<std::size_t>(vertex);
  to.positions.push_back(from.positions[i]);
  if (!from.normals.empty()) to.normals.push_back(from.normals[i]);
  to.uvs.push_back(uv);
}

// Two triangles a patch, whose corners are at (0,0), (1,0), (0,1) and (1,1).
RawMesh patches(const PbrtObject& shape) {
  RawMesh mesh = vertices(shape);
  const std::vector<int> corners = corner_indices(shape, 4, mesh.positions.size());
  if (mesh.uvs.empty()) {  // each patch has its own
    RawMesh apart;
    ask_memory(corners.size() * (2 * sizeof(Vec3f) + sizeof(Vec2f) + 2 * sizeof(Vec3i)), "a bilinearmesh");
    for (const int corner : corners) {
      const std::size_t k = apart.positions.size() % 4;
      copy_vertex(apart, mesh, corner, {k % 2 ? 1.0f : 0.0f, k / 2 ? 0.0f : 1.0f});
    }
    for (int i = 0; i + 3 < static_cast<int>(apart.positions.size()); i += 4) {
      apart.triangles.push_back({i, i + 1, i + 3});
      apart.triangles.push_back({i, i + 3, i + 2});
    }
    return apart;
  }
  for (std::size_t i = 0; i < corners.size(); i += 4) {
    mesh.triangles.push_back({corners[i], corners[i + 1], corners[i + 3]});
    mesh.triangles.push_back({corners[i], corners[i + 3], corners[i + 2]});
  }
  return mesh;
}

// A line in cylindrical coordinates (radius, z, angle), turned about the z axis; v, pbrt's, goes with the line.
using Line = std::vector<std::array<double, 3>>;

RawMesh revolve(const Line& line, double phi_max) {
  constexpr int kSegments = 256;
  RawMesh mesh;
  const auto rows = static_cast<int>(line.size());
  const auto point = [&](int k, double phi) {
    const auto& p = line[static_cast<std::size_t>(std::clamp(k, 0, rows - 1))];
    return Vec3d(p[0] * std::cos(phi + p[2]), p[0] * std::sin(phi + p[2]), p[1]);
  };
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i <= kSegments; ++i) {
      const double u = static_cast<double>(i) / kSegments, phi = u * phi_max,
                   here = line[static_cast<std::size_t>(j)][2];
      const Vec3d around(-std::sin(phi + here), std::cos(phi + here), 0.0),
          normal = cross(around, point(j + 1, phi) - point(j - 1, phi));
      mesh.positions.push_back(Vec3f(point(j, phi)));
      mesh.normals.push_back(Vec3f(length(normal) > 0.0 ? normalize(normal) : Vec3d(0, 0, 1)));
      mesh.uvs.push_back({static_cast<float>(u), static_cast<float>(1.0 - static_cast<double>(j) / (rows - 1))});
      if (i == kSegments || j + 1 == rows) continue;
      const int a = j * (kSegments + 1) + i, b = a + 1, d = a + kSegments + 1, e = d + 1;
      if (line[static_cast<std::size_t>(j)][0] > 0.0) mesh.triangles.push_back({a, b, e});
      if (line[static_cast<std::size_t>(j) + 1][0] > 0.0) mesh.triangles.push_back({a, e, d});
    }
  }
  return mesh;
}

RawMesh quadric(const PbrtObject& shape) {
  const std::string& type = shape.type();
  const double phi_max = shape.number("phimax", 360.0, 1e-3, 360.0) * std::numbers::pi / 180.0,
               radius = shape.number("radius", 1.0, 1e-9, 1e9);
  Line line;
  if (type == "disk") {
    const double inner = shape.number("innerradius", 0.0, 0.0, radius), z = shape.number("height", 0.0);
    line = {{radius, z, 0.0}, {inner, z, 0.0}};
  } else if (type == "cylinder") {
    const double a = shape.number("zmin", -1.0), b = shape.number("zmax", 1.0);
    line = {{radius, std::min(a, b), 0.0}, {radius, std::max(a, b), 0.0}};
  } else if (type == "cone") {
    line = {{radius, 0.0, 0.0}, {0.0, shape.number("height", 1.0), 0.0}};
  } else if (type == "hyperboloid") {
    const Vec3d from = shape.point("p1", {0, 0, 0}), to = shape.point("p2", {1, 1, 1});
    constexpr int kRows = 64;
    for (int j = 0; j <= kRows; ++j) {
      const Vec3d p = from + (to - from) * (static_cast<double>(j) / kRows);
      line.push_back({std::sqrt(p.x * p.x + p.y * p.y), p.z, std::atan2(p.y, p.x)});
    }
  } else if (type == "paraboloid") {
    const double low = std::max(shape.number("zmin", 0.0), 0.0), high = shape.number("zmax", 1.0, 1e-9, 1e9);
    constexpr int kRows = 64;
    for (int j = 0; j <= kRows; ++j) {
      const double z = low + (high - low) * j / kRows;
      line.push_back({radius * std::sqrt(z / high), z, 0.0});
    }
  } else {
    const double low = std::clamp(shape.number("zmin", -radius), -radius, radius),
                 high = std::clamp(shape.number("zmax", radius), -radius, radius);
    const double from = std::acos(std::min(low, high) / radius), to = std::acos(std::max(low, high) / radius);
    constexpr int kRows = 128;
    for (int j = 0; j <= kRows; ++j) {
      const double theta = from + (to - from) * j / kRows;
      line.push_back({std::max(radius * std::sin(theta), 0.0), radius * std::cos(theta), 0.0});
    }
    if (from > std::numbers::pi - 1e-6) line.front()[0] = 0.0;
    if (to < 1e-6) line.back()[0] = 0.0;
  }
  RawMesh mesh = revolve(line, phi_max);
  if (mesh.triangles.empty()) fail(shape.location(), shape.what() + " has no area");
  return mesh;
}

}  // namespace

bool is_quadric(const std::string& type) {
  return type == "sphere" || type == "disk" || type == "cylinder" || type == "cone" || type == "paraboloid" ||
         type == "hyperboloid";
}

std::optional<RawMesh> pbrt_mesh(const PbrtObject& shape, double& subdivided) {
  const std::string& type = shape.type();
  if (type == "trianglemesh") return triangles(shape);
  if (type == "bilinearmesh") return patches(shape);
  if (type == "loopsubdiv") {
    RawMesh mesh = triangles(shape);
    shape.ignore({"scheme"});
    const char* name = shape.has("nlevels") ? "nlevels" : "levels";
    const double levels = std::floor(shape.number(name, 3.0, 0.0, 10.0));
    subdivided += static_cast<double>(mesh.triangles.size()) * std::exp2(2.0 * levels);
    constexpr double kMostSubdivided = 2e6;
    if (subdivided > kMostSubdivided)
      fail(shape.location(),
           "the subdivision surfaces of the scene have more than 2 million triangles; give fewer levels");
    return subdivide_loop(std::move(mesh), static_cast<int>(levels));
  }
  if (is_quadric(type)) return quadric(shape);
  return std::nullopt;
}

Curves pbrt_curves(const PbrtObject& shape, const Transform& to_world, SceneReport& report) {
  const std::vector<Vec3f> points = vectors(required(shape, "P", {"point", "point3"}));
  const std::string basis = shape.text("basis", "bezier"), type = shape.text("type", "flat");
  const auto degree = static_cast<std::size_t>(shape.number("degree", 3.0, 2.0, 3.0));
  if (basis != "bezier" && basis != "bspline")
    fail(shape.where("basis"), "the basis of a curve is bezier or bspline, not \"" + basis + "\"");
  if (type != "cylinder") report.assume(shape.location(), "curves of pbrt, flat ones and ribbons too, are round");
  shape.ignore({"N", "splitdepth"});
  const bool spline = basis == "bspline";
  const std::size_t step = spline ? 1 : degree, extra = spline ? degree : 1;
  if (points.size() < degree + 1 || (points.size() - extra) % step != 0)
    fail(shape.where("P"),
         std::to_string(points.size()) + " points do not make curves of the degree " + std::to_string(degree));
  const double width = shape.number("width", 1.0, 0.0), width0 = shape.number("width0", width, 0.0),
               width1 = shape.number("width1", width, 0.0), scale = std::cbrt(std::fabs(to_world.determinant()));
  const std::size_t segments = (points.size() - extra) / step;
  ask_memory(segments * (8 * sizeof(CurvePoint)), "curves");
  Curves curves;
  for (std::size_t s = 0; s < segments; ++s) {
    std::array<Vec3d, 4> p;
    for (std::size_t k = 0; k <= degree; ++k) p[k] = to_world.point(Vec3d(points[s * step + k]));
    if (spline && degree == 2) {  // three control points of a quadratic B-spline as Bezier's
      p = {(p[0] + p[1]) * 0.5, p[1], (p[1] + p[2]) * 0.5, p[3]};
    }
    if (degree == 2) p = {p[0], p[0] * (1.0 / 3.0) + p[1] * (2.0 / 3.0), p[1] * (2.0 / 3.0) + p[2] * (1.0 / 3.0), p[2]};
    // The same cubic by the control points of a uniform B-spline.
    if (!spline || degree == 2) {
      p = {p[0] * 6.0 - p[1] * 7.0 + p[2] * 2.0, p[1] * 2.0 - p[2], p[2] * 2.0 - p[1],
           p[1] * 2.0 - p[2] * 7.0 + p[3] * 6.0};
    }
    std::vector<CurvePoint> curve(4);
    for (std::size_t k = 0; k < 4; ++k) {
      // A B-spline of a linear function has its values, at -1, 0, 1 and 2 of the segment, as control points.
      const double u = (static_cast<double>(s) + static_cast<double>(k) - 1.0) / static_cast<double>(segments);
      curve[k] = {p[k], std::max(0.5 * scale * (width0 + (width1 - width0) * u), 0.0)};
      if (!within(p[k], kLargestCoordinate) || !(curve[k].radius <= static_cast<double>(kLargestCoordinate)))
        fail(shape.location(), "the curve is too large or too far away: coordinates may be up to 1e9");
    }
    curves.push_back(std::move(curve));
  }
  return curves;
}

RawMesh read_pbrt_ply(const std::string& file) {
  constexpr std::uint64_t kMostBytes = std::uint64_t{64} << 30;
  RawMesh mesh = parse_ply(file, read_pbrt_file(file, kMostBytes, "ply"));
  for (Vec2f& uv : mesh.uvs) uv.y = 1.0f - uv.y;
  return mesh;
}

std::set<std::string> ply_properties(const std::string& file) {
  const InputFile input(file);
  std::string head(static_cast<std::size_t>(std::min<std::uint64_t>(input.size(), 1 << 16)), '\0');
  input.read(head.data(), head.size(), 0);
  head.resize(std::min(head.find("end_header"), head.size()));
  std::set<std::string> names;
  for (std::size_t at = head.find("\nproperty"); at != std::string::npos; at = head.find("\nproperty", at + 1)) {
    const std::string line = head.substr(at + 1, head.find_first_of("\r\n", at + 1) - at - 1);
    names.insert(line.substr(line.rfind(' ') + 1));
  }
  return names;
}

RawMesh with_own_uvs(const RawMesh& mesh) {
  RawMesh apart;
  ask_memory(mesh.triangles.size() * 3 * (2 * sizeof(Vec3f) + sizeof(Vec2f) + 4), "a mesh");
  for (const Vec3i& t : mesh.triangles) {
    const auto first = static_cast<int>(apart.positions.size());
    for (int k = 0; k < 3; ++k) copy_vertex(apart, mesh, t[k], {k > 0 ? 1.0f : 0.0f, k > 1 ? 0.0f : 1.0f});
    apart.triangles.push_back({first, first + 1, first + 2});
  }
  return apart;
}

double mesh_area(const RawMesh& mesh, const Transform& to_world) {
  double sum = 0.0;
  for (const Vec3i& t : mesh.triangles) {
    Vec3d p[3];
    for (int k = 0; k < 3; ++k) p[k] = to_world.point(Vec3d(mesh.positions[static_cast<std::size_t>(t[k])]));
    sum += 0.5 * length(cross(p[1] - p[0], p[2] - p[0]));
  }
  return sum;
}

namespace {

struct Edge {
  int opposite[2] = {-1, -1}, faces = 0, point = -1;
};
using Edges = std::map<std::pair<int, int>, Edge>;

Edge& edge_of(Edges& edges, int a, int b) { return edges[{std::min(a, b), std::max(a, b)}]; }

Edges edges_of(const RawMesh& mesh) {
  // An edge and what is summed about its ends: about 300 bytes.
  ask_memory(mesh.triangles.size() * 1000, "a subdivision surface");
  Edges edges;
  for (const Vec3i& t : mesh.triangles) {
    for (int k = 0; k < 3; ++k) {
      Edge& e = edge_of(edges, t[k], t[(k + 1) % 3]);
      if (e.faces < 2) e.opposite[e.faces] = t[(k + 2) % 3];
      ++e.faces;
    }
  }
  return edges;
}

double loop_beta(int valence) { return valence == 3 ? 3.0 / 16.0 : valence > 0 ? 3.0 / (8.0 * valence) : 0.0; }

// Each vertex moved towards its neighbours: by beta, or on the boundary by `border`, each; `to_limit`: by 1 / (n + 3 /
// (8 beta)) instead of beta.
std::vector<Vec3f> moved_vertices(const RawMesh& mesh, const Edges& edges, double border, bool to_limit) {
  const std::size_t count = mesh.positions.size();
  const auto position = [&](int i) { return Vec3d(mesh.positions[static_cast<std::size_t>(i)]); };
  std::vector<Vec3d> around(count, Vec3d(0.0)), along(count, Vec3d(0.0));  // sums of neighbours, on the boundary too
  std::vector<int> valence(count, 0), borders(count, 0);
  for (const auto& [ends, e] : edges) {
    for (const auto& [a, b] : {ends, std::pair(ends.second, ends.first)}) {
      const auto i = static_cast<std::size_t>(a);
      around[i] += position(b);
      ++valence[i];
      if (e.faces == 2) continue;
      along[i] += position(b);
      ++borders[i];
    }
  }
  std::vector<Vec3f> moved(count);
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3d p = position(static_cast<int>(i));
    const int n = valence[i];
    const double beta = n == 0 ? 0.0 : to_limit ? 1.0 / (n + 3.0 / (8.0 * loop_beta(n))) : loop_beta(n);
    moved[i] = Vec3f(borders[i] == 2  ? p * (1.0 - 2.0 * border) + along[i] * border
                     : borders[i] > 0 ? p
                                      : p * (1.0 - n * beta) + around[i] * beta);
  }
  return moved;
}

}  // namespace

RawMesh subdivide_loop(RawMesh mesh, int levels) {
  mesh.normals.clear();
  mesh.uvs.clear();
  for (int level = 0; level < levels; ++level) {
    if (mesh.triangles.size() > kMostMeshElements / 4) throw InputError("the subdivided mesh is too large");
    Edges edges = edges_of(mesh);
    std::vector<Vec3f> positions = moved_vertices(mesh, edges, 0.125, false);
    const auto position = [&](int i) { return Vec3d(mesh.positions[static_cast<std::size_t>(i)]); };
    for (auto& [ends, e] : edges) {
      const Vec3d middle = position(ends.first) + position(ends.second);
      e.point = static_cast<int>(positions.size());
      positions.push_back(Vec3f(
          e.faces == 2 ? middle * 0.375 + (position(e.opposite[0]) + position(e.opposite[1])) * 0.125 : middle * 0.5));
    }
    std::vector<Vec3i> finer;
    finer.reserve(4 * mesh.triangles.size());
    for (const Vec3i& t : mesh.triangles) {
      const int a = edge_of(edges, t[0], t[1]).point, b = edge_of(edges, t[1], t[2]).point,
                c = edge_of(edges, t[2], t[0]).point;
      finer.push_back({t[0], a, c});
      finer.push_back({a, t[1], b});
      finer.push_back({c, b, t[2]});
      finer.push_back({a, b, c});
    }
    mesh.positions = std::move(positions);
    mesh.triangles = std::move(finer);
  }
  mesh.positions = moved_vertices(mesh, edges_of(mesh), 0.2, true);
  for (Vec3i& t : mesh.triangles) std::swap(t.y, t.z);
  mesh.normals = smooth_normals(mesh.positions, mesh.triangles);
  return mesh;
}

}  // namespace octrad
