#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "splat/render/render_backward.h"
#include "splat/render/scene.h"

namespace stipple {

/// Some rows of one cloud and their sums over tiles (splat/render/blend_backward.h).
struct SummedRows {
  const uint32_t* rows;   ///< [count] of the cloud, rising
  const uint32_t* slots;  ///< [count] where the sums of each are
  size_t count;
  const float* sums;  ///< [slots][stride]
  size_t stride;
  std::optional<size_t> depth_field;  ///< dL/d(depth of the splat)

  const float* sumsOf(size_t i) const { return sums + slots[i] * stride; }
};

/// A float32 of any double is held to the largest that is finite.
constexpr double kLargestStored = 3.4e38;

/// Takes projection and colours of some rows of one cloud back. Out: those rows of `out`
/// (positions, rotations, scales, opacities, sh), each written whole; means [count,2] by the
/// projected centre, per pixel. Adds to camera [6], as BackwardResult::camera, row after row.
using BackProjector = void (*)(const PlacedScene& scene, const PlacedCloud& placed,
                               const SummedRows& rows, SplatGradients& out, double* means,
                               double* camera);

struct NamedBackProjector {
  const char* target;  ///< as NamedTileKernel::target
  BackProjector take_back;
};

/// One splat after another; the vector targets give the same bits.
void takeBackScalar(const PlacedScene& scene, const PlacedCloud& placed, const SummedRows& rows,
                    SplatGradients& out, double* means, double* camera);

/// As chosenTileKernel() and tileKernels().
BackProjector chosenBackProjector();
std::vector<NamedBackProjector> backProjectors();

}  // namespace stipple
