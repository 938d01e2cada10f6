#pragma once

#include <cstddef>
#include <vector>

#include "base/progress.h"
#include "decode/surface_index.h"
#include "decode/surface_sites.h"

namespace stipple {

/// Flat Gaussians on the surface, one per site, in the unit cube.
struct SplatShapes {
  std::vector<float> centres;    ///< [N,3]
  std::vector<float> normals;    ///< [N,3] unit
  std::vector<float> majors;     ///< [N,3] unit, at right angles to the normal
  std::vector<float> sigmas;     ///< [N,3] along major, along normal × major, along normal
  std::vector<float> areas;      ///< [N] of the patch
  std::vector<float> colours;    ///< [N,3] scene linear
  std::vector<float> opacities;  ///< [N] of the surface
  std::vector<float> supports;   ///< [N] share of a disc around the splat that is surface, 0..1

  size_t size() const { return areas.size(); }
};

/// Moves every site to the middle of its patch, on the surface.
void centreSites(const SurfaceIndex& index, const SurfacePatches& patches, SurfaceSites& sites);

/// Centre, axes, colour of each patch from its moments; sizes that close a regular pattern.
SplatShapes fitShapes(const SurfaceIndex& index, const SurfaceSites& sites,
                      const SurfacePatches& patches);

/// Narrows splats at open borders across the border, and moves them inwards.
void trimBorders(const SurfaceSites& sites, SplatShapes& shapes);

/// Evaluates the opacity that the splats reach together at the samples and scales splats up where
/// it is too low, down where it is more than enough.
void balanceCoverage(const SurfaceIndex& index, const SurfaceSites& sites,
                     const SurfacePatches& patches, SplatShapes& shapes, Progress* progress);

}  // namespace stipple
