#pragma once

#include <span>
#include <string>
#include <vector>

#include "data/meshes/tri_mesh.h"
#include "math/camera.h"
#include "math/vec.h"

namespace stipple::test {

/// A camera at `direction` from `target`, looking at it, that shows a sphere of `radius` around it.
Camera viewFrom(const Vec3d& direction, const Vec3d& target, double radius, uint32_t size_px,
                CameraModel model);

/// Pixels whose centre is covered by a triangle, [H,W] 0 or 1, in double.
std::vector<uint8_t> rasterise(const TriMesh& mesh, const Camera& camera);

/// Euclidean distance in pixels to the nearest pixel whose mask equals `value`, [H,W].
/// Based on: Felzenszwalb, Huttenlocher, Distance Transforms of Sampled Functions, ToC 2012.
std::vector<double> distanceTo(const std::vector<uint8_t>& mask, uint8_t value, uint32_t width,
                               uint32_t height);

/// How an alpha picture keeps to a silhouette. Distances are in units of max(2 px, spacing_px).
struct SilhouetteFit {
  double min_inside = 1;     ///< smallest alpha more than one unit inside
  double open_share = 0;     ///< share of those pixels below 0.98
  double mean_outside = 0;   ///< mean alpha one to two units outside
  double max_beyond = 0;     ///< largest alpha more than three units outside
  size_t inside_count = 0;   ///< pixels more than one unit inside
  size_t outside_count = 0;  ///< pixels one to two units outside
};
SilhouetteFit measureFit(const std::vector<uint8_t>& mask, std::span<const float> alpha,
                         uint32_t width, uint32_t height, double spacing_px);

}  // namespace stipple::test
