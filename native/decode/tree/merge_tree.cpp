#include "decode/tree/merge_tree.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "data/clouds/cloud_extent.h"
#include "decode/tree/merge_rounds.h"
#include "math/morton.h"
#include "mesh/cell_table.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 2048;
constexpr int kMortonLevel = 16;
/// Splats that no view sees may show in others: they count a little.
constexpr float kLeastVisibility = 0.003f;

void validateInput(const SplatCloud& leaves, std::span<const float> visibility,
                   const MergeTreeOptions& options) {
  validate(leaves, "cloud");
  if (leaves.size() == 0 || leaves.size() > kMaxTreeLeaves) {
    fail(ErrorCode::kInvalidArgument, "cloud has " + std::to_string(leaves.size()) +
                                          " splats; a merge tree takes 1 to 2147483647");
  }
  if (!visibility.empty() && visibility.size() != leaves.size()) {
    fail(ErrorCode::kInvalidArgument, "visibility has " + std::to_string(visibility.size()) +
                                          " values; " + std::to_string(leaves.size()) +
                                          " are needed");
  }
  for (const float value : visibility) {
    if (!(value >= 0.0f && value <= 1.0f)) {
      fail(ErrorCode::kInvalidArgument,
           "visibility holds " + std::to_string(value) + "; 0 to 1 is allowed");
    }
  }
  if (!std::isfinite(options.footprint) || options.footprint < 0) {
    fail(ErrorCode::kInvalidArgument, "footprint is " + std::to_string(options.footprint) +
                                          " m; 0 (automatic) or more is allowed");
  }
}

/// Leaves in Morton order: neighbours in space are neighbours in memory.
std::vector<uint32_t> spatialOrder(const SplatCloud& leaves, const CloudExtent& extent) {
  const size_t count = leaves.size();
  std::vector<uint64_t> codes(count);
  constexpr double kCells = double{1 << kMortonLevel};
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      uint32_t cell[3];
      for (size_t axis = 0; axis < 3; ++axis) {
        const double x =
            (static_cast<double>(leaves.positions[i * 3 + axis]) - extent.centre[axis]) /
            extent.radius;
        cell[axis] = static_cast<uint32_t>(std::clamp((x + 1) * 0.5 * kCells, 0.0, kCells - 1));
      }
      codes[i] = mortonEncode(cell[0], cell[1], cell[2]);
    }
  });
  return sortedOrder(codes, kMortonLevel * 3);
}

/// Harmonics of a splat of either kind: ids below the leaf count are leaves in spatial order.
class HarmonicRows {
 public:
  HarmonicRows(const SplatCloud& leaves, const std::vector<uint32_t>& order, SplatCloud& nodes)
      : leaves_(leaves), order_(order), nodes_(nodes), stride_(leaves.shStride()) {}

  void mix(uint32_t id, const Merge& merge, double share_first) {
    const float* first = row(merge.first);
    const float* second = row(merge.second);
    float* out = &nodes_.sh[(id - order_.size()) * stride_];
    for (size_t k = 0; k < stride_; ++k) {
      out[k] = static_cast<float>(share_first * static_cast<double>(first[k]) +
                                  (1 - share_first) * static_cast<double>(second[k]));
    }
  }

 private:
  const float* row(uint32_t id) const {
    return id < order_.size() ? &leaves_.sh[order_[id] * stride_]
                              : &nodes_.sh[(id - order_.size()) * stride_];
  }

  const SplatCloud& leaves_;
  const std::vector<uint32_t>& order_;
  SplatCloud& nodes_;
  size_t stride_;
};

template <typename T>
void gatherRows(std::vector<T>& values, size_t stride, const std::vector<uint32_t>& from) {
  std::vector<T> gathered(values.size());
  parallelFor(from.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      std::copy_n(&values[from[i] * stride], stride, &gathered[i * stride]);
    }
  });
  values.swap(gathered);
}

SplatCloud emptyLike(const SplatCloud& cloud, size_t count) {
  SplatCloud out;
  out.sh_degree = cloud.sh_degree;
  out.colour_space = cloud.colour_space;
  out.antialias = cloud.antialias;
  out.frame = cloud.frame;
  out.resize(count);
  return out;
}

/// Numbers the inner nodes by falling error, parents first, and fills parents and errors.
void numberNodes(const std::vector<Merge>& merges, const std::vector<uint32_t>& order,
                 MergeTree& tree) {
  const size_t inner_count = merges.size();
  const size_t leaf_count = order.size();
  // Last merged first, then stable by error: of equal errors the parent comes before its child.
  std::vector<uint64_t> keys(inner_count);
  for (size_t i = 0; i < inner_count; ++i) {
    keys[i] = 0xffffffffu - std::bit_cast<uint32_t>(merges[inner_count - 1 - i].error);
  }
  std::vector<uint32_t> made = sortedOrder(keys, 32);
  std::vector<uint32_t> number(inner_count);
  for (size_t i = 0; i < inner_count; ++i) {
    made[i] = static_cast<uint32_t>(inner_count - 1 - made[i]);
    number[made[i]] = static_cast<uint32_t>(i);
  }
  const auto idOf = [&](uint32_t node) {
    return node < leaf_count ? inner_count + order[node] : number[node - leaf_count];
  };
  tree.parents.assign(inner_count + leaf_count, MergeTree::kNoParent);
  tree.errors.resize(inner_count);
  for (size_t i = 0; i < inner_count; ++i) {
    const Merge& merge = merges[made[i]];
    tree.errors[i] = merge.error;
    tree.parents[idOf(merge.first)] = tree.parents[idOf(merge.second)] = static_cast<uint32_t>(i);
  }
  gatherRows(tree.nodes.positions, 3, made);
  gatherRows(tree.nodes.rotations, 4, made);
  gatherRows(tree.nodes.scales, 3, made);
  gatherRows(tree.nodes.opacities, 1, made);
  gatherRows(tree.nodes.sh, tree.nodes.shStride(), made);
}

}  // namespace

MergeTree buildMergeTree(const SplatCloud& leaves, std::span<const float> visibility,
                         const MergeTreeOptions& options, Progress* progress) {
  validateInput(leaves, visibility, options);
  const size_t leaf_count = leaves.size();
  const CloudExtent extent = cloudExtent(leaves);
  const std::vector<uint32_t> order = spatialOrder(leaves, extent);
  const MergeScale scale = mergeScale(extent, options.footprint);

  std::vector<MergeNode> nodes(leaf_count);
  parallelFor(leaf_count, kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const float seen =
          visibility.empty() ? 1.0f : std::max(visibility[order[i]], kLeastVisibility);
      nodes[i] = leafNode(leaves, order[i], static_cast<double>(seen), scale);
    }
  });

  MergeTree tree;
  tree.nodes = emptyLike(leaves, leaf_count - 1);
  HarmonicRows harmonics(leaves, order, tree.nodes);
  const auto on_merge = [&](uint32_t id, const Merge& merge, const MergeNode& first,
                            const MergeNode&, const MergeNode& merged) {
    writeNode(merged, scale, tree.nodes, id - leaf_count);
    harmonics.mix(id, merge, merged.weight > 0 ? first.weight / merged.weight : 0.5);
  };
  const std::vector<Merge> merges = mergeInRounds(std::move(nodes), scale, on_merge, progress);
  numberNodes(merges, order, tree);
  return tree;
}

uint64_t mergeTreeMemoryBound(uint64_t leaf_count, int sh_degree) {
  // Inner nodes and their copy while they are numbered: 11 numbers and the harmonics.
  const uint64_t row = 4 * (11 + 3 * shCoefficientCount(sh_degree));
  return leaf_count * (2 * row + kMergeBytesPerNode + 64) + (uint64_t{1} << 20);
}

void validateTree(const MergeTree& tree, const SplatCloud& leaves, const char* what) {
  const std::string name(what);
  const size_t leaf_count = leaves.size();
  if (leaf_count == 0 || tree.parents.size() != 2 * leaf_count - 1 ||
      tree.errors.size() != leaf_count - 1 || tree.nodes.size() != leaf_count - 1) {
    fail(ErrorCode::kInvalidArgument,
         name + " has " + std::to_string(tree.parents.size()) + " parents, " +
             std::to_string(tree.errors.size()) + " errors and " +
             std::to_string(tree.nodes.size()) + " inner nodes; a tree over " +
             std::to_string(leaf_count) + " splats has 2N-1, N-1 and N-1");
  }
  if (tree.nodes.sh_degree != leaves.sh_degree) {
    fail(ErrorCode::kInvalidArgument,
         name + " has inner nodes of harmonic degree " + std::to_string(tree.nodes.sh_degree) +
             "; that of the splats, " + std::to_string(leaves.sh_degree) + ", is needed");
  }
  std::vector<uint8_t> children(leaf_count - 1, 0);
  for (size_t id = 0; id < tree.parents.size(); ++id) {
    const uint32_t parent = tree.parents[id];
    const size_t limit = std::min(id, leaf_count - 1);
    const bool good = id == 0 && leaf_count > 1 ? parent == MergeTree::kNoParent
                      : leaf_count == 1         ? parent == MergeTree::kNoParent
                                                : parent < limit && ++children[parent] <= 2;
    if (!good) {
      fail(ErrorCode::kInvalidArgument,
           name + ": node " + std::to_string(id) + " has the parent " + std::to_string(parent) +
               "; an earlier inner node with fewer than two other children is needed");
    }
  }
  for (size_t i = 0; i < tree.errors.size(); ++i) {
    const float limit = i == 0 ? std::numeric_limits<float>::max() : tree.errors[i - 1];
    if (!(tree.errors[i] >= 0.0f && tree.errors[i] <= limit)) {
      fail(ErrorCode::kInvalidArgument, name + ": error " + std::to_string(i) + " is " +
                                            std::to_string(tree.errors[i]) +
                                            "; errors must be 0 or more and never rise");
    }
  }
}

}  // namespace stipple
