#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "train/backend/view_pass.h"
#include "train/networks/density_autoencoder.h"

// What examples that are compared with views have in common.

namespace stipple {

/// Of `count` views, `wanted` different ones, keyed by the seed, in the order in which they are
/// drawn; all where there are no more.
std::vector<size_t> drawnViews(size_t count, size_t wanted, uint64_t seed);

/// Derivatives by the stored values of a cloud that are all 0.
SplatCloud zerosLike(const SplatCloud& cloud);
/// Adds `factor` times the derivatives that a view gave.
void addCloud(const SplatCloud& of_view, double factor, SplatCloud& sum);

/// Draws splats before white or black, and adds `factor` times the derivatives of L1 and `ssim`
/// times 1 - SSIM of the view. The pass keeps the statistics that are asked for. In: by_view:
/// memory that is used again. Out: sum.
ImageLossValue addViewLoss(ViewPass& pass, const ObjectView& view, bool is_white,
                           const SplatCloud& cloud, const StatisticRequest& request, double ssim,
                           double factor, SplatCloud& by_view, SplatCloud& sum, Progress* progress);

}  // namespace stipple
