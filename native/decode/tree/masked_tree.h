#pragma once

#include <cstdint>
#include <span>

#include "decode/tree/merge_tree.h"

namespace stipple {

/// A tree over some of its splats.
struct MaskedTree {
  SplatCloud leaves;
  MergeTree tree;
};

/// The tree without the leaves whose mask is 0. Splats left out contribute to no cut: inner nodes
/// above some of them are merged anew from what is left of their children, nodes with one child
/// left give way to it, all others stay bit for bit, and so do leaves. Nodes keep their errors and
/// their order. In: mask [N], at least one value not 0. The tree's own low-pass counts as
/// automatic. Errors: kInvalidArgument for a tree that does not fit the leaves, a mask of another
/// length, or one that leaves nothing; kCancelled. Same result for any number of threads. Cost:
/// O(N) to look, about 2 us per node merged anew.
MaskedTree maskedTree(const SplatCloud& leaves, const MergeTree& tree,
                      std::span<const uint8_t> mask, Progress* progress = nullptr);

}  // namespace stipple
