#include <algorithm>
#include <cmath>

#include "math/affine.h"
#include "math/spherical_harmonics_gradient.h"
#include "splat/cpu/back_projector.h"
#include "splat/render/blend_backward.h"
#include "splat/render/projection_backward.h"
#include "splat/render/scene_backward.h"

namespace stipple {

namespace {

template <typename T>
T loadLanes(const double* values) {
  return *values;
}

void storeLanes(double value, double* out) {
  *out = value;
}

void storeLanes(double value, float* out) {
  *out = static_cast<float>(value);
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

void loadGeometry(const SplatCloud& cloud, size_t row, SplatGeometry<double>& splat) {
  for (size_t k = 0; k < 3; ++k) {
    splat.position[k] = static_cast<double>(cloud.positions[row * 3 + k]);
    splat.scales[k] = static_cast<double>(cloud.scales[row * 3 + k]);
  }
  for (size_t k = 0; k < 4; ++k) {
    splat.rotation[k] = static_cast<double>(cloud.rotations[row * 4 + k]);
  }
  splat.opacity = static_cast<double>(cloud.opacities[row]);
}

void storeGradient(const ProjectionGradient<double>& gradient, size_t row, SplatGradients& out) {
  for (size_t k = 0; k < 3; ++k) {
    out.positions[row * 3 + k] = static_cast<float>(gradient.position[k]);
    out.scales[row * 3 + k] = static_cast<float>(gradient.scales[k]);
  }
  for (size_t k = 0; k < 4; ++k) {
    out.rotations[row * 4 + k] = static_cast<float>(gradient.rotation[k]);
  }
  out.opacities[row] = static_cast<float>(gradient.opacity);
}

#include "splat/cpu/back_projector-inl.h"

void sumHarmonicsBack(const PlacedCloud& placed, const HarmonicColumns& harmonics, size_t lane,
                      const float* sh, const float* by_colour, float* by_sum, double* along) {
  const size_t coefficients = shCoefficientCount(placed.sh_degree);
  double sums[3];
  double slopes[3][3] = {};  // [channel][axis]
  for (size_t c = 0; c < 3; ++c) {
    sums[c] = 0.5 + harmonics.basis[0][lane] * static_cast<double>(sh[c]);
    for (size_t k = 1; k < coefficients; ++k) {
      const double value = static_cast<double>(sh[k * 3 + c]);
      sums[c] += harmonics.basis[k][lane] * value;
      for (size_t axis = 0; axis < 3; ++axis) {
        slopes[c][axis] += harmonics.slopes[k][axis][lane] * value;
      }
    }
  }
  double by[3];
  colourSumsBackward(placed, sums, by_colour, by);
  double by_axis[3] = {};
  for (size_t c = 0; c < 3; ++c) {
    for (size_t axis = 0; axis < 3; ++axis) by_axis[axis] += by[c] * slopes[c][axis];
    by_sum[c] = static_cast<float>(by[c]);
  }
  for (size_t axis = 0; axis < 3; ++axis) along[axis * kMaxLanes] = by_axis[axis];
}

void storeHarmonicsBack(const PlacedCloud& placed, const HarmonicColumns& harmonics, size_t lane,
                        const float* by_sum, float* by_sh) {
  const size_t coefficients = shCoefficientCount(placed.sh_degree);
  for (size_t k = 0; k < coefficients; ++k) {
    for (size_t c = 0; c < 3; ++c) {
      by_sh[k * 3 + c] = harmonics.stored_basis[k][lane] * by_sum[c];
    }
  }
  std::fill(by_sh + coefficients * 3, by_sh + placed.cloud->shStride(), 0.0f);
}

}  // namespace

void takeBackScalar(const PlacedScene& scene, const PlacedCloud& placed, const SummedRows& rows,
                    SplatGradients& out, double* means, double* camera) {
  takeBackRows<double>(scene, placed, rows, out, means, camera);
}

}  // namespace stipple
