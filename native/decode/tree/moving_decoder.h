#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "decode/decoder.h"
#include "decode/tree/moving_tree.h"

namespace stipple {

/// Splats that move, at any budget and time: the cut of exactly P nodes of their tree, the same
/// nodes at all times. P = N gives the splats themselves, bit for bit. Needs no anchors:
/// DecodeRequest::budget is P, 1..N, K is 1. Order: inner nodes by number, then leaves in the order
/// of the cloud. Where there is no tree, the first smaller budget builds it, once.
class MovingDecoder final : public Decoder {
 public:
  /// In: tree: null where there is none yet.
  /// Errors: kInvalidArgument where the tree does not fit the splats.
  explicit MovingDecoder(MotionCloud leaves, std::shared_ptr<const MovingTree> tree = nullptr);

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
  mutable std::mutex building_;  ///< one builds, others wait
  mutable std::mutex mutex_;     ///< of tree_
  mutable std::shared_ptr<const MovingTree> tree_;
};

}  // namespace stipple
