#pragma once

#include "nn/feature_map.h"
#include "nn/network_run.h"

namespace stipple {

/// The largest number of each channel in windows of `window` x `window` pixels, `stride` apart;
/// rows and columns at the end that fill no window are left out.
/// Errors: kInvalidArgument for a map smaller than a window and for sizes of 0.
/// Threads and determinism: parallel over rows; same bits for any number of threads.
FeatureMap maxPool(const NetworkRun& run, const FeatureMap& map, size_t window, size_t stride);

}  // namespace stipple
