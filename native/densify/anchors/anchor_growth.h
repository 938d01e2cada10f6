#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "densify/strategy.h"

namespace stipple {

/// What steps have told about anchors and their slots (one for each of an anchor's K splats) since
/// this was last asked.
struct AnchorStatistics {
  std::vector<float> gradient_sums;  ///< [A,K] lengths of screen gradients, in 3DGS's units
  std::vector<uint32_t> drawn;       ///< [A,K] steps that drew the slot
  std::vector<float> opacity_sums;   ///< [A] opacities of the splats, over the steps that count
  std::vector<uint32_t> seen;        ///< [A] steps whose view had the anchor in its image

  size_t anchorCount() const { return seen.size(); }
  /// Anchors at the end, about which nothing is known, or fewer anchors.
  void resize(size_t anchors, size_t gaussians);
  /// Adds a view. In: slots [N] of the splats that were drawn, ascending; opacities [N]; in_view
  /// [A]; view: of those N splats, with screen gradients.
  void add(const ViewStatistics& view, std::span<const uint32_t> slots,
           std::span<const float> opacities, std::span<const uint8_t> in_view);
  void keep(const std::vector<uint32_t>& rows, size_t gaussians);
};

/// Whether a view has a place in its image, a little beyond its borders included. In: place [3].
bool isInView(const Camera& camera, const float* place);

struct AnchorGrowthOptions {
  double threshold = 2e-4;   ///< of the mean gradient, of the largest cells; twice that of the next
  uint32_t depths = 3;       ///< sizes of cells
  double largest_cell = 16;  ///< in voxels
  double division = 4;       ///< of cells from one size to the next
  double least_drawn = 0.4;  ///< share of the window's steps that must have drawn a slot
  double least_seen = 0.8;   ///< share of the window's steps that judge an anchor
  double least_opacity = 5e-3;  ///< mean sum of an anchor's opacities; fainter ones go
};

/// What growth looks at.
struct AnchorGround {
  std::span<const float> positions;  ///< [A,3] of anchors
  std::span<const float> centres;    ///< [A,K,3] of slots
  uint32_t gaussians = 1;            ///< K
  double voxel = 1e-3;               ///< metres, > 0
  uint64_t window = 100;             ///< steps since the last event
  uint64_t most_new = UINT64_MAX;
  uint64_t seed = 0;
  uint64_t iteration = 0;
  /// [A] by which gradients are multiplied, for growth by levels; empty: 1.
  std::span<const float> weights = {};
};

/// A place that gets an anchor.
struct GrownAnchor {
  std::array<float, 3> position;       ///< the middle of a cell
  float length = 0;                    ///< side of the cell, metres
  std::vector<uint32_t> sources = {};  ///< anchors whose splats asked for it, ascending, each once
};

/// Cells in which splats are pulled at and no anchor stands. Where there would be too many, those
/// that are pulled at most come first.
/// Determinism: the same for any number of threads. Cost: O(A K log(A K)).
/// Source: Scaffold-GS (CVPR 2024), section 3.4 and its released program. Differs: without the
/// released program's quirk that finer cells wait until a coarser one has got an anchor.
std::vector<GrownAnchor> grownAnchors(const AnchorGround& ground,
                                      const AnchorStatistics& statistics,
                                      const AnchorGrowthOptions& options = {});

/// Anchors that stay: all that were seen too seldom to judge, and those whose splats are not faint.
/// Out: statistics: what was judged begins anew.
std::vector<uint32_t> lastingAnchors(uint64_t window, AnchorStatistics& statistics,
                                     const AnchorGrowthOptions& options = {});

}  // namespace stipple
