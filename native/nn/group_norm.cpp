// Based on: Y. Wu, K. He, Group Normalization, ECCV 2018, section 3.
#include "nn/group_norm.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kPixelGrain = 2048;

/// Sums of values and of their squares, for each channel.
struct ChannelSums {
  std::vector<double> values, squares;
};

ChannelSums sumChannels(const NetworkRun& run, const FeatureMap& map) {
  const size_t channels = map.channels;
  std::vector<ChannelSums> parts(rangeCount(map.pixelCount(), kPixelGrain));
  parallelFor(map.pixelCount(), kPixelGrain, [&](size_t begin, size_t end) {
    if (run.progress != nullptr) run.progress->throwIfCancelled();
    ChannelSums& part = parts[begin / kPixelGrain];
    part.values.assign(channels, 0.0);
    part.squares.assign(channels, 0.0);
    double* values = part.values.data();
    double* squares = part.squares.data();
    for (size_t pixel = begin; pixel < end; ++pixel) {
      const float* from = map.values.data() + pixel * channels;
      for (size_t c = 0; c < channels; ++c) {
        const auto value = static_cast<double>(from[c]);
        values[c] += value;
        squares[c] += value * value;
      }
    }
  });
  ChannelSums sums = {std::vector<double>(channels, 0.0), std::vector<double>(channels, 0.0)};
  for (const ChannelSums& part : parts) {
    for (size_t c = 0; c < channels; ++c) {
      sums.values[c] += part.values[c];
      sums.squares[c] += part.squares[c];
    }
  }
  return sums;
}

}  // namespace

GroupNorm::GroupNorm(const WeightTable& weights, const std::string& name, size_t channels,
                     size_t groups, float epsilon)
    : groups_(groups),
      epsilon_(epsilon),
      weight_(weights.floats(name + ".weight", {channels})),
      bias_(weights.floats(name + ".bias", {channels})) {
  if (groups == 0 || channels % groups != 0) {
    fail(ErrorCode::kFormat, weights.source() + ": " + name + " has " + std::to_string(channels) +
                                 " channels; a multiple of " + std::to_string(groups) +
                                 " is needed.");
  }
}

ChannelNorm GroupNorm::of(const NetworkRun& run, const FeatureMap& map) const {
  const size_t channels = weight_.size();
  const size_t width = channels / groups_;
  const ChannelSums sums = sumChannels(run, map);
  ChannelNorm norm;
  norm.shift = bias_;
  norm.mean.resize(channels);
  norm.factor.resize(channels);
  const double count = static_cast<double>(width * map.pixelCount());
  for (size_t first = 0; first < channels; first += width) {
    double values = 0.0, squares = 0.0;
    for (size_t c = first; c < first + width; ++c) {
      values += sums.values[c];
      squares += sums.squares[c];
    }
    const double mean = values / count;
    const double variance = std::max(0.0, squares / count - mean * mean);
    const double scale = 1.0 / std::sqrt(variance + static_cast<double>(epsilon_));
    for (size_t c = first; c < first + width; ++c) {
      norm.mean[c] = static_cast<float>(mean);
      norm.factor[c] = static_cast<float>(scale * static_cast<double>(weight_[c]));
    }
  }
  return norm;
}

void normalise(const ChannelNorm& norm, size_t pixels, const float* in, float* out) {
  const size_t channels = norm.mean.size();
  const float* mean = norm.mean.data();
  const float* factor = norm.factor.data();
  const float* shift = norm.shift.data();
  for (size_t pixel = 0; pixel < pixels; ++pixel) {
    for (size_t c = 0; c < channels; ++c) out[c] = (in[c] - mean[c]) * factor[c] + shift[c];
    in += channels;
    out += channels;
  }
}

}  // namespace stipple
