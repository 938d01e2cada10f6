#include <algorithm>
#include <cmath>

#include "math/affine.h"
#include "math/spherical_harmonics_gradient.h"
#include "splat/blend_backward.h"
#include "splat/cpu/back_projector.h"
#include "splat/projection_backward.h"
#include "splat/scene_backward.h"

namespace stipple {

namespace {

template <typename T>
T loadLanes(const double* values) {
  return *values;
}

void storeLanes(double value, double* out) {
  *out = value;
}

template <typename T>
constexpr size_t laneCount() {
  return 1;
}

template <typename T>
void takeFootprintBack(const View<double>& view, const Mat3d& linear, const T* centre,
                       const SplatGeometry<T>& splat, LowPass low_pass,
                       const FootprintGradient<T>& by, ProjectionGradient<T>& out) {
  projectBackwardSteps(view, linear, centre, splat, low_pass, by, out);
}

void takeHarmonicsBack(const PlacedCloud& placed, const double* basis, const double* slopes,
                       const float* sh, const float* by_colour, float* by_sh, double* along);

#include "splat/cpu/back_projector-inl.h"

/// In: basis [coefficient], slopes [coefficient][axis], all kMaxLanes apart; sh of the row. Out:
/// by_sh of the row; along [axis] by the viewing direction, kMaxLanes apart.
void takeHarmonicsBack(const PlacedCloud& placed, const double* basis, const double* slopes,
                       const float* sh, const float* by_colour, float* by_sh, double* along) {
  const size_t coefficients = shCoefficientCount(placed.sh_degree);
  double by_sum[3];
  double by_axis[3] = {};
  for (size_t c = 0; c < 3; ++c) {
    double sum = 0.5 + basis[0] * static_cast<double>(sh[c]);
    double sums[3] = {};
    for (size_t k = 1; k < coefficients; ++k) {
      const double value = static_cast<double>(sh[k * 3 + c]);
      sum += basis[k * kMaxLanes] * value;
      for (size_t axis = 0; axis < 3; ++axis) {
        sums[axis] += slopes[(k * 3 + axis) * kMaxLanes] * value;
      }
    }
    by_sum[c] = colourSumBackward(placed, sum, static_cast<double>(by_colour[c]));
    for (size_t axis = 0; axis < 3; ++axis) by_axis[axis] += by_sum[c] * sums[axis];
  }
  for (size_t axis = 0; axis < 3; ++axis) along[axis * kMaxLanes] = by_axis[axis];
  for (size_t k = 0; k < coefficients; ++k) {
    const double value = basis[k * kMaxLanes];
    for (size_t c = 0; c < 3; ++c) {
      by_sh[k * 3 + c] =
          static_cast<float>(std::clamp(value * by_sum[c], -kLargestStored, kLargestStored));
    }
  }
  std::fill(by_sh + coefficients * 3, by_sh + placed.cloud->shStride(), 0.0f);
}

}  // namespace

void takeBackScalar(const PlacedScene& scene, const PlacedCloud& placed, const uint32_t* rows,
                    size_t count, const CloudSums& sums, SplatGradients& out, double* means,
                    double* camera) {
  takeBackRows<double>(scene, placed, rows, count, sums, out, means, camera);
}

}  // namespace stipple
