#include "decode/tree/masked_tree.h"

#include <algorithm>
#include <array>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "data/clouds/cloud_extent.h"
#include "data/clouds/cloud_selection.h"
#include "decode/tree/merge_node.h"

namespace stipple {

namespace {

constexpr uint32_t kNone = MergeTree::kNoParent;
constexpr size_t kGrain = 1024;

/// What the mask makes of a tree, by the ids of the whole tree.
struct Survivors {
  std::vector<std::array<uint32_t, 2>> children;  ///< [N-1]
  std::vector<uint32_t>
      survivor;                  ///< [2N-1] the node that stands for this one; kNone: nothing left
  std::vector<uint8_t> changed;  ///< [2N-1] 1: other leaves below than before
};

Survivors survivorsOf(const MergeTree& tree, std::span<const uint8_t> mask) {
  const size_t leaf_count = mask.size();
  const size_t inner_count = leaf_count - 1;
  Survivors found;
  found.children.assign(inner_count, {kNone, kNone});
  for (uint32_t id = 1; id < tree.parents.size(); ++id) {
    std::array<uint32_t, 2>& pair = found.children[tree.parents[id]];
    pair[pair[0] == kNone ? 0 : 1] = id;
  }
  found.survivor.resize(tree.parents.size());
  found.changed.assign(tree.parents.size(), 0);
  for (size_t i = 0; i < leaf_count; ++i) {
    const size_t id = inner_count + i;
    found.survivor[id] = mask[i] ? static_cast<uint32_t>(id) : kNone;
    found.changed[id] = mask[i] ? 0 : 1;
  }
  // Children come after their parents.
  for (size_t id = inner_count; id-- > 0;) {
    const auto [a, b] = found.children[id];
    const uint32_t left = found.survivor[a];
    const uint32_t right = found.survivor[b];
    found.changed[id] = found.changed[a] | found.changed[b];
    if (left != kNone && right != kNone) {
      found.survivor[id] = static_cast<uint32_t>(id);
    } else {
      found.survivor[id] = left != kNone ? left : right;
    }
  }
  return found;
}

/// Inner nodes that have to be merged anew, by their height above the leaves.
std::vector<std::vector<uint32_t>> changedByHeight(const Survivors& found, size_t inner_count) {
  std::vector<uint32_t> heights(found.survivor.size(), 0);
  std::vector<std::vector<uint32_t>> result;
  for (size_t id = inner_count; id-- > 0;) {
    const auto [a, b] = found.children[id];
    heights[id] = 1 + std::max(heights[a], heights[b]);
    if (!found.changed[id] || found.survivor[id] != id) continue;
    if (result.size() <= heights[id]) result.resize(heights[id] + 1);
    result[heights[id]].push_back(static_cast<uint32_t>(id));
  }
  return result;
}

/// Merges changed nodes from what is left of their children.
class Remerge {
 public:
  Remerge(const SplatCloud& leaves, SplatCloud& nodes, const Survivors& found)
      : leaves_(leaves), nodes_(nodes), found_(found), scale_(mergeScale(cloudExtent(leaves), 0)) {
    sumWeights();
  }

  void node(uint32_t id) {
    const auto [left, right] = found_.children[id];
    const uint32_t a = found_.survivor[left];
    const uint32_t b = found_.survivor[right];
    const MergeNode first = nodeOf(a);
    const MergeNode second = nodeOf(b);
    const MergeNode merged = mergedNode(first, second, scale_);
    writeNode(merged, scale_, nodes_, id);
    const double share = merged.weight > 0 ? first.weight / merged.weight : 0.5;
    const size_t stride = nodes_.shStride();
    const float* sh_a = harmonicsOf(a);
    const float* sh_b = harmonicsOf(b);
    for (size_t k = 0; k < stride; ++k) {
      nodes_.sh[id * stride + k] = static_cast<float>(share * static_cast<double>(sh_a[k]) +
                                                      (1 - share) * static_cast<double>(sh_b[k]));
    }
  }

 private:
  /// Weights of moments are sums over the leaves that are left.
  void sumWeights() {
    const size_t inner_count = nodes_.size();
    weights_.assign(found_.survivor.size(), 0.0);
    parallelFor(leaves_.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        if (found_.survivor[inner_count + i] == kNone) continue;
        weights_[inner_count + i] = leafNode(leaves_, i, 1.0, scale_).weight;
      }
    });
    for (size_t id = inner_count; id-- > 0;) {
      const auto [a, b] = found_.children[id];
      weights_[id] = weights_[a] + weights_[b];
    }
  }

  MergeNode nodeOf(uint32_t id) const {
    const size_t inner_count = nodes_.size();
    MergeNode node = id < inner_count ? leafNode(nodes_, id, 1.0, scale_)
                                      : leafNode(leaves_, id - inner_count, 1.0, scale_);
    node.weight = weights_[id];
    return node;
  }

  const float* harmonicsOf(uint32_t id) const {
    const size_t stride = nodes_.shStride();
    return id < nodes_.size() ? &nodes_.sh[id * stride]
                              : &leaves_.sh[(id - nodes_.size()) * stride];
  }

  const SplatCloud& leaves_;
  SplatCloud& nodes_;
  const Survivors& found_;
  MergeScale scale_;
  std::vector<double> weights_;  ///< [2N-1]
};

/// The nodes that stand for themselves, numbered as they came.
MaskedTree compacted(const SplatCloud& leaves, const MergeTree& tree, const SplatCloud& nodes,
                     const Survivors& found, std::span<const uint8_t> mask) {
  const size_t inner_count = nodes.size();
  MaskedTree result;
  result.leaves = kept(leaves, mask);
  std::vector<uint8_t> alive(inner_count);
  std::vector<uint32_t> number(found.survivor.size(), kNone);
  uint32_t next = 0;
  for (size_t id = 0; id < found.survivor.size(); ++id) {
    const bool stays = found.survivor[id] == id;
    if (id < inner_count) alive[id] = stays ? 1 : 0;
    if (stays) number[id] = next++;
  }
  result.tree.nodes = kept(nodes, alive);
  for (size_t id = 0; id < inner_count; ++id) {
    if (alive[id]) result.tree.errors.push_back(tree.errors[id]);
  }
  // The nearest ancestor that stays; parents come first.
  std::vector<uint32_t> above(found.survivor.size(), kNone);
  result.tree.parents.resize(next);
  for (size_t id = 0; id < found.survivor.size(); ++id) {
    const uint32_t parent = tree.parents[id];
    if (parent != kNone) above[id] = alive[parent] ? parent : above[parent];
    if (number[id] == kNone) continue;
    result.tree.parents[number[id]] = above[id] == kNone ? kNone : number[above[id]];
  }
  return result;
}

}  // namespace

MaskedTree maskedTree(const SplatCloud& leaves, const MergeTree& tree,
                      std::span<const uint8_t> mask, Progress* progress) {
  validateTree(tree, leaves, "tree");
  if (mask.size() != leaves.size()) {
    fail(ErrorCode::kInvalidArgument, "mask holds " + std::to_string(mask.size()) +
                                          " values; the tree has " + std::to_string(leaves.size()) +
                                          " splats, one each is needed");
  }
  if (std::all_of(mask.begin(), mask.end(), [](uint8_t value) { return value == 0; })) {
    fail(ErrorCode::kInvalidArgument,
         "mask leaves out all " + std::to_string(mask.size()) + " splats; at least one must stay");
  }
  advance(progress, 0.0, "Leaving out splats");
  const Survivors found = survivorsOf(tree, mask);
  SplatCloud nodes = tree.nodes;
  const std::vector<std::vector<uint32_t>> levels = changedByHeight(found, nodes.size());
  if (!levels.empty()) {
    Remerge remerge(leaves, nodes, found);
    for (size_t height = 0; height < levels.size(); ++height) {
      advance(progress, static_cast<double>(height) / static_cast<double>(levels.size()),
              "Merging what is left");
      const std::vector<uint32_t>& level = levels[height];
      parallelFor(level.size(), kGrain, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) remerge.node(level[i]);
      });
    }
  }
  return compacted(leaves, tree, nodes, found, mask);
}

}  // namespace stipple
