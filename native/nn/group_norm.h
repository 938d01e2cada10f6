#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "data/weight_table.h"
#include "nn/feature_map.h"
#include "nn/network_run.h"

namespace stipple {

/// out = (in - mean) * factor + shift, for each channel.
struct ChannelNorm {
  std::vector<float> mean, factor, shift;  ///< [channels]
};

/// A group normalisation of a file: mean and variance are those of all pixels of a group of
/// neighbouring channels, the affine part is a channel's own.
class GroupNorm {
 public:
  GroupNorm() = default;
  /// Reads `name`.weight and `name`.bias. In: channels: a multiple of groups. Errors: kFormat.
  GroupNorm(const WeightTable& weights, const std::string& name, size_t channels, size_t groups,
            float epsilon);

  /// What normalises this map, so that the map itself can stay as it is: whoever reads it applies
  /// it (Convolution::apply()).
  /// Numbers: sums in double, the variance with 1 / n. Errors: kCancelled.
  /// Threads and determinism: parallel; same bits for any number of threads.
  ChannelNorm of(const NetworkRun& run, const FeatureMap& map) const;

 private:
  size_t groups_ = 1;
  float epsilon_ = 0.0f;
  std::vector<float> weight_, bias_;
};

/// In: in [pixels, channels of the norm]. Out: out, likewise; it may be `in`. On this thread.
void normalise(const ChannelNorm& norm, size_t pixels, const float* in, float* out);

}  // namespace stipple
