#include <algorithm>
#include <array>
#include <optional>

#include "octrad/base/error.h"
#include "octrad/base/memory_limit.h"
#include "octrad/scene/gltf/reader.h"

namespace octrad {
namespace {

enum Mode { kPoints, kLines, kLineLoop, kLineStrip, kTriangles, kStrip, kFan };

std::vector<Vec3f> vectors(const GltfValues& v) {
  std::vector<Vec3f> result(v.count);
  const auto n = static_cast<std::size_t>(v.components);
  for (std::size_t i = 0; i < v.count; ++i) result[i] = {v.values[i * n], v.values[i * n + 1], v.values[i * n + 2]};
  return result;
}

// Morph targets: positions and normals plus weighted differences.
void add_targets(const GltfFile& file, const GltfObject& primitive, const GltfObject& owner, RawMesh& mesh) {
  const std::vector<GltfObject> targets = primitive.objects("targets");
  const std::vector<double> weights = owner.numbers("weights", std::vector<double>(targets.size(), 0.0));
  for (std::size_t i = 0; i < targets.size(); ++i) {
    if (weights[i] == 0.0) continue;
    const auto add = [&](const std::string& name, std::vector<Vec3f>& to) {
      const int accessor = targets[i].index(name, "accessors");
      if (accessor < 0 || to.empty()) return;
      const std::vector<Vec3f> differences = vectors(file.values(accessor, {3}));
      if (differences.size() != to.size()) targets[i].fail("has another number of " + name + " than the mesh");
      for (std::size_t k = 0; k < to.size(); ++k) to[k] += differences[k] * static_cast<float>(weights[i]);
    };
    add("POSITION", mesh.positions);
    add("NORMAL", mesh.normals);
  }
}

// Linear blend skinning: the weighted mean of where each of four joints has the vertex.
void set_pose(const GltfObject& primitive, const GltfValues& joints, const GltfValues& weights, const GltfSkin& skin,
              RawMesh& mesh) {
  if (joints.count == 0 || weights.count == 0) primitive.fail("has a skin, but no JOINTS_0 and WEIGHTS_0");
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    Vec3d position(0.0), normal(0.0);
    double sum = 0.0;
    const Vec3d p(mesh.positions[i]), n(mesh.normals.empty() ? Vec3f(0.0f) : mesh.normals[i]);
    for (std::size_t k = 4 * i; k < 4 * i + 4; ++k) {
      const auto w = static_cast<double>(weights.values[k]);
      if (!(w > 0.0)) continue;
      const float joint = joints.values[k];
      if (!(joint >= 0.0f && joint < static_cast<float>(skin.joints.size())))
        primitive.fail("vertex " + std::to_string(i) + " has a joint that the skin has not");
      const auto j = static_cast<std::size_t>(joint);
      sum += w;
      position += skin.joints[j].point(p) * w;
      const GltfNormalMatrix& m = skin.normals[j];
      normal += Vec3d(m[0] * n.x + m[1] * n.y + m[2] * n.z, m[3] * n.x + m[4] * n.y + m[5] * n.z,
                      m[6] * n.x + m[7] * n.y + m[8] * n.z) *
                w;
    }
    if (!(sum > 0.0)) continue;  // hangs on no joint: stays where it is
    mesh.positions[i] = Vec3f(position / sum);
    if (!mesh.normals.empty()) mesh.normals[i] = Vec3f(normal / sum);
  }
}

// Primitives may share one list of vertices, of which each needs a few. `colors`: with that many channels.
void drop_unused_vertices(RawMesh& mesh, std::vector<float>* colors = nullptr, std::size_t channels = 0) {
  std::vector<int> place(mesh.positions.size(), -1);
  for (const Vec3i& t : mesh.triangles) {
    for (int i = 0; i < 3; ++i) place[static_cast<std::size_t>(t[i])] = 0;
  }
  std::size_t count = 0;
  const auto keep = [](auto& values, std::size_t width, std::size_t from, std::size_t to) {
    if (!values.empty())
      std::copy_n(values.begin() + static_cast<std::ptrdiff_t>(from * width), width,
                  values.begin() + static_cast<std::ptrdiff_t>(to * width));
  };
  for (std::size_t i = 0; i < place.size(); ++i) {
    if (place[i] < 0) continue;
    keep(mesh.positions, 1, i, count);
    keep(mesh.normals, 1, i, count);
    keep(mesh.uvs, 1, i, count);
    for (MeshAttribute& a : mesh.attributes) keep(a.values, static_cast<std::size_t>(a.channels), i, count);
    if (colors) keep(*colors, channels, i, count);
    place[i] = static_cast<int>(count++);
  }
  const auto cut = [count](auto& values, std::size_t width) {
    if (values.empty()) return;
    values.resize(count * width);
    values.shrink_to_fit();
  };
  cut(mesh.positions, 1);
  cut(mesh.normals, 1);
  cut(mesh.uvs, 1);
  for (MeshAttribute& a : mesh.attributes) cut(a.values, static_cast<std::size_t>(a.channels));
  if (colors) cut(*colors, channels);
  for (Vec3i& t : mesh.triangles) {
    for (int i = 0; i < 3; ++i) t[i] = place[static_cast<std::size_t>(t[i])];
  }
}

// Share of the triangles on which `tangents` (of the mesh's vertices, with the bitangent's side) lead elsewhere than
// the texture coordinates: by more than 60 degrees, or on the other side. v runs down the picture, green up.
double other_tangents(const RawMesh& mesh, const GltfValues& tangents) {
  if (tangents.count == 0 || mesh.uvs.empty()) return 0.0;
  std::size_t looked_at = 0, other = 0;
  for (const Vec3i& t : mesh.triangles) {
    Vec3f p[3], tangent(0.0f);
    Vec2f uv[3];
    float side = 0.0f;
    for (int i = 0; i < 3; ++i) {
      const auto v = static_cast<std::size_t>(t[i]);
      p[i] = mesh.positions[v];
      uv[i] = mesh.uvs[v];
      tangent += Vec3f(tangents.values[4 * v], tangents.values[4 * v + 1], tangents.values[4 * v + 2]);
      side += tangents.values[4 * v + 3];
    }
    const Vec2f a = {uv[1].x - uv[0].x, uv[1].y - uv[0].y}, b = {uv[2].x - uv[0].x, uv[2].y - uv[0].y};
    const float area = a.x * b.y - b.x * a.y;
    const Vec3f along_u = ((p[1] - p[0]) * b.y - (p[2] - p[0]) * a.y) * (area < 0.0f ? -1.0f : 1.0f);
    const float l = length(along_u) * length(tangent);
    if (area == 0.0f || !(l > 0.0f)) continue;
    ++looked_at;
    if (dot(along_u, tangent) < 0.5f * l || side * area > 0.0f) ++other;
  }
  return looked_at > 0 ? static_cast<double>(other) / static_cast<double>(looked_at) : 0.0;
}

}  // namespace

bool GltfMesh::one_color() const {
  const auto n = static_cast<std::size_t>(color_channels);
  for (std::size_t i = n; i < colors.size(); ++i) {
    if (colors[i] != colors[i - n]) return false;
  }
  return !colors.empty();
}

std::optional<GltfMesh> gltf_mesh(const GltfFile& file, const GltfObject& primitive, int uv_set, const GltfPose& pose,
                                  bool mapped) {
  const int mode = primitive.integer("mode", kTriangles, kPoints, kFan);
  if (mode < kTriangles) return std::nullopt;
  const GltfObject attributes = primitive.object("attributes");
  const auto read = [&](const std::string& name, std::vector<int> components, std::size_t count) {
    const int accessor = attributes.index(name, "accessors");
    GltfValues values;
    if (accessor >= 0) values = file.values(accessor, std::move(components));
    if (accessor >= 0 && count > 0 && values.count != count) {
      primitive.fail("has " + std::to_string(values.count) + " of " + name + ", but " + std::to_string(count) +
                     " positions");
    }
    return values;
  };
  RawMesh mesh;
  mesh.positions = vectors(read("POSITION", {3}, 0));
  const std::size_t count = mesh.positions.size();
  if (count == 0) return GltfMesh();
  mesh.normals = vectors(read("NORMAL", {3}, count));
  add_targets(file, primitive, pose.weights, mesh);
  if (pose.skin) set_pose(primitive, read("JOINTS_0", {4}, count), read("WEIGHTS_0", {4}, count), *pose.skin, mesh);
  const GltfValues uvs = read("TEXCOORD_" + std::to_string(uv_set), {2, 3}, count);
  const auto width = static_cast<std::size_t>(uvs.components);  // 3 of some writers, of which two count
  for (std::size_t i = 0; i < uvs.count; ++i) mesh.uvs.push_back({uvs.values[width * i], uvs.values[width * i + 1]});
  GltfValues colors = read("COLOR_0", {3, 4}, count);
  for (float& value : colors.values) value = std::clamp(value, 0.0f, 1.0f);

  std::vector<std::uint32_t> order;
  if (const int accessor = primitive.index("indices", "accessors"); accessor >= 0) {
    order = file.indices(accessor);
    for (const std::uint32_t i : order) {
      if (i >= count)
        primitive.fail("index " + std::to_string(i) + " is beyond its " + std::to_string(count) + " vertices");
    }
  } else {
    ask_memory(count * sizeof(std::uint32_t), file.name());
    order.resize(count);
    for (std::size_t i = 0; i < count; ++i) order[i] = static_cast<std::uint32_t>(i);
  }
  // What is left over of a triangle counts for nothing.
  const std::size_t triangles = order.size() < 3 ? 0 : mode == kTriangles ? order.size() / 3 : order.size() - 2;
  ask_memory(triangles * sizeof(Vec3i), file.name());
  mesh.triangles.reserve(triangles);
  for (std::size_t i = 0; i < triangles; ++i) {
    // Of a strip every second one is turned; of a fan all begin at the first corner.
    const std::size_t a = mode == kTriangles ? 3 * i
                          : mode == kFan     ? i + 1
                                             : i,
                      b = mode == kStrip ? i + 1 + i % 2 : a + 1, c = mode == kStrip ? i + 2 - i % 2 : a + 2;
    const std::size_t corners[3] = {a, b, mode == kFan ? 0 : c};
    Vec3i triangle;
    for (int k = 0; k < 3; ++k) triangle[k] = static_cast<int>(order[corners[k]]);
    mesh.triangles.push_back(triangle);
  }
  double turned = 0.0;
  if (mapped && !pose.skin) {
    try {
      turned = other_tangents(mesh, read("TANGENT", {4}, count));
    } catch (const InputError&) {  // nothing needs them
    }
  }
  drop_unused_vertices(mesh, &colors.values, static_cast<std::size_t>(colors.components));
  return GltfMesh{std::move(mesh), colors.components, std::move(colors.values), turned};
}

bool is_closed(const RawMesh& mesh) {
  // Vertices at one place count as one: their normals and texture coordinates may differ.
  const std::size_t n = mesh.positions.size();
  ask_memory(2 * n * sizeof(int) + mesh.triangles.size() * 6 * sizeof(std::pair<int, int>), "a mesh");
  std::vector<int> order(n), place(n);
  for (std::size_t i = 0; i < n; ++i) order[i] = static_cast<int>(i);
  const auto position = [&](int i) {
    const Vec3f& p = mesh.positions[static_cast<std::size_t>(i)];
    return std::array<float, 3>{p.x, p.y, p.z};
  };
  std::sort(order.begin(), order.end(), [&](int a, int b) { return position(a) < position(b); });
  for (std::size_t i = 0; i < n; ++i) {
    const bool same = i > 0 && position(order[i]) == position(order[i - 1]);
    place[static_cast<std::size_t>(order[i])] =
        same ? place[static_cast<std::size_t>(order[i - 1])] : static_cast<int>(i);
  }
  std::vector<std::pair<int, int>> edges, back;
  for (const Vec3i& t : mesh.triangles) {
    for (int k = 0; k < 3; ++k) {
      const int a = place[static_cast<std::size_t>(t[k])], b = place[static_cast<std::size_t>(t[(k + 1) % 3])];
      if (a == b) continue;
      edges.emplace_back(a, b);
      back.emplace_back(b, a);
    }
  }
  std::sort(edges.begin(), edges.end());
  std::sort(back.begin(), back.end());
  return edges == back;
}

RawMesh take_mirrored(RawMesh& mesh) {
  RawMesh mirrored;
  if (mesh.uvs.empty()) return mirrored;
  const auto is_mirrored = [&](const Vec3i& t) {
    Vec2f uv[3];
    for (int i = 0; i < 3; ++i) uv[i] = mesh.uvs[static_cast<std::size_t>(t[i])];
    return (uv[1].x - uv[0].x) * (uv[2].y - uv[0].y) - (uv[2].x - uv[0].x) * (uv[1].y - uv[0].y) > 0.0f;
  };
  const auto first = std::stable_partition(mesh.triangles.begin(), mesh.triangles.end(),
                                           [&](const Vec3i& t) { return !is_mirrored(t); });
  if (first == mesh.triangles.end()) return mirrored;
  mirrored.positions = mesh.positions;
  mirrored.normals = mesh.normals;
  mirrored.uvs = mesh.uvs;
  mirrored.attributes = mesh.attributes;
  mirrored.triangles.assign(first, mesh.triangles.end());
  mesh.triangles.erase(first, mesh.triangles.end());
  drop_unused_vertices(mesh);
  drop_unused_vertices(mirrored);
  return mirrored;
}

}  // namespace octrad
