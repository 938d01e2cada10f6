#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "data/clouds/splat_cloud.h"
#include "train/networks/trained_encoder.h"

namespace stipple {

/// By which losses of splats count; the defaults are those of the released training.
struct SplatLossWeights {
  double volume = 1;       ///< of the mean of the products of three standard deviations
  double opacity = 0.001;  ///< of one minus the mean of opacities
  double cluster = 100;    ///< of clusters that leave their anchor or reach another
};

/// Each without its weight.
struct SplatLosses {
  double volume = 0, opacity = 0;
  double off_centre = 0;  ///< first part of the cluster's: the middle is far from the anchor
  double overlap = 0;     ///< second part: a radius is larger than the distance to another anchor
};

/// In: cloud: `gaussians` splats for each anchor, in the unit cube as the anchors [P,3] are; factor
/// multiplies all weights. Out: gradient: a cloud of as many splats, by positions, scales and
/// opacities, which this adds to. Cost: O(P^2), in parallel; same bits for any number of threads.
SplatLosses addSplatLosses(const SplatLossWeights& weights, double factor,
                           std::span<const float> anchors, uint32_t gaussians,
                           const SplatCloud& cloud, SplatCloud& gradient);

/// Half the mean of mean^2 + variance - log variance - 1, over `count` numbers in all. Out: by:
/// weight times the derivative, which this adds to.
double addDivergence(const EncodedLatent& encoded, double count, double weight, EncodedLatent& by);

}  // namespace stipple
