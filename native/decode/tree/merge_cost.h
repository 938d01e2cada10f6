#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "decode/tree/merge_node.h"

namespace stipple {

/// What merging a node with each of several others costs.
struct MergeCostKernel {
  const char* target;  ///< "scalar", or Highway's name of an instruction set ("AVX2")
  /// costs[i] = mergeError of nodes[slot] and nodes[others[i]], as float32, at most its largest
  /// number. All kernels give the same bits, and so does exchanging both nodes.
  void (*costs)(const MergeNode* nodes, uint32_t slot, const uint32_t* others, size_t count,
                const MergeScale& scale, float* costs);
};

/// The kernel to use: the best for this processor, or what STIPPLE_FORCE_TARGET names.
MergeCostKernel chosenMergeCostKernel();

/// Every kernel that is compiled and runs on this processor, "scalar" first. It changes Highway's
/// global choice for a moment: for tests and for STIPPLE_FORCE_TARGET.
std::vector<MergeCostKernel> mergeCostKernels();

}  // namespace stipple
