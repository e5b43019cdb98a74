// The binary tree that bvh8.cc collapses. Not for use elsewhere.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "octrad/base/vec.h"

namespace octrad {

// Box of a primitive and which one it is.
struct BvhReference {
  float lower[3];
  std::int32_t shape;  // -1: left out
  float upper[3];
  std::int32_t primitive;
};

// An inner node over n references [first, first + n), n >= 2. The left child has `left_count` of them and, if these are
// more than one, is the next node; the right child, if it has more than one, is the node at `left_count` further on. So
// a subtree of n references has n - 1 nodes, and its position does not depend on the thread that builds it.
struct Bvh2Node {
  float lower[3], upper[3];
  std::uint32_t left_count;
  std::uint32_t leaf;  // 1: cheaper as one leaf
  float cost[7];       // least expected cost as at most 1..7 children of a wide node (Ylitie et al. 2017)
};

inline constexpr float kBvhNodeCost = 1.0f;       // of a visit of a wide node
inline constexpr float kBvhPrimitiveCost = 0.4f;  // of a test of a primitive

// Surface area of a box, its sides times `scale`: 1 / the largest extent of everything, so that squares stay in range.
float bvh_area(const float* lower, const float* upper, float scale);

struct Bvh2 {
  std::unique_ptr<Bvh2Node[]> nodes;  // count - 1
  float scale = 1.0f;
};

// Orders the references by leaf. Splits at medians where the tree would else have more than max(max_levels, log2 count)
// levels. count >= 1.
Bvh2 build_bvh2(BvhReference* references, std::size_t count, int max_levels);

// The cheapest split of `slots` children of a wide node between the two children of a subtree: the number for the left
// one. costs: of the children for 1..7 slots. slots in 2..8.
struct BvhDistribution {
  float cost;
  int left_slots;
};
BvhDistribution distribute(const float* left, const float* right, int slots);

}  // namespace octrad
