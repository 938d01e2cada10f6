#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <vector>

#include "decode/decoder.h"
#include "decode/tree/moving_tree.h"

namespace stipple {

/// What builds a tree for splats that have none yet. Without functions: buildMovingTree() of splats
/// that all count as seen.
struct MovingTreeSource {
  std::function<MovingTree(const MotionCloud& moving, Progress* progress)> build;
  std::function<uint64_t(const MotionCloud& moving)> memory_bound;  ///< bytes that build() holds

  MovingTree treeOf(const MotionCloud& moving, Progress* progress) const;
  uint64_t memoryBoundOf(const MotionCloud& moving) const;
};

/// Splats that move, at any budget and time: the cut of exactly P nodes of their tree, the same
/// nodes at all times. P = N gives the splats themselves, bit for bit. Needs no anchors:
/// DecodeRequest::budget is P, 1..N, K is 1. Order: inner nodes by number, then leaves in the order
/// of the cloud. Where there is no tree, the first smaller budget builds it, once.
class MovingDecoder final : public Decoder {
 public:
  /// In: tree: null where there is none yet; trees: where it then comes from.
  /// Errors: kInvalidArgument where the tree does not fit the splats.
  explicit MovingDecoder(MotionCloud leaves, std::shared_ptr<const MovingTree> tree = nullptr,
                         MovingTreeSource trees = {});

  SplatCloud decode(const DecodeRequest& request) const override;
  uint64_t memoryBound(uint64_t budget, uint32_t gaussians_per_anchor) const override;

  /// Ids of the nodes of the cut (TreeShape), ascending. In: budget 1..N. Errors: kInvalidArgument;
  /// kCancelled.
  std::vector<uint32_t> cut(uint64_t budget, Progress* progress = nullptr) const;

  const MotionCloud& leaves() const { return leaves_; }
  /// Null where nobody has asked for a smaller budget.
  std::shared_ptr<const MovingTree> tree() const;

 private:
  std::shared_ptr<const MovingTree> builtTree(Progress* progress) const;

  MotionCloud leaves_;
  MovingTreeSource trees_;
  mutable std::mutex building_;  ///< one builds, others wait
  mutable std::mutex mutex_;     ///< of tree_
  mutable std::shared_ptr<const MovingTree> tree_;
};

}  // namespace stipple
