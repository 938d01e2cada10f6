#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace stipple {

/// Cells of one level of an octree, and what the log q of each of their children weighs in a loss.
struct OctreeLevel {
  int level = 0;                ///< of the cells: 0 is the root
  std::vector<uint64_t> cells;  ///< Morton codes, ascending
  std::vector<double> weights;  ///< [cells, 8], k = dx + 2 dy + 4 dz
};

/// The cells above leaves, and in each the sum of the weights of the leaves below each child. In:
/// leaves: Morton codes at leaf_level, repeats allowed; weights: one for each. Out: levels 0 to
/// leaf_level - 1, their cells with leaves.
std::vector<OctreeLevel> levelsAbove(std::span<const uint64_t> leaves, int leaf_level,
                                     std::span<const double> weights);

/// Sum of weight times log q over all children of all levels, log q being the log-softmax of a
/// cell's eight logits; infinitely unlikely children of weight 0 count for nothing. In: logits
/// [rows, 8], rows as in `levels`; factor. Out: gradient [rows, 8]: factor times the derivative,
/// written over. Returns factor times the sum.
/// With weights g, the derivatives by log q of anchors, this is what the density gradient of DeG
/// sends back (arXiv 2605.16355); with the share of the surface's points that each child has, minus
/// it is the cross-entropy of its structural loss.
double weighLogProbabilities(std::span<const OctreeLevel> levels, std::span<const float> logits,
                             double factor, std::span<float> gradient);

/// The least that the cross-entropy of those weights can be: minus the sum of p log(p of its cell +
/// 1e-8), taken off so that what is left is a divergence.
double leastCrossEntropy(const OctreeLevel& level);

}  // namespace stipple
