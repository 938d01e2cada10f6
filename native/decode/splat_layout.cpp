#include "decode/splat_layout.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 128;
/// Offsets reach 1.5 times half the spread.
constexpr double kReach = 1.5;
/// Standard deviations are at least this, in the anchor's unit.
constexpr float kLeastScale = 0.0009f;
constexpr float kRotationShare = 0.1f;
/// Below this a quaternion has no direction.
constexpr float kLeastLength = 1e-6f;

/// softplus(x) = y at x = log(exp(y) - 1).
double inverseSoftplus(double y) {
  return std::log(std::expm1(y));
}

const float kSpreadBias = static_cast<float>(inverseSoftplus(kLatticeSide));
const float kScaleBias = static_cast<float>(inverseSoftplus(kLatticeScale));
const float kOpacityBias = static_cast<float>(std::log(0.1 / 0.9));

float softplus(float x) {
  return std::max(x, 0.0f) + std::log1p(std::exp(-std::abs(x)));
}

/// Its derivative; held where exp would leave float32.
float logistic(float x) {
  return 1.0f / (1.0f + std::exp(-std::clamp(x, -80.0f, 80.0f)));
}

double radicalInverse(uint32_t index, uint32_t base) {
  double inverse = 0, digit = 1.0 / base;
  for (; index > 0; index /= base, digit /= base) inverse += digit * (index % base);
  return inverse;
}

}  // namespace

std::vector<float> usualLattice(uint32_t gaussians) {
  std::vector<float> lattice;
  for (uint32_t k = 0; k < gaussians; ++k) {
    const std::array<double, 3> place = {static_cast<double>(k) / gaussians, radicalInverse(k, 2),
                                         radicalInverse(k, 3)};
    for (const double p : place) {
      lattice.push_back(static_cast<float>(std::atanh((2 * p - 1) / kReach)));
    }
  }
  return lattice;
}

float usualSpread() {
  return kSpreadBias;
}

void activateSplats(const SplatLayout& layout, const LayoutAnchors& anchors, const float* raw,
                    size_t stride, SplatCloud& cloud, const SplatBiases* biases) {
  const std::vector<float> own_lattice =
      biases != nullptr ? std::vector<float>() : usualLattice(layout.gaussians);
  const std::span<const float> lattice = biases != nullptr ? biases->lattice : own_lattice;
  const float spread_bias = biases != nullptr ? biases->spread : usualSpread();
  const size_t higher = layout.higherCoefficients();
  cloud.sh_degree = layout.sh_degree;
  cloud.resize(anchors.units.size() * layout.gaussians);
  const size_t sh_stride = cloud.shStride();
  parallelFor(anchors.units.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const float* from = raw + i * stride;
      const float unit = anchors.units[i];
      for (size_t k = 0; k < layout.gaussians; ++k) {
        const size_t n = i * layout.gaussians + k;
        const float spread = softplus(from[layout.spread(k)] + spread_bias);
        for (size_t axis = 0; axis < 3; ++axis) {
          const float turn = std::tanh(from[layout.centre(k) + axis] + lattice[k * 3 + axis]);
          cloud.positions[n * 3 + axis] = anchors.positions[i * 3 + axis] +
                                          static_cast<float>(0.5 * kReach) * turn * spread * unit;
          const float scale = softplus(from[layout.scale(k) + axis] + kScaleBias);
          cloud.scales[n * 3 + axis] = unit * std::sqrt(scale * scale + kLeastScale * kLeastScale);
          cloud.sh[n * sh_stride + axis] = from[layout.colour(k) + axis];
        }
        float* q = &cloud.rotations[n * 4];
        float squared = 0;
        for (size_t c = 0; c < 4; ++c) {
          q[c] = kRotationShare * from[layout.rotation(k) + c] + (c == 0 ? 1.0f : 0.0f);
          squared += q[c] * q[c];
        }
        const float length = std::sqrt(squared);
        if (length < kLeastLength) {
          std::fill_n(q, 4, 0.0f);
          q[0] = 1.0f;
        } else {
          for (size_t c = 0; c < 4; ++c) q[c] /= length;
        }
        cloud.opacities[n] = logistic(from[layout.opacity(k)] + kOpacityBias);
        std::copy_n(from + layout.higher(k), higher, &cloud.sh[n * sh_stride] + 3);
      }
    }
  });
}

void activateSplatsBackward(const SplatLayout& layout, const LayoutAnchors& anchors,
                            const float* raw, size_t stride, const SplatCloud& cloud,
                            const SplatCloud& gradient, float* raw_gradient) {
  const std::vector<float> lattice = usualLattice(layout.gaussians);
  const size_t higher = layout.higherCoefficients();
  const size_t sh_stride = cloud.shStride();
  parallelFor(anchors.units.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const float* from = raw + i * stride;
      float* to = raw_gradient + i * stride;
      const float unit = anchors.units[i];
      for (size_t k = 0; k < layout.gaussians; ++k) {
        const size_t n = i * layout.gaussians + k;
        const float spread_sum = from[layout.spread(k)] + kSpreadBias;
        const float reach = static_cast<float>(0.5 * kReach) * unit;
        const float spread = softplus(spread_sum);
        float by_spread = 0;
        for (size_t axis = 0; axis < 3; ++axis) {
          const float turn = std::tanh(from[layout.centre(k) + axis] + lattice[k * 3 + axis]);
          const float by_position = gradient.positions[n * 3 + axis] * reach;
          to[layout.centre(k) + axis] = by_position * spread * (1.0f - turn * turn);
          by_spread += by_position * turn;
          const float scale_sum = from[layout.scale(k) + axis] + kScaleBias;
          const float scale = softplus(scale_sum);
          to[layout.scale(k) + axis] = gradient.scales[n * 3 + axis] * unit * scale /
                                       std::sqrt(scale * scale + kLeastScale * kLeastScale) *
                                       logistic(scale_sum);
          to[layout.colour(k) + axis] = gradient.sh[n * sh_stride + axis];
        }
        to[layout.spread(k)] = by_spread * logistic(spread_sum);
        // Not the cloud's, which may have been turned since.
        std::array<float, 4> stored;
        float squared = 0, along = 0;
        for (size_t c = 0; c < 4; ++c) {
          stored[c] = kRotationShare * from[layout.rotation(k) + c] + (c == 0 ? 1.0f : 0.0f);
          squared += stored[c] * stored[c];
          along += gradient.rotations[n * 4 + c] * stored[c];
        }
        const float length = std::sqrt(squared);
        for (size_t c = 0; c < 4; ++c) {
          const float across =
              gradient.rotations[n * 4 + c] - along * stored[c] / std::max(squared, 1e-12f);
          to[layout.rotation(k) + c] =
              length < kLeastLength ? 0.0f : kRotationShare * across / length;
        }
        const float opacity = cloud.opacities[n];
        to[layout.opacity(k)] = gradient.opacities[n] * opacity * (1.0f - opacity);
        std::copy_n(&gradient.sh[n * sh_stride] + 3, higher, to + layout.higher(k));
      }
    }
  });
}

}  // namespace stipple
