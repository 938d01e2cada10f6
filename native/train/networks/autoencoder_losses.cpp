// Based on: DeG, density-sampled Gaussians (arXiv 2605.16355), losses of its released training.
#include "train/networks/autoencoder_losses.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 64;
/// Middles may be that far from the anchor, in radii of the cluster.
constexpr double kFreeShare = 0.5;

double squaredDistance(const float* a, const float* b) {
  double squared = 0;
  for (size_t axis = 0; axis < 3; ++axis) {
    const double offset = static_cast<double>(a[axis]) - static_cast<double>(b[axis]);
    squared += offset * offset;
  }
  return squared;
}

/// The two parts of one anchor, and their derivatives by the cluster's places.
struct Cluster {
  double off_centre = 0, overlap = 0;
};

Cluster addCluster(std::span<const float> anchors, uint32_t gaussians, size_t anchor, double weight,
                   const SplatCloud& cloud, SplatCloud& gradient) {
  const size_t count = anchors.size() / 3, first = anchor * gaussians;
  const float* at = &anchors[anchor * 3];
  const double share = 1.0 / gaussians, anchor_share = 1.0 / static_cast<double>(count);
  std::array<double, 3> middle = {};
  double squares = 0;
  for (size_t n = first; n < first + gaussians; ++n) {
    squares += share * squaredDistance(&cloud.positions[n * 3], at);
    for (size_t axis = 0; axis < 3; ++axis) {
      middle[axis] += share * (static_cast<double>(cloud.positions[n * 3 + axis]) -
                               static_cast<double>(at[axis]));
    }
  }
  const double radius = std::sqrt(squares);
  const double away =
      std::sqrt(middle[0] * middle[0] + middle[1] * middle[1] + middle[2] * middle[2]);
  Cluster found;
  double by_radius = 0, by_away = 0;
  if (away > kFreeShare * radius) {
    found.off_centre = (away - kFreeShare * radius) * anchor_share * anchor_share;
    by_away = weight * anchor_share * anchor_share;
    by_radius -= kFreeShare * by_away;
  }
  for (size_t other = 0; other < count; ++other) {
    if (other == anchor) continue;
    const double distance = std::sqrt(squaredDistance(at, &anchors[other * 3]));
    if (!(radius > distance)) continue;
    found.overlap += (radius - distance) * anchor_share * anchor_share;
    by_radius += weight * anchor_share * anchor_share;
  }
  for (size_t n = first; n < first + gaussians; ++n) {
    for (size_t axis = 0; axis < 3; ++axis) {
      const double offset =
          static_cast<double>(cloud.positions[n * 3 + axis]) - static_cast<double>(at[axis]);
      double by = 0;
      if (radius > 0) by += by_radius * share * offset / radius;
      if (away > 0) by += by_away * share * middle[axis] / away;
      gradient.positions[n * 3 + axis] += static_cast<float>(by);
    }
  }
  return found;
}

}  // namespace

SplatLosses addSplatLosses(const SplatLossWeights& weights, double factor,
                           std::span<const float> anchors, uint32_t gaussians,
                           const SplatCloud& cloud, SplatCloud& gradient) {
  SplatLosses losses;
  const double share = 1.0 / static_cast<double>(cloud.size());
  double opacities = 0;
  for (size_t n = 0; n < cloud.size(); ++n) {
    std::array<double, 3> scale;
    for (size_t axis = 0; axis < 3; ++axis) {
      scale[axis] = static_cast<double>(cloud.scales[n * 3 + axis]);
    }
    losses.volume += share * scale[0] * scale[1] * scale[2];
    for (size_t axis = 0; axis < 3; ++axis) {
      const double others = scale[(axis + 1) % 3] * scale[(axis + 2) % 3];
      gradient.scales[n * 3 + axis] += static_cast<float>(factor * weights.volume * share * others);
    }
    opacities += share * static_cast<double>(cloud.opacities[n]);
    gradient.opacities[n] -= static_cast<float>(factor * weights.opacity * share);
  }
  losses.opacity = 1 - opacities;
  std::vector<Cluster> clusters(anchors.size() / 3);
  parallelFor(clusters.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      clusters[i] = addCluster(anchors, gaussians, i, factor * weights.cluster, cloud, gradient);
    }
  });
  for (const Cluster& cluster : clusters) {
    losses.off_centre += cluster.off_centre;
    losses.overlap += cluster.overlap;
  }
  return losses;
}

double addDivergence(const EncodedLatent& encoded, double count, double weight, EncodedLatent& by) {
  double sum = 0;
  for (size_t i = 0; i < encoded.mean.size(); ++i) {
    const auto mean = static_cast<double>(encoded.mean[i]);
    const auto log_variance = static_cast<double>(encoded.log_variance[i]);
    // exp(v) - 1 - v, of which the first two cancel near 0.
    sum += 0.5 * (mean * mean + std::expm1(log_variance) - log_variance) / count;
    by.mean[i] += static_cast<float>(weight * mean / count);
    by.log_variance[i] += static_cast<float>(weight * 0.5 * std::expm1(log_variance) / count);
  }
  return sum;
}

}  // namespace stipple
