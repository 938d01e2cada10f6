#pragma once

#include <cstdint>
#include <vector>

#include "math/vec.h"
#include "splat/edit/hole_raster.h"
#include "splat/edit/patch_quilt.h"

namespace stipple {

/// What the colours of copies have to change by, so that light goes on through a hole as it comes
/// in from its edge: within a patch as it was copied, from patch to patch and to the ground around
/// without a step. Only what is wider than a patch counts; the texture stays.
/// In: looks: of each cell by the ground that is left. sources: of quiltSources(). reach: cells on
/// each side of a patch's middle.
/// Out: [cells] colours to add, as stored; 0 where nothing is copied.
/// Based on: Perez, Gangnet and Blake, Poisson Image Editing, SIGGRAPH 2003, equation 7. Differs:
/// of means over a patch's width; many patches, each with steps of its own; a step larger than
/// light makes counts less. Determinism: the same bits for any number of threads. Cost: O(cells of
/// the hole x its width in cells).
std::vector<Vec3d> levelledColours(const HoleRaster& raster, const std::vector<CellLook>& looks,
                                   const std::vector<uint32_t>& sources, size_t reach);

}  // namespace stipple
