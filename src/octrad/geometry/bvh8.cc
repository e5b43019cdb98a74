#include "octrad/geometry/bvh8.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>

#include "octrad/base/error.h"
#include "octrad/base/memory_limit.h"
#include "octrad/base/threads.h"
#include "octrad/geometry/bvh2.h"
#include "octrad/geometry/primitives.h"
#include "octrad/geometry/shape_view.h"

namespace octrad {
namespace {

constexpr std::size_t kTriangleBlock = 4096;
constexpr std::uint64_t kBuildBytes =
    sizeof(BvhReference) + sizeof(Bvh2Node) + sizeof(Bvh8Primitive) + 32;  // a triangle

// ---- References ----------------------------------------------------------------------------------------------------

bool fits(const float* p) {
  bool inside = true;
  for (int k = 0; k < 3; ++k) inside = inside && std::fabs(p[k]) <= kBvh8Largest;  // false for NaN
  return inside;
}

BvhReference triangle_reference(const MeshView& mesh, int shape, std::size_t i) {
  const Vec3i t = mesh.triangles[i];
  const Vec3f a = mesh_position(mesh, t.x), b = mesh_position(mesh, t.y), c = mesh_position(mesh, t.z);
  const Vec3f lower = min(a, min(b, c)), upper = max(a, max(b, c));
  const bool valid = fits(&a.x) && fits(&b.x) && fits(&c.x);
  return {{lower.x, lower.y, lower.z}, valid ? shape : -1, {upper.x, upper.y, upper.z}, static_cast<std::int32_t>(i)};
}

BvhReference sphere_reference(const Sphere& sphere, int shape) {
  const Bounds3f b = sphere_bounds(sphere.center, sphere.radius);
  const bool valid = fits(&b.lower.x) && fits(&b.upper.x) && sphere.radius >= 0.0f;
  return {{b.lower.x, b.lower.y, b.lower.z}, valid ? shape : -1, {b.upper.x, b.upper.y, b.upper.z}, 0};
}

std::vector<BvhReference> references_of(const Scene& scene, std::size_t& left_out) {
  const std::vector<std::size_t> first = first_primitives(scene);
  if (first.back() > (std::size_t{1} << 30)) throw MemoryError("ray tracing: more than 2^30 triangles");
  // Instances are copied out: a bounded price for one kind of tree in the kernels.
  if (!scene.placements.empty())
    ask_memory(first.back() * kBuildBytes, scene.file + ": the tree over the triangles of all instances");
  std::vector<BvhReference> references(first.back());
  for (std::size_t i = 0; i < scene.shapes.size(); ++i) {
    const Shape& shape = scene.shapes[i];
    const auto geometry = static_cast<std::size_t>(shape.geometry);
    BvhReference* out = references.data() + first[i];
    if (shape.kind == Shape::Kind::sphere) {
      *out = sphere_reference(scene.spheres[geometry], static_cast<int>(i));
      continue;
    }
    const TriangleMesh& mesh = scene.meshes[geometry];
    const MeshView view = shape_view(scene, i).mesh;
    parallel_blocks(mesh.triangles.size(), kTriangleBlock, [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k) out[k] = triangle_reference(view, static_cast<int>(i), k);
    });
  }
  left_out = std::erase_if(references, [](const BvhReference& r) { return r.shape < 0; });
  return references;
}

Bvh8Primitive primitive_of(const Scene& scene, const BvhReference& r) {
  Bvh8Primitive p{};
  p.rows[0].id = static_cast<std::uint32_t>(r.shape);
  p.rows[1].id = static_cast<std::uint32_t>(r.primitive);
  const Shape& shape = scene.shapes[static_cast<std::size_t>(r.shape)];
  const auto geometry = static_cast<std::size_t>(shape.geometry);
  if (shape.kind == Shape::Kind::sphere) {
    const Sphere& s = scene.spheres[geometry];
    for (int axis = 0; axis < 3; ++axis) {
      p.rows[axis].id |= kBvh8Sphere;
      p.rows[axis].corner[0] = s.center[axis];
      p.rows[axis].corner[1] = s.radius;
    }
    return p;
  }
  const MeshView mesh = shape_view(scene, static_cast<std::size_t>(r.shape)).mesh;
  if (scene.meshes[geometry].one_sided) {
    for (Bvh8Row& row : p.rows) row.id |= kBvh8OneSided;
    if (mesh.placement != nullptr && mesh.placement->mirrors) p.rows[2].id |= 1u;
  }
  const Vec3i t = mesh.triangles[r.primitive];
  for (int k = 0; k < 3; ++k) {
    const Vec3f corner = mesh_position(mesh, t[k]);
    for (int axis = 0; axis < 3; ++axis) p.rows[axis].corner[k] = corner[axis];
  }
  return p;
}

// ---- Collapse ------------------------------------------------------------------------------------------------------

// A subtree of the binary tree: references [first, first + count); with more than one, its node.
struct Subtree {
  std::uint32_t node = 0, first = 0, count = 0;
};

// A wide node before its index is known: children by slot, and which are leaves.
struct WideNode {
  Subtree self;
  Subtree child[8];              // count 0: empty
  std::uint8_t inner = 0;        // slots that are nodes
  std::uint32_t primitives = 0;  // of all leaves
};

class Collapse {
 public:
  Collapse(const std::vector<BvhReference>& references, const Bvh2& tree) : references_(references), tree_(tree) {}

  WideNode open(Subtree self) const {
    WideNode wide;
    wide.self = self;
    Subtree children[8];
    int n = 0;
    if (self.count == 1 || leaf(self)) {
      children[n++] = self;  // only a root: a scene of a few primitives
    } else {
      divide(self, 8, children, n);
    }
    place(self, children, n, wide);
    for (int s = 0; s < 8; ++s) {
      const Subtree& c = wide.child[s];
      if (c.count == 0) continue;
      if (leaf(c)) {
        wide.primitives += c.count;
      } else {
        wide.inner = static_cast<std::uint8_t>(wide.inner | (1u << s));
      }
    }
    return wide;
  }

  bool leaf(const Subtree& t) const { return t.count == 1 || tree_.nodes[t.node].leaf != 0; }

  const float* lower(const Subtree& t) const {
    return t.count == 1 ? references_[t.first].lower : tree_.nodes[t.node].lower;
  }
  const float* upper(const Subtree& t) const {
    return t.count == 1 ? references_[t.first].upper : tree_.nodes[t.node].upper;
  }

 private:
  void costs(const Subtree& t, float* out) const {
    if (t.count > 1) {
      std::copy_n(tree_.nodes[t.node].cost, 7, out);
    } else {
      std::fill_n(out, 7, kBvhPrimitiveCost * bvh_area(lower(t), upper(t), tree_.scale));
    }
  }

  // The subtrees that the two sides of `t` become in at most `slots` slots.
  void divide(const Subtree& t, int slots, Subtree* out, int& n) const {
    const std::uint32_t left_count = tree_.nodes[t.node].left_count;
    const Subtree left{t.node + 1, t.first, left_count},
        right{t.node + left_count, t.first + left_count, t.count - left_count};
    float left_costs[7], right_costs[7];
    costs(left, left_costs);
    costs(right, right_costs);
    const int share = distribute(left_costs, right_costs, slots).left_slots;
    take(left, share, out, n);
    take(right, slots - share, out, n);
  }

  void take(const Subtree& t, int slots, Subtree* out, int& n) const {
    if (t.count > 1) {
      const float* cost = tree_.nodes[t.node].cost;
      while (slots > 1 && !(cost[slots - 1] < cost[slots - 2])) --slots;  // as cheap with fewer
    }
    if (slots == 1 || t.count == 1) {
      out[n++] = t;
    } else {
      divide(t, slots, out, n);
    }
  }

  // Slot s is for the child nearest to octant s of the node (bits 0, 1, 2: x, y, z; 1: the upper side), chosen
  // greedily: a ray that visits slots in the order of s ^ octant then meets nearer children first.
  void place(const Subtree& self, const Subtree* children, int n, WideNode& wide) const {
    float offset[8][3];
    const float *l = lower(self), *u = upper(self);
    for (int i = 0; i < n; ++i) {
      const float *cl = lower(children[i]), *cu = upper(children[i]);
      for (int k = 0; k < 3; ++k) offset[i][k] = ((cl[k] - l[k]) + (cu[k] - u[k])) * tree_.scale;
    }
    unsigned placed = 0, taken = 0;
    for (int round = 0; round < n; ++round) {
      float best = -std::numeric_limits<float>::infinity();
      int best_child = -1, best_slot = -1;
      for (int i = 0; i < n; ++i) {
        if (placed >> i & 1u) continue;
        for (int s = 0; s < 8; ++s) {
          if (taken >> s & 1u) continue;
          const float gain = (s & 1 ? offset[i][0] : -offset[i][0]) + (s & 2 ? offset[i][1] : -offset[i][1]) +
                             (s & 4 ? offset[i][2] : -offset[i][2]);
          if (gain > best || best_child < 0) {
            best = gain;
            best_child = i;
            best_slot = s;
          }
        }
      }
      placed |= 1u << best_child;
      taken |= 1u << best_slot;
      wide.child[best_slot] = children[best_child];
    }
  }

  const std::vector<BvhReference>& references_;
  const Bvh2& tree_;
};

// ---- Quantisation --------------------------------------------------------------------------------------------------

// Exponent of the smallest grid of 255 steps of a power of two over [lower, upper]; 0 where there is nothing to cover.
unsigned grid_exponent(float lower, float upper) {
  const double extent = static_cast<double>(upper) - static_cast<double>(lower);
  if (!(extent > 0.0)) return 0;
  int exponent = 0;
  std::frexp(extent / 255.0, &exponent);  // extent / 255 < 2^exponent
  return static_cast<unsigned>(std::clamp(exponent + 142, 16, 254));
}

void quantise(Bvh8Node& node, const Collapse& collapse, const WideNode& wide) {
  const float *l = collapse.lower(wide.self), *u = collapse.upper(wide.self);
  node.exponents = static_cast<std::uint32_t>(wide.inner) << 24;
  for (int k = 0; k < 3; ++k) {
    node.origin[k] = l[k];
    const unsigned exponent = grid_exponent(l[k], u[k]);
    node.exponents |= exponent << (8 * k);
    const double origin = static_cast<double>(l[k]), scale = bvh8_grid_scale(exponent);
    unsigned char bytes[2][8];
    for (int s = 0; s < 8; ++s) {
      bytes[0][s] = 255;
      bytes[1][s] = 0;
      const Subtree& child = wide.child[s];
      if (child.count == 0) continue;
      const double lower = static_cast<double>(collapse.lower(child)[k]),
                   upper = static_cast<double>(collapse.upper(child)[k]);
      double low = 0.0, high = 0.0;
      if (exponent != 0) {
        low = std::clamp(std::floor((lower - origin) / scale), 0.0, 255.0);
        high = std::clamp(std::ceil((upper - origin) / scale), 0.0, 255.0);
        while (low > 0.0 && origin + low * scale > lower) low -= 1.0;
        while (high < 255.0 && origin + high * scale < upper) high += 1.0;
      }
      bytes[0][s] = static_cast<unsigned char>(low);
      bytes[1][s] = static_cast<unsigned char>(high);
    }
    std::memcpy(&node.bounds[k][0], bytes[0], 8);
    std::memcpy(&node.bounds[k][1], bytes[1], 8);
  }
}

// ---- Levels --------------------------------------------------------------------------------------------------------

// Lays out the nodes level by level: first the sizes of a level's nodes, in parallel, then their positions, in order.
// False when the tree would have too many levels.
bool place_nodes(const Scene& scene, const std::vector<BvhReference>& references, const Bvh2& tree, Bvh8& bvh) {
  const Collapse collapse(references, tree);
  std::vector<Subtree> level = {{0, 0, static_cast<std::uint32_t>(references.size())}}, next;
  std::vector<WideNode> wide;
  std::uint32_t primitive_count = 0;
  bvh.primitives.resize(references.size());
  bvh.nodes.clear();
  for (bvh.levels = 0; !level.empty(); ++bvh.levels) {
    if (bvh.levels == kBvh8StackSize) return false;
    const std::size_t first_node = bvh.nodes.size();
    bvh.nodes.resize(first_node + level.size());
    wide.resize(level.size());
    parallel_blocks(level.size(), 256, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) wide[i] = collapse.open(level[i]);
    });
    auto child_node = static_cast<std::uint32_t>(first_node + level.size());
    std::uint32_t children = 0;
    for (std::size_t i = 0; i < wide.size(); ++i) {
      Bvh8Node& node = bvh.nodes[first_node + i];
      node.child_base = child_node + children;
      node.primitive_base = primitive_count;
      children += static_cast<std::uint32_t>(std::popcount(wide[i].inner));
      primitive_count += wide[i].primitives;
    }
    next.resize(children);
    parallel_blocks(wide.size(), 256, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        Bvh8Node& node = bvh.nodes[first_node + i];
        quantise(node, collapse, wide[i]);
        std::uint32_t offset = 0, child = node.child_base - child_node;
        node.primitives = 0;
        node.one = bits_of(1.0f);
        for (int s = 0; s < 8; ++s) {
          const Subtree& c = wide[i].child[s];
          if (c.count == 0) continue;
          if (wide[i].inner >> s & 1) {
            next[child++] = c;
            continue;
          }
          node.primitives |= ((1u << c.count) - 1u) << (4 * s);
          for (std::uint32_t k = 0; k < c.count; ++k) {
            bvh.primitives[node.primitive_base + offset + k] = primitive_of(scene, references[c.first + k]);
          }
          offset += c.count;
        }
      }
    });
    level.swap(next);
  }
  return true;
}

class Bvh8Tracer final : public Tracer {
 public:
  explicit Bvh8Tracer(const Bvh8View& view) : view_(view) {}
  explicit Bvh8Tracer(Bvh8 bvh) : bvh_(std::move(bvh)), view_(bvh_.view()) {}
  using Tracer::intersect;
  using Tracer::occluded;
  Hit intersect(Vec3f origin, Vec3f direction, float t_min, float t_max) const override {
    return bvh8_intersect(view_, origin, direction, t_min, t_max);
  }
  bool occluded(Vec3f origin, Vec3f direction, float t_min, float t_max) const override {
    return bvh8_occluded(view_, origin, direction, t_min, t_max);
  }

 private:
  Bvh8 bvh_;
  Bvh8View view_;
};

}  // namespace

Bvh8 build_bvh8(const Scene& scene, const Bvh8Options& options) {
  Bvh8 bvh;
  std::vector<BvhReference> references = references_of(scene, bvh.left_out);
  bvh.one_sided = std::any_of(scene.shapes.begin(), scene.shapes.end(), [&](const Shape& shape) {
    return shape.kind == Shape::Kind::mesh && scene.meshes[static_cast<std::size_t>(shape.geometry)].one_sided;
  });
  if (references.empty()) return bvh;
  Bvh2 tree = build_bvh2(references.data(), references.size(), options.max_levels);
  bool placed = place_nodes(scene, references, tree, bvh);
  if (!placed) {
    // Rare: a very unbalanced tree. Every wide node uses up a level of the binary tree, so this one fits.
    tree = build_bvh2(references.data(), references.size(), kBvh8StackSize);
    placed = place_nodes(scene, references, tree, bvh);
  }
  if (!placed) throw std::logic_error("ray tracing: a tree of too many levels");
  if (tree.nodes)
    bvh.cost =
        static_cast<double>(tree.nodes[0].cost[0] / bvh_area(tree.nodes[0].lower, tree.nodes[0].upper, tree.scale));
  return bvh;
}

std::unique_ptr<Tracer> make_bvh8_tracer(const Bvh8View& view) { return std::make_unique<Bvh8Tracer>(view); }
std::unique_ptr<Tracer> make_bvh8_tracer(const Scene& scene) { return std::make_unique<Bvh8Tracer>(build_bvh8(scene)); }

}  // namespace octrad
