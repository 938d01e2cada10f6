#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/progress.h"

namespace stipple {

/// Of each node, when the tree begins and whenever partners are looked for afresh.
constexpr size_t kMergeNeighbours = 6;

/// One merge: the ids of both children (leaves 0..N-1 in the order of their nodes, then merges in
/// the order in which they were made) and the error that it made.
struct Merge {
  uint32_t first;
  uint32_t second;
  float error;
};

/// Ids of a merge that is being made.
struct MergeIds {
  uint32_t merged;
  uint32_t first;
  uint32_t second;
};

/// What merges: splats that stand (merge_tree.cpp) or move (moving_tree.cpp). Here alone is known
/// what a node is, what merging two of them costs, and what becomes of them. A node lives in a
/// slot; a merged one in that of its first child.
class MergingNodes {
 public:
  virtual ~MergingNodes() = default;
  /// Slots; at the begin each has a node.
  virtual size_t size() const = 0;
  /// Numbers of a place, and the places of nodes: those with places near each other are candidates.
  /// Out: places [slots, placeWidth()].
  virtual size_t placeWidth() const = 0;
  virtual void places(std::span<const uint32_t> slots, double* places) const = 0;
  /// Takes notice of who is around a node; one may be named twice. By several threads, each for
  /// other slots.
  virtual void lookAround(uint32_t slot, std::span<const uint32_t> others) = 0;
  /// costs[i]: what merging the slot with others[i] costs, finite and at least 0; the same from
  /// both ends. By several threads.
  virtual void costs(uint32_t slot, const uint32_t* others, size_t count, float* costs) const = 0;
  /// Merges two slots into the first. Called once per merge, by several threads, each for other
  /// slots; both children's calls are over by then.
  /// Returns: an error that the merge has at least, beside its cost.
  virtual float merge(uint32_t first, uint32_t second, const MergeIds& ids) = 0;
  /// Nodes lie all over the memory; the costs of a list wait for them less where they are asked for
  /// as soon as they are known.
  virtual void fetchAhead(uint32_t slot) const = 0;
};

/// Merges nodes until one is left.
/// In: nodes: spatially sorted where that is possible (it only helps the speed).
/// Returns: the merges [N-1], in the order of their ids N..2N-2.
std::vector<Merge> mergeInRounds(MergingNodes& nodes, Progress* progress);

/// Bytes that mergeInRounds holds per node, without the nodes; places have `place_width` numbers.
constexpr uint64_t mergeBytesPerNode(size_t place_width) {
  return 220 + 12 * uint64_t{place_width};
}

}  // namespace stipple
