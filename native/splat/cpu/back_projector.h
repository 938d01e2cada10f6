#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "splat/render_backward.h"
#include "splat/scene.h"

namespace stipple {

/// Sums over tiles (splat/blend_backward.h) of a cloud's splats, row by row.
struct CloudSums {
  const float* values;  ///< [rows][stride]
  size_t stride;
  std::optional<size_t> depth_field;  ///< dL/d(depth of the splat)
};

/// A float32 of any double is held to the largest that is finite.
constexpr double kLargestStored = 3.4e38;

/// Takes projection and colours of some rows [count] of one cloud back. Out: those rows of `out`
/// (positions, rotations, scales, opacities, sh), each written whole; means [count,2] by the
/// projected centre, per pixel. Adds to camera [6], as BackwardResult::camera, row after row.
using BackProjector = void (*)(const PlacedScene& scene, const PlacedCloud& placed,
                               const uint32_t* rows, size_t count, const CloudSums& sums,
                               SplatGradients& out, double* means, double* camera);

struct NamedBackProjector {
  const char* target;  ///< as NamedTileKernel::target
  BackProjector take_back;
};

/// One splat after another; the vector targets give the same bits.
void takeBackScalar(const PlacedScene& scene, const PlacedCloud& placed, const uint32_t* rows,
                    size_t count, const CloudSums& sums, SplatGradients& out, double* means,
                    double* camera);

/// As chosenTileKernel() and tileKernels().
BackProjector chosenBackProjector();
std::vector<NamedBackProjector> backProjectors();

}  // namespace stipple
