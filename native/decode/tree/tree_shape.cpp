#include "decode/tree/tree_shape.h"

#include <algorithm>
#include <bit>
#include <string>

#include "base/error.h"
#include "base/fresh_memory.h"
#include "base/parallel.h"
#include "mesh/cell_table.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 2048;

}  // namespace

void requireLeafCount(size_t leaf_count, const char* what) {
  if (leaf_count > 0 && leaf_count <= kMaxTreeLeaves) return;
  fail(ErrorCode::kInvalidArgument, std::string(what) + " has " + std::to_string(leaf_count) +
                                        " splats; a merge tree takes 1 to 2147483647");
}

void requireVisibility(std::span<const float> visibility, size_t leaf_count) {
  if (!visibility.empty() && visibility.size() != leaf_count) {
    fail(ErrorCode::kInvalidArgument, "visibility has " + std::to_string(visibility.size()) +
                                          " values; " + std::to_string(leaf_count) + " are needed");
  }
  for (const float value : visibility) {
    if (!(value >= 0.0f && value <= 1.0f)) {
      fail(ErrorCode::kInvalidArgument,
           "visibility holds " + std::to_string(value) + "; 0 to 1 is allowed");
    }
  }
}

std::vector<uint32_t> numberNodes(const std::vector<Merge>& merges,
                                  const std::vector<uint32_t>& order, TreeShape& shape) {
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
  shape.parents.assign(inner_count + leaf_count, TreeShape::kNoParent);
  shape.errors.resize(inner_count);
  for (size_t i = 0; i < inner_count; ++i) {
    const Merge& merge = merges[made[i]];
    shape.errors[i] = merge.error;
    shape.parents[idOf(merge.first)] = shape.parents[idOf(merge.second)] = static_cast<uint32_t>(i);
  }
  return made;
}

void gatherRows(std::vector<float>& values, size_t stride, const std::vector<uint32_t>& from) {
  std::vector<float> gathered;
  resizeFresh(gathered, from.size() * stride);
  parallelFor(from.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      std::copy_n(&values[from[i] * stride], stride, &gathered[i * stride]);
    }
  });
  values.swap(gathered);
}

std::vector<uint32_t> cutOfShape(const TreeShape& shape, uint64_t budget) {
  const size_t leaf_count = shape.leafCount();
  if (budget < 1 || budget > leaf_count) {
    fail(ErrorCode::kInvalidArgument, "the budget is " + std::to_string(budget) + " splats; 1 to " +
                                          std::to_string(leaf_count) +
                                          " is allowed, as many as the cloud has");
  }
  // The first budget - 1 inner nodes are split: a node shows whose parent is and which itself is
  // not.
  const uint32_t split_count = static_cast<uint32_t>(budget - 1);
  const uint32_t* parents = shape.parents.data();
  std::vector<uint32_t> ids(budget);
  size_t filled = 0;
  if (split_count == 0) {
    ids[filled++] = 0;
    return ids;
  }
  const uint32_t id_count = static_cast<uint32_t>(shape.parents.size());
  for (uint32_t id = split_count; id < id_count && filled < budget; ++id) {
    ids[filled] = id;
    filled += parents[id] < split_count ? 1 : 0;
  }
  return ids;
}

void validateShape(const TreeShape& shape, size_t leaf_count, const char* what) {
  const std::string name(what);
  if (leaf_count == 0 || shape.parents.size() != 2 * leaf_count - 1 ||
      shape.errors.size() != leaf_count - 1) {
    fail(ErrorCode::kInvalidArgument, name + " has " + std::to_string(shape.parents.size()) +
                                          " parents and " + std::to_string(shape.errors.size()) +
                                          " errors; a tree over " + std::to_string(leaf_count) +
                                          " splats has 2N-1 and N-1");
  }
  std::vector<uint8_t> children(leaf_count - 1, 0);
  for (size_t id = 0; id < shape.parents.size(); ++id) {
    const uint32_t parent = shape.parents[id];
    const size_t limit = std::min(id, leaf_count - 1);
    const bool good = id == 0 && leaf_count > 1 ? parent == TreeShape::kNoParent
                      : leaf_count == 1         ? parent == TreeShape::kNoParent
                                                : parent < limit && ++children[parent] <= 2;
    if (!good) {
      fail(ErrorCode::kInvalidArgument,
           name + ": node " + std::to_string(id) + " has the parent " + std::to_string(parent) +
               "; an earlier inner node with fewer than two other children is needed");
    }
  }
  for (size_t i = 0; i < shape.errors.size(); ++i) {
    const float limit = i == 0 ? std::numeric_limits<float>::max() : shape.errors[i - 1];
    if (!(shape.errors[i] >= 0.0f && shape.errors[i] <= limit)) {
      fail(ErrorCode::kInvalidArgument, name + ": error " + std::to_string(i) + " is " +
                                            std::to_string(shape.errors[i]) +
                                            "; errors must be 0 or more and never rise");
    }
  }
}

}  // namespace stipple
