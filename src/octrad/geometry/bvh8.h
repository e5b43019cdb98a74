// The builder of the 8-wide bounding volume hierarchy that bvh8_math.h traverses on host and device.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "octrad/geometry/bvh8_math.h"
#include "octrad/geometry/tracer.h"

namespace octrad {

struct Bvh8 {
  std::vector<Bvh8Node> nodes;  // breadth first, siblings adjacent; node 0 is the root
  std::vector<Bvh8Primitive> primitives;
  int levels = 0;            // of nodes, at most kBvh8StackSize
  std::size_t left_out = 0;  // triangles and spheres that are not finite or reach further than kBvh8Largest
  bool one_sided = false;    // some triangles are
  double cost = 0.0;         // expected work of a ray that meets the root's box, in visits of nodes

  Bvh8View view() const {
    return {nodes.data(), primitives.data(), static_cast<std::uint32_t>(nodes.size()),
            static_cast<std::uint32_t>(primitives.size()), one_sided};
  }
  std::size_t bytes() const { return nodes.size() * sizeof(Bvh8Node) + primitives.size() * sizeof(Bvh8Primitive); }
};

struct Bvh8Options {
  int max_levels = 64;  // of the binary tree before it is split at medians only (for tests)
};

// All shapes of the scene, a copy of its triangles for every instance. A binary tree by the surface area heuristic
// (MacDonald & Booth 1990) over bins (Wald 2007, "On fast Construction of SAH-based Bounding Volume Hierarchies"),
// collapsed to eight children at the least expected cost (Ylitie et al. 2017). Parallel; the same bytes at any number
// of threads. Throws MemoryError above 2^30 primitives, or where instances do not fit into the memory budget.
Bvh8 build_bvh8(const Scene& scene, const Bvh8Options& options = {});

// A tracer without Embree, one ray at a time: the reference for devices. The tree must outlive it.
std::unique_ptr<Tracer> make_bvh8_tracer(const Bvh8View& view);
// The same with a tree of its own. Keeps nothing of the scene.
std::unique_ptr<Tracer> make_bvh8_tracer(const Scene& scene);

}  // namespace octrad
