// Based on: Zeng, Wang, Ju, Guan, Frequency-Aware Density Control via Reparameterization for
// High-Quality Rendering of 3D Gaussian Splatting, AAAI 2025, and its program.

#include "densify/parts/density_scale.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 14;

/// ln(1 / (1 + exp(-u))).
float logSigmoid(float u) {
  return std::min(u, 0.0f) - std::log1p(std::exp(-std::abs(u)));
}

}  // namespace

std::vector<ExtraParameter> DensityScale::parameters() {
  constexpr double kRate = 5e-3;
  return {{"log_radius", 1, kRate}, {"relative_scale", 3, kRate}};
}

std::vector<std::vector<float>> DensityScale::initialExtras(const RawSplats& splats) {
  std::vector<std::vector<float>> extras(2);
  for (size_t i = 0; i < splats.size(); ++i) {
    const float* logs = &splats.log_scales[i * 3];
    const float log_radius = std::log(2.0f) + std::max(logs[0], std::max(logs[1], logs[2]));
    extras[0].push_back(log_radius);
    for (size_t axis = 0; axis < 3; ++axis) {
      // ln x of x = s / R <= 1/2; u = ln x - ln(1 - x).
      const float log_share = logs[axis] - log_radius;
      extras[1].push_back(log_share - std::log(-std::expm1(log_share)));
    }
  }
  return extras;
}

float DensityScale::logScale(const RawSplats& splats, size_t row, size_t axis) {
  return splats.extras[0][row] + logSigmoid(splats.extras[1][row * 3 + axis]);
}

void DensityScale::activate(const RawSplats& raw, SplatCloud& cloud) const {
  const auto write = [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      for (size_t axis = 0; axis < 3; ++axis) {
        cloud.scales[i * 3 + axis] = activatedScale(logScale(raw, i, axis));
      }
    }
  };
  // By reference: a std::function of a large capture allocates.
  parallelFor(raw.size(), kGrain, std::cref(write));
}

void DensityScale::adjoint(const RawSplats& raw, const SplatCloud& cloud,
                           const CloudGradient& by_cloud, RawSplats& by_raw) const {
  const auto write = [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      float by_radius = 0;
      for (size_t axis = 0; axis < 3; ++axis) {
        const size_t k = i * 3 + axis;
        // ds/d(ln R) = s, ds/du = s (1 - sigmoid(u)) = s sigmoid(-u).
        const float by_log = by_cloud.scales[k] * cloud.scales[k];
        by_radius += by_log;
        by_raw.extras[1][k] = by_log * activatedOpacity(-raw.extras[1][k]);
        by_raw.log_scales[k] = 0;
      }
      by_raw.extras[0][i] = by_radius;
    }
  };
  parallelFor(raw.size(), kGrain, std::cref(write));
}

}  // namespace stipple
