#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "decode/tree/moving_node.h"

namespace stipple {

/// Nodes that move, by slots.
struct MovingNodeRows {
  const MovingNode* nodes;  ///< [slots]
  const float* samples;     ///< [slots, MovingField::kCount, stride]
  const MovingScale* scale;

  const float* samplesOf(size_t slot) const {
    return samples + slot * MovingField::kCount * scale->stride;
  }
};

/// A merged node.
struct MovingMerge {
  MovingNode node;
  double error = 0;  ///< what the merge does to images, the mean over time
  alignas(64) std::array<float, MovingField::kCount * kMostMergeTimes> samples;
};

struct MovingMergeKernel {
  const char* target;  ///< "scalar", or Highway's name of an instruction set ("AVX2")
  /// costs[i]: the error of merging a slot with others[i], at most the largest float32. All kernels
  /// give the same bits, and so does exchanging both nodes.
  void (*costs)(const MovingNodeRows& rows, uint32_t slot, const uint32_t* others, size_t count,
                float* costs);
  /// The merge itself, but for `around`. In: means [3, stride]: where the merged node is at the
  /// times; null: at the mean of both.
  void (*merge)(const MovingNodeRows& rows, uint32_t a, uint32_t b, const double* means,
                MovingMerge& merged);
};

/// The kernel to use: the best for this processor, or what STIPPLE_FORCE_TARGET names.
MovingMergeKernel chosenMovingMergeKernel();

/// Every kernel that is compiled and runs on this processor, "scalar" first. It changes Highway's
/// global choice for a moment: for tests and for STIPPLE_FORCE_TARGET.
std::vector<MovingMergeKernel> movingMergeKernels();

MovingMergeKernel scalarMovingMergeKernel();

}  // namespace stipple
