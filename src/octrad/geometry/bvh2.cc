#include "octrad/geometry/bvh2.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <vector>

#include "octrad/base/threads.h"
#include "octrad/geometry/bvh8_math.h"

namespace octrad {
namespace {

constexpr int kBins = 16;
constexpr std::size_t kSweep = 6;                // up to this many references all splits are tried
constexpr std::size_t kParallelSplit = 1 << 12;  // subtrees of this size are built by different threads
constexpr std::size_t kParallelBins = 1 << 17, kBinBlock = 1 << 15;

struct Box {
  float lower[3] = {3e38f, 3e38f, 3e38f}, upper[3] = {-3e38f, -3e38f, -3e38f};
  void extend(const float* l, const float* u) {
    for (int k = 0; k < 3; ++k) {
      lower[k] = l[k] < lower[k] ? l[k] : lower[k];
      upper[k] = u[k] > upper[k] ? u[k] : upper[k];
    }
  }
  void extend(const Box& b) { extend(b.lower, b.upper); }
};

// Twice the centre.
float center(const BvhReference& r, int axis) { return r.lower[axis] + r.upper[axis]; }

struct Bounds {
  Box box, centers;
  void extend(const BvhReference& r) {
    box.extend(r.lower, r.upper);
    const float c[3] = {center(r, 0), center(r, 1), center(r, 2)};
    centers.extend(c, c);
  }
  void extend(const Bounds& b) {
    box.extend(b.box);
    centers.extend(b.centers);
  }
};

struct Bin {
  Box box;
  std::uint32_t count = 0;
};

struct Bins {
  Bin bin[3][kBins];
  void extend(const Bins& b) {
    for (int k = 0; k < 3; ++k) {
      for (int i = 0; i < kBins; ++i) {
        bin[k][i].box.extend(b.bin[k][i].box);
        bin[k][i].count += b.bin[k][i].count;
      }
    }
  }
};

// Bin of a centre; the same expression for counting and for splitting.
struct Binning {
  float origin[3], factor[3];
  bool usable[3];
  explicit Binning(const Box& centers) {
    for (int k = 0; k < 3; ++k) {
      origin[k] = centers.lower[k];
      factor[k] = static_cast<float>(kBins) * 0.9999f / (centers.upper[k] - centers.lower[k]);
      usable[k] = centers.upper[k] > centers.lower[k] && std::isfinite(factor[k]);
      if (!usable[k]) factor[k] = 0.0f;
    }
  }
  int operator()(const BvhReference& r, int axis) const {
    return static_cast<int>((center(r, axis) - origin[axis]) * factor[axis]);
  }
};

struct Split {
  float cost = std::numeric_limits<float>::infinity();
  int axis = -1;
  int bin = 0;  // first of the right side
};

template <typename Accumulator, typename Body>
void accumulate(std::size_t count, Accumulator& total, const Body& body) {
  if (count < kParallelBins) {
    body(0, count, total);
    return;
  }
  const std::size_t blocks = (count + kBinBlock - 1) / kBinBlock;
  std::vector<Accumulator> parts(blocks, total);  // minima, maxima and counts: the order does not matter
  parallel_for(blocks, [&](std::size_t b) { body(b * kBinBlock, std::min(count, (b + 1) * kBinBlock), parts[b]); });
  for (const Accumulator& p : parts) total.extend(p);
}

class Builder {
 public:
  Builder(BvhReference* references, Bvh2Node* nodes, float scale, int max_levels)
      : references_(references),
        nodes_(nodes),
        scale_(scale),
        max_levels_(max_levels) {}

  // The subtree of `count` >= 2 references from `first`; its nodes start at `index`.
  void build(std::size_t index, std::size_t first, std::size_t count, int level, const Bounds& bounds) {
    Bvh2Node& node = nodes_[index];
    std::copy_n(bounds.box.lower, 3, node.lower);
    std::copy_n(bounds.box.upper, 3, node.upper);
    Bounds left, right;
    const std::size_t left_count = split(references_ + first, count, level, bounds, left, right),
                      right_count = count - left_count;
    node.left_count = static_cast<std::uint32_t>(left_count);
    const auto side = [&](std::size_t i) {
      if (i == 0 && left_count > 1) build(index + 1, first, left_count, level + 1, left);
      if (i == 1 && right_count > 1) build(index + left_count, first + left_count, right_count, level + 1, right);
    };
    if (count >= kParallelSplit) {
      parallel_for(2, side);
    } else {
      side(0);
      side(1);
    }
    set_costs(node, index, first, count);
  }

 private:
  std::size_t split(BvhReference* r, std::size_t count, int level, const Bounds& bounds, Bounds& left, Bounds& right) {
    std::size_t left_count = 0;
    const int needed = static_cast<int>(std::bit_width(count - 1));
    if (level + needed >= max_levels_) {
      left_count = split_median(r, count, bounds);
    } else if (count <= kSweep) {
      left_count = count == 2 ? 1 : split_sweep(r, count);
    } else {
      left_count = split_bins(r, count, bounds, left, right);
      if (left_count != 0) return left_count;
      left_count = split_median(r, count, bounds);
    }
    if (left_count > 1) gather(r, left_count, left);
    if (count - left_count > 1) gather(r + left_count, count - left_count, right);
    return left_count;
  }

  static void gather(const BvhReference* r, std::size_t count, Bounds& bounds) {
    accumulate(count, bounds, [&](std::size_t begin, std::size_t end, Bounds& part) {
      Bounds local = part;
      for (std::size_t i = begin; i < end; ++i) local.extend(r[i]);
      part = local;
    });
  }

  // 0: no split separates anything.
  std::size_t split_bins(BvhReference* r, std::size_t count, const Bounds& bounds, Bounds& left, Bounds& right) const {
    const Binning binning(bounds.centers);
    Bins bins;
    accumulate(count, bins, [&](std::size_t begin, std::size_t end, Bins& part) {
      for (std::size_t i = begin; i < end; ++i) {
        for (int k = 0; k < 3; ++k) {
          Bin& b = part.bin[k][binning(r[i], k)];
          b.box.extend(r[i].lower, r[i].upper);
          ++b.count;
        }
      }
    });
    Split best;
    for (int k = 0; k < 3; ++k) {
      if (!binning.usable[k]) continue;
      float right_cost[kBins];
      Box box;
      std::uint32_t n = 0;
      for (int i = kBins - 1; i > 0; --i) {
        box.extend(bins.bin[k][i].box);
        n += bins.bin[k][i].count;
        right_cost[i] = n == 0 ? -1.0f : static_cast<float>(n) * bvh_area(box.lower, box.upper, scale_);
      }
      box = Box();
      n = 0;
      for (int i = 1; i < kBins; ++i) {
        box.extend(bins.bin[k][i - 1].box);
        n += bins.bin[k][i - 1].count;
        if (n == 0 || right_cost[i] < 0.0f) continue;
        const float cost = right_cost[i] + static_cast<float>(n) * bvh_area(box.lower, box.upper, scale_);
        if (cost < best.cost) best = {cost, k, i};
      }
    }
    if (best.axis < 0) return 0;
    std::size_t i = 0, j = count;
    for (;;) {  // std::partition that also computes the bounds of both sides
      while (i < j && binning(r[i], best.axis) < best.bin) left.extend(r[i++]);
      while (i < j && binning(r[j - 1], best.axis) >= best.bin) right.extend(r[--j]);
      if (i >= j) break;
      std::swap(r[i], r[j - 1]);
    }
    return i;
  }

  // Halves along the axis of the widest spread of centres.
  static std::size_t split_median(BvhReference* r, std::size_t count, const Bounds& bounds) {
    int axis = 0;
    float widest = -1.0f;
    for (int k = 0; k < 3; ++k) {
      const float extent = bounds.centers.upper[k] - bounds.centers.lower[k];
      if (extent > widest) {
        widest = extent;
        axis = k;
      }
    }
    const std::size_t half = count / 2;
    std::nth_element(r, r + half, r + count, [axis](const BvhReference& a, const BvhReference& b) {
      return center(a, axis) < center(b, axis);
    });
    return half;
  }

  // The best of all splits of a few references.
  std::size_t split_sweep(BvhReference* r, std::size_t count) const {
    BvhReference sorted[kSweep], best[kSweep];
    float best_cost = std::numeric_limits<float>::infinity();
    std::size_t best_count = 0;
    for (int k = 0; k < 3; ++k) {
      std::copy_n(r, count, sorted);
      for (std::size_t i = 1; i < count; ++i) {
        const BvhReference moved = sorted[i];
        std::size_t j = i;
        for (; j > 0 && center(sorted[j - 1], k) > center(moved, k); --j) sorted[j] = sorted[j - 1];
        sorted[j] = moved;
      }
      float right_cost[kSweep];
      Box box;
      for (std::size_t i = count - 1; i > 0; --i) {
        box.extend(sorted[i].lower, sorted[i].upper);
        right_cost[i] = static_cast<float>(count - i) * bvh_area(box.lower, box.upper, scale_);
      }
      box = Box();
      bool better = false;
      for (std::size_t i = 1; i < count; ++i) {
        box.extend(sorted[i - 1].lower, sorted[i - 1].upper);
        const float cost = right_cost[i] + static_cast<float>(i) * bvh_area(box.lower, box.upper, scale_);
        if (cost < best_cost || best_count == 0) {
          best_cost = cost;
          best_count = i;
          better = true;
        }
      }
      if (better) std::copy_n(sorted, count, best);
    }
    std::copy_n(best, count, r);
    return best_count;
  }

  // Costs of a child that has no node: one primitive.
  void child_costs(std::size_t index, std::size_t first, std::size_t count, float* out) const {
    if (count > 1) {
      std::copy_n(nodes_[index].cost, 7, out);
      return;
    }
    std::fill_n(out, 7, kBvhPrimitiveCost * bvh_area(references_[first].lower, references_[first].upper, scale_));
  }

  void set_costs(Bvh2Node& node, std::size_t index, std::size_t first, std::size_t count) const {
    float left[7], right[7];
    child_costs(index + 1, first, node.left_count, left);
    child_costs(index + node.left_count, first + node.left_count, count - node.left_count, right);
    const float area = bvh_area(node.lower, node.upper, scale_);
    const float as_node = distribute(left, right, 8).cost + kBvhNodeCost * area;
    const float as_leaf = static_cast<float>(count) * kBvhPrimitiveCost * area;
    node.leaf = count <= kBvh8MaxLeaf && as_leaf <= as_node ? 1 : 0;
    node.cost[0] = node.leaf ? as_leaf : as_node;
    for (int slots = 2; slots <= 7; ++slots) {
      node.cost[slots - 1] = std::min(node.cost[slots - 2], distribute(left, right, slots).cost);
    }
  }

  BvhReference* references_;
  Bvh2Node* nodes_;
  float scale_;
  int max_levels_;
};

}  // namespace

float bvh_area(const float* lower, const float* upper, float scale) {
  const float x = (upper[0] - lower[0]) * scale, y = (upper[1] - lower[1]) * scale, z = (upper[2] - lower[2]) * scale;
  return x * y + y * z + z * x;
}

BvhDistribution distribute(const float* left, const float* right, int slots) {
  BvhDistribution best{left[0] + right[slots - 2], 1};
  for (int k = 2; k < slots; ++k) {
    const float cost = left[k - 1] + right[slots - k - 1];
    if (cost < best.cost) best = {cost, k};
  }
  return best;
}

Bvh2 build_bvh2(BvhReference* references, std::size_t count, int max_levels) {
  Bvh2 tree;
  Bounds bounds;
  accumulate(count, bounds, [&](std::size_t begin, std::size_t end, Bounds& part) {
    for (std::size_t i = begin; i < end; ++i) part.extend(references[i]);
  });
  float largest = 0.0f;
  for (int k = 0; k < 3; ++k) largest = std::max(largest, bounds.box.upper[k] - bounds.box.lower[k]);
  tree.scale = largest > 1e-30f ? 1.0f / largest : 1.0f;
  if (count < 2) return tree;
  tree.nodes = std::make_unique_for_overwrite<Bvh2Node[]>(count - 1);
  const int levels = std::max(max_levels, static_cast<int>(std::bit_width(count - 1)));
  Builder(references, tree.nodes.get(), tree.scale, levels).build(0, 0, count, 0, bounds);
  return tree;
}

}  // namespace octrad
