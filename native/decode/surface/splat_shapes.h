#pragma once

#include <cstddef>
#include <vector>

#include "base/progress.h"
#include "decode/surface/surface_borders.h"
#include "decode/surface/surface_index.h"
#include "decode/surface/surface_sites.h"
#include "decode/surface/tangent_frame.h"

namespace stipple {

/// Flat Gaussians on the surface, one per site, in the unit cube.
struct SplatShapes {
  std::vector<float> centres;     ///< [N,3]
  std::vector<float> normals;     ///< [N,3] unit
  std::vector<float> majors;      ///< [N,3] unit, at right angles to the normal
  std::vector<float> sigmas;      ///< [N,3] along major, along normal × major, along normal
  std::vector<float> areas;       ///< [N] of the patch
  std::vector<float> colours;     ///< [N,3] scene linear
  std::vector<float> opacities;   ///< [N] of the surface
  std::vector<float> curvatures;  ///< [N] mean curvature; positive: the normal is on the outer side
  std::vector<float> growths;     ///< [N] 0..1: how much of a wanted growth the curvature permits
  /// [N,2,5] up to two borders near the splat: unit direction to it in the tangent plane, distance
  /// to it along that direction (infinity: none), largest standard deviation in that direction.
  std::vector<float> borders;

  size_t size() const { return areas.size(); }
};

/// Writes the axes and in-plane standard deviations of shape i from a covariance in the frame of
/// its normal.
void setAxes(SplatShapes& shapes, size_t i, const TangentFrame& frame, double uu, double uv,
             double vv);

/// Moves every site to the middle of its patch, on the surface.
void centreSites(const SurfaceIndex& index, const SurfacePatches& patches, SurfaceSites& sites);

/// Centre, axes, colour of each patch from its moments; sizes that close a regular pattern.
SplatShapes fitShapes(const SurfaceIndex& index, const SurfaceSites& sites,
                      const SurfacePatches& patches);

/// Means [N,harmonic_stride] of the harmonics of each patch, weighted as its colours are.
std::vector<float> patchHarmonics(const SurfaceIndex& index, const SurfaceSites& sites,
                                  const SurfacePatches& patches);

/// Finds the borders near each splat, and rounds those that have none: moments of few samples
/// exaggerate the difference between the axes.
void findNearBorders(const SurfaceBorders& borders, const SurfaceSites& sites, SplatShapes& shapes);

/// Evaluates the opacity that the splats reach together at the samples and scales splats up where
/// it is too low, down where it is more than enough; narrows those that grow over a border.
void balanceCoverage(const SurfaceIndex& index, const SurfaceSites& sites,
                     const SurfacePatches& patches, SplatShapes& shapes, Progress* progress);

}  // namespace stipple
