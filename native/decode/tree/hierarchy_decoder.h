#pragma once

#include <memory>

#include "decode/decoder.h"
#include "decode/tree/merge_tree.h"

namespace stipple {

/// An existing cloud at any budget: the cut of exactly P nodes of its merge tree, greatest error
/// first. P = N gives the cloud itself, bit for bit; the cut of P + 1 replaces one node of the cut
/// of P by its two children. Needs no anchors: DecodeRequest::budget is P, 1..N, K is 1.
/// Order: inner nodes by number, then leaves in the order of the cloud.
class HierarchyDecoder final : public Decoder {
 public:
  /// Errors: kInvalidArgument where the tree does not fit the cloud.
  HierarchyDecoder(std::shared_ptr<const SplatCloud> leaves, std::shared_ptr<const MergeTree> tree);
  SplatCloud decode(const DecodeRequest& request) const override;
  /// The cut, and what kSplitOctaves more would split on its way: of both children the one that
  /// shows most goes from its parent's shape to its own, and the other one appears. N of them are
  /// the cloud itself. Cost: O(N).
  SplatCloud decodeSmooth(const DecodeRequest& request) const override;
  /// How much the budget grows while a node splits, in doublings.
  static constexpr double kSplitOctaves = 0.5;
  uint64_t memoryBound(uint64_t anchor_count, uint32_t gaussians_per_anchor) const override;

  /// The cut of as many nodes when the leaves are elsewhere, or of other shapes and colours: the
  /// nodes of cut(budget), row by row as decode() has them, merged anew from where their leaves are
  /// now. Axes keep the order of those of the node as it was. In: moved: as many splats of the same
  /// degree, accepted by validate(); visibilities of the tree count as 1 and its low-pass as
  /// automatic. Errors: kInvalidArgument; kCancelled. Same bits for any number of threads.
  /// Cost: about 1 us per leaf below an inner node of the cut.
  SplatCloud decodeMoved(const SplatCloud& moved, uint64_t budget,
                         Progress* progress = nullptr) const;

  /// Bytes that decodeMoved() takes at most, beside its result.
  static uint64_t movedMemoryBound(uint64_t leaf_count);

  /// Ids of the nodes of the cut (data of MergeTree), ascending. In: budget 1..N.
  std::vector<uint32_t> cut(uint64_t budget) const;

  const std::shared_ptr<const SplatCloud>& leaves() const { return leaves_; }
  const std::shared_ptr<const MergeTree>& tree() const { return tree_; }

 private:
  /// The nodes as splats, row by row.
  SplatCloud rowsOf(const std::vector<uint32_t>& ids) const;
  /// Of the nodes first..end-1, all of them inner ones, the child that shows most.
  std::vector<uint32_t> heirs(uint32_t first, uint32_t end) const;

  std::shared_ptr<const SplatCloud> leaves_;
  std::shared_ptr<const MergeTree> tree_;
};

}  // namespace stipple
