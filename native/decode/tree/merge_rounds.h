#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "base/progress.h"
#include "decode/tree/merge_node.h"

namespace stipple {

/// One merge: the ids of both children (leaves 0..N-1 in the order of their nodes, then merges in
/// the order in which they were made) and the error that it made.
struct Merge {
  uint32_t first;
  uint32_t second;
  float error;
};

/// Merges nodes until one is left.
/// In: nodes: the leaves, spatially sorted where that is possible (it only helps the speed).
/// on_merge(id, merge, first, second, merged): called once per merge, by several threads; both
/// children's calls are over by then.
/// Returns: the merges [N-1], in the order of their ids N..2N-2.
std::vector<Merge> mergeInRounds(
    std::vector<MergeNode> nodes, const MergeScale& scale,
    const std::function<void(uint32_t id, const Merge& merge, const MergeNode& first,
                             const MergeNode& second, const MergeNode& merged)>& on_merge,
    Progress* progress);

/// Bytes that mergeInRounds holds per node, its argument included.
constexpr uint64_t kMergeBytesPerNode = 512;

}  // namespace stipple
