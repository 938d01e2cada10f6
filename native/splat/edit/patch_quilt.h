#pragma once

#include <cstdint>
#include <vector>

#include "math/vec.h"
#include "splat/edit/hole_raster.h"

namespace stipple {

/// What a cell looks like: colour times coverage, as stored, and coverage.
using CellLook = Vec4d;

struct QuiltOptions {
  size_t reach = 4;  ///< cells on each side of a patch's middle: patches are 2 reach + 1 wide
  uint64_t seed = 0;
};

/// For each cell of the hole the solid cell that its splats are copied from; UINT32_MAX for others,
/// and everywhere where there is no solid cell. Patches of neighbouring cells are copied together,
/// from the edge of the hole inwards, each from where it fits best to what is known around it; a
/// patch that goes on with what its neighbour has copied is among the candidates.
/// Based on: Efros and Leung, Texture Synthesis by Non-parametric Sampling, ICCV 1999; Ashikhmin,
/// Synthesizing Natural Textures, I3D 2001. Differs: patches of cells, candidates by keyed random
/// numbers. Determinism: by the seed. Cost: O(cells).
std::vector<uint32_t> quiltSources(const HoleRaster& raster, std::vector<CellLook> looks,
                                   const QuiltOptions& options);

}  // namespace stipple
