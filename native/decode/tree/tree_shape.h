#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "base/progress.h"
#include "decode/tree/merge_rounds.h"

namespace stipple {

/// A binary tree over N leaves, whatever its nodes are. Inner nodes are numbered in the order in
/// which growing budgets split them: node 0 is the root, errors fall, a parent comes before its
/// children. Ids: inner nodes 0..N-2, then the N leaves.
struct TreeShape {
  static constexpr uint32_t kNoParent = std::numeric_limits<uint32_t>::max();

  std::vector<uint32_t> parents;  ///< [2N-1] by id; kNoParent for the root
  std::vector<float> errors;      ///< [N-1] of each inner node, never rising

  size_t leafCount() const { return parents.empty() ? 0 : parents.size() / 2 + 1; }
};

/// Most leaves of a tree: ids are 32 bit.
constexpr size_t kMaxTreeLeaves = (size_t{1} << 31) - 1;

/// Refuses counts of leaves that no tree takes. `what` names them. Errors: kInvalidArgument.
void requireLeafCount(size_t leaf_count, const char* what);
/// Refuses visibilities of another length, or outside 0..1. Errors: kInvalidArgument.
void requireVisibility(std::span<const float> visibility, size_t leaf_count);

/// Numbers the inner nodes by falling error, parents first.
/// In: merges of mergeInRounds(); order [N]: the leaf that each of its first nodes is.
/// Out: shape. Returns: the merge of each inner node, by its number.
std::vector<uint32_t> numberNodes(const std::vector<Merge>& merges,
                                  const std::vector<uint32_t>& order, TreeShape& shape);

/// Some rows of a column, in another order: row i is what row from[i] was.
void gatherRows(std::vector<float>& values, size_t stride, const std::vector<uint32_t>& from);

/// Ids of the nodes of a cut, ascending. In: budget 1..N. Errors: kInvalidArgument.
std::vector<uint32_t> cutOfShape(const TreeShape& shape, uint64_t budget);

/// Refuses parents out of order or with other than two children, errors that rise, and another
/// number of leaves. `what` names it. Errors: kInvalidArgument.
void validateShape(const TreeShape& shape, size_t leaf_count, const char* what);

}  // namespace stipple
