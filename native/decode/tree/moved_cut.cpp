// The cut of a tree whose leaves have moved.
#include <algorithm>
#include <array>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "data/clouds/cloud_extent.h"
#include "decode/tree/hierarchy_decoder.h"
#include "decode/tree/merge_node.h"

namespace stipple {

namespace {

constexpr uint32_t kNone = MergeTree::kNoParent;
constexpr size_t kGrain = 64;

/// Both children of the inner nodes, the one with more leaves below first.
std::vector<std::array<uint32_t, 2>> childrenOf(const MergeTree& tree) {
  const size_t inner_count = tree.nodes.size();
  std::vector<std::array<uint32_t, 2>> children(inner_count, {kNone, kNone});
  for (uint32_t id = 1; id < tree.parents.size(); ++id) {
    std::array<uint32_t, 2>& pair = children[tree.parents[id]];
    pair[pair[0] == kNone ? 0 : 1] = id;
  }
  std::vector<uint32_t> leaf_counts(inner_count);
  const auto leavesBelow = [&](uint32_t id) { return id < inner_count ? leaf_counts[id] : 1u; };
  // Children come after their parents.
  for (size_t id = inner_count; id-- > 0;) {
    auto& [first, second] = children[id];
    if (leavesBelow(first) < leavesBelow(second)) std::swap(first, second);
    leaf_counts[id] = leavesBelow(first) + leavesBelow(second);
  }
  return children;
}

/// Merges what is below a node, children first, without recursion: trees may be as deep as wide.
/// Of two children the one with more leaves comes first, so that no more nodes wait on the stack
/// than the number of leaves has bits.
class MergeBelow {
 public:
  MergeBelow(const SplatCloud& leaves, const std::vector<std::array<uint32_t, 2>>& children,
             const MergeScale& scale)
      : leaves_(leaves), children_(children), scale_(scale), stride_(leaves.shStride()) {}

  /// The node. In: id: an inner one. Out: sh [stride].
  MergeNode merged(uint32_t id, float* sh) {
    tasks_.assign(1, {id, false});
    while (!tasks_.empty()) {
      const auto [node, has_children] = tasks_.back();
      tasks_.pop_back();
      if (node >= children_.size()) {
        pushLeaf(node - children_.size());
      } else if (has_children) {
        mergeLastTwo();
      } else {
        tasks_.push_back({node, true});
        tasks_.push_back({children_[node][1], false});
        tasks_.push_back({children_[node][0], false});
      }
    }
    const MergeNode result = nodes_.back();
    std::copy(harmonics_.begin(), harmonics_.end(), sh);
    nodes_.clear();
    harmonics_.clear();
    return result;
  }

 private:
  struct Task {
    uint32_t id;
    bool has_children;  ///< both are on the stack of nodes
  };

  void pushLeaf(size_t row) {
    nodes_.push_back(leafNode(leaves_, row, 1.0, scale_));
    const float* sh = &leaves_.sh[row * stride_];
    harmonics_.insert(harmonics_.end(), sh, sh + stride_);
  }

  void mergeLastTwo() {
    const MergeNode second = nodes_.back();
    nodes_.pop_back();
    const MergeNode merged = mergedNode(nodes_.back(), second, scale_);
    const double share = merged.weight > 0 ? nodes_.back().weight / merged.weight : 0.5;
    nodes_.back() = merged;
    const size_t second_at = harmonics_.size() - stride_;
    float* first_sh = &harmonics_[second_at - stride_];
    for (size_t k = 0; k < stride_; ++k) {
      first_sh[k] =
          static_cast<float>(share * static_cast<double>(first_sh[k]) +
                             (1 - share) * static_cast<double>(harmonics_[second_at + k]));
    }
    harmonics_.resize(second_at);
  }

  const SplatCloud& leaves_;
  const std::vector<std::array<uint32_t, 2>>& children_;
  const MergeScale& scale_;
  size_t stride_;
  std::vector<Task> tasks_;
  std::vector<MergeNode> nodes_;
  std::vector<float> harmonics_;  ///< [nodes, stride]
};

}  // namespace

SplatCloud HierarchyDecoder::decodeMoved(const SplatCloud& moved, uint64_t budget,
                                         Progress* progress) const {
  if (moved.size() != leaves_->size() || moved.sh_degree != leaves_->sh_degree) {
    fail(ErrorCode::kInvalidArgument,
         "the splats that moved are " + std::to_string(moved.size()) + " of degree " +
             std::to_string(moved.sh_degree) + "; those of the tree are " +
             std::to_string(leaves_->size()) + " of degree " + std::to_string(leaves_->sh_degree));
  }
  if (budget == leaves_->size()) return moved;
  const std::vector<uint32_t> ids = cut(budget);
  const std::vector<std::array<uint32_t, 2>> children = childrenOf(*tree_);
  const MergeScale scale = mergeScale(cloudExtent(*leaves_), 0);
  const size_t inner_count = children.size(), stride = moved.shStride();
  SplatCloud out;
  out.sh_degree = moved.sh_degree;
  out.colour_space = moved.colour_space;
  out.antialias = moved.antialias;
  out.frame = moved.frame;
  out.resize(ids.size());
  advance(progress, 0.0, "Merging splats");
  parallelFor(ids.size(), kGrain, [&](size_t begin, size_t end) {
    if (progress) progress->throwIfCancelled();
    MergeBelow below(moved, children, scale);
    for (size_t i = begin; i < end; ++i) {
      if (ids[i] < inner_count) {
        const MergeNode node = below.merged(ids[i], &out.sh[i * stride]);
        writeNode(node, scale, out, i, &tree_->nodes.rotations[ids[i] * 4]);
        continue;
      }
      const size_t row = ids[i] - inner_count;
      std::copy_n(&moved.positions[row * 3], 3, &out.positions[i * 3]);
      std::copy_n(&moved.rotations[row * 4], 4, &out.rotations[i * 4]);
      std::copy_n(&moved.scales[row * 3], 3, &out.scales[i * 3]);
      out.opacities[i] = moved.opacities[row];
      std::copy_n(&moved.sh[row * stride], stride, &out.sh[i * stride]);
    }
  });
  return out;
}

uint64_t HierarchyDecoder::movedMemoryBound(uint64_t leaf_count) {
  // Ids of children, counts of leaves, ids of the cut; tasks of a tree that is a chain, in an array
  // that doubles.
  return leaf_count * (8 + 4 + 4 + 3 * 2 * 8) + (uint64_t{4} << 20);
}

}  // namespace stipple
