#include "decode/anchors/hex_planes.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 512;
constexpr size_t kPairs = 6;
constexpr uint32_t kTime = 3;
constexpr std::array<std::array<uint32_t, 2>, kPairs> kAxes = {
    {{0, 1}, {0, 2}, {0, kTime}, {1, 2}, {1, kTime}, {2, kTime}}};
constexpr uint32_t kMostTexels = 4096;

/// Of planes of space at the start: products of three are about 1, so that networks see them.
constexpr float kLeastAtStart = 0.6f;
constexpr float kSpreadAtStart = 0.8f;

/// Weights of the regularisers.
constexpr double kSmoothSpace = 2e-4;
constexpr double kSmoothTime = 1e-3;
constexpr double kSteadyTime = 1e-4;

/// Where a number is read between two texels.
struct Reading {
  uint32_t at;
  float share;  ///< of the texel behind it
};

/// In: where, 0..1 of the axis, held to it.
Reading readingOf(double where, uint32_t texels) {
  const double scaled = std::clamp(where, 0.0, 1.0) * (texels - 1);
  const auto at = static_cast<uint32_t>(std::min(scaled, static_cast<double>(texels - 2)));
  return {at, static_cast<float>(scaled - at)};
}

bool hasTime(const HexPlane& plane) {
  return plane.second == kTime;
}

/// Four texels and what each counts.
struct Corners {
  std::array<size_t, 4> at;  ///< first number of the texel
  std::array<float, 4> weights;
};

Corners cornersOf(const HexPlaneShape& shape, const HexPlane& plane, const float* place,
                  double tau) {
  const auto along = [&](uint32_t axis, uint32_t texels) {
    if (axis == kTime) return readingOf(0.5 * (tau + 1), texels);
    const double span = shape.highest[axis] - shape.lowest[axis];
    return readingOf((static_cast<double>(place[axis]) - shape.lowest[axis]) / span, texels);
  };
  const Reading x = along(plane.first, plane.width);
  const Reading y = along(plane.second, plane.height);
  const size_t row = size_t{plane.width} * shape.channels;
  const size_t corner = y.at * row + x.at * size_t{shape.channels};
  return {{corner, corner + shape.channels, corner + row, corner + row + shape.channels},
          {(1 - x.share) * (1 - y.share), x.share * (1 - y.share), (1 - x.share) * y.share,
           x.share * y.share}};
}

void requireShape(const HexPlaneShape& shape) {
  const auto within = [](const char* what, uint64_t value, uint64_t least, uint64_t most) {
    if (value >= least && value <= most) return;
    fail(ErrorCode::kInvalidArgument, "planes have " + std::to_string(value) + " " + what + "; " +
                                          std::to_string(least) + " to " + std::to_string(most) +
                                          " is allowed");
  };
  within("texels", shape.texels, 2, kMostTexels);
  within("moments", shape.moments, 2, kMostTexels);
  within("channels", shape.channels, 1, 64);
  within("scales", shape.multipliers.size(), 1, 8);
  for (const uint32_t multiplier : shape.multipliers) {
    within("times as many texels", multiplier, 1, kMostTexels / shape.texels);
  }
  for (size_t axis = 0; axis < 3; ++axis) {
    if (std::isfinite(shape.lowest[axis]) && std::isfinite(shape.highest[axis]) &&
        shape.highest[axis] > shape.lowest[axis]) {
      continue;
    }
    fail(ErrorCode::kInvalidArgument, "planes have no size along axis " + std::to_string(axis));
  }
}

}  // namespace

std::vector<uint64_t> planeSizes(const HexPlaneShape& shape) {
  requireShape(shape);
  std::vector<uint64_t> sizes;
  for (const uint32_t multiplier : shape.multipliers) {
    for (const auto& [first, second] : kAxes) {
      const uint64_t side = uint64_t{shape.texels} * multiplier;
      sizes.push_back(side * (second == kTime ? shape.moments : side) * shape.channels);
    }
  }
  return sizes;
}

HexPlanes::HexPlanes(const HexPlaneShape& shape) : shape_(shape) {
  requireShape(shape);
  uint64_t number = 0;
  for (const uint32_t multiplier : shape.multipliers) {
    for (const auto& [first, second] : kAxes) {
      HexPlane plane;
      plane.first = first;
      plane.second = second;
      plane.width = shape.texels * multiplier;
      plane.height = second == kTime ? shape.moments : shape.texels * multiplier;
      plane.values.assign(size_t{plane.width} * plane.height * shape.channels, 1.0f);
      if (second != kTime) {
        for (float& value : plane.values) {
          value =
              kLeastAtStart +
              kSpreadAtStart * unitFloat(keyedBits(shape.seed, RandomUse::kFieldStart, number++));
        }
      }
      planes_.push_back(std::move(plane));
    }
  }
}

std::vector<std::vector<float>> HexPlanes::zeros() const {
  std::vector<std::vector<float>> zeros;
  for (const HexPlane& plane : planes_) zeros.emplace_back(plane.values.size(), 0.0f);
  return zeros;
}

void HexPlanes::forward(std::span<const float> places, double tau, std::span<float> features,
                        HexPlaneTape& tape) const {
  const size_t count = places.size() / 3;
  const size_t channels = shape_.channels;
  const size_t width = featureWidth();
  tape.tau = tau;
  tape.samples.resize(planes_.size() * count * channels);
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      float* to = &features[i * width];
      std::fill_n(to, width, 1.0f);
      for (size_t p = 0; p < planes_.size(); ++p) {
        const Corners corners = cornersOf(shape_, planes_[p], &places[i * 3], tau);
        float* sample = &tape.samples[(p * count + i) * channels];
        for (size_t c = 0; c < channels; ++c) {
          float sum = 0;
          for (size_t k = 0; k < 4; ++k) {
            sum += corners.weights[k] * planes_[p].values[corners.at[k] + c];
          }
          sample[c] = sum;
          to[p / kPairs * channels + c] *= sum;
        }
      }
    }
  });
}

void HexPlanes::backward(std::span<const float> places, const HexPlaneTape& tape,
                         std::span<const float> gradient,
                         std::vector<std::vector<float>>& by_planes) const {
  const size_t count = places.size() / 3;
  const size_t channels = shape_.channels;
  const size_t width = featureWidth();
  // Each plane is one thread's, so that sums have one order.
  parallelFor(planes_.size(), 1, [&](size_t begin, size_t end) {
    for (size_t p = begin; p < end; ++p) {
      const size_t scale = p / kPairs;
      for (size_t i = 0; i < count; ++i) {
        const Corners corners = cornersOf(shape_, planes_[p], &places[i * 3], tape.tau);
        for (size_t c = 0; c < channels; ++c) {
          float by_sample = gradient[i * width + scale * channels + c];
          for (size_t q = scale * kPairs; q < (scale + 1) * kPairs; ++q) {
            if (q != p) by_sample *= tape.samples[(q * count + i) * channels + c];
          }
          for (size_t k = 0; k < 4; ++k) {
            by_planes[p][corners.at[k] + c] += corners.weights[k] * by_sample;
          }
        }
      }
    }
  });
}

double HexPlanes::regularise(std::vector<std::vector<float>>& by_planes) const {
  std::vector<double> sums(planes_.size(), 0.0);
  parallelFor(planes_.size(), 1, [&](size_t begin, size_t end) {
    for (size_t p = begin; p < end; ++p) {
      const HexPlane& plane = planes_[p];
      std::vector<float>& by = by_planes[p];
      const size_t row = size_t{plane.width} * shape_.channels;
      if (plane.height > 2) {
        const double count = static_cast<double>((plane.height - 2) * row);
        const double weight = (hasTime(plane) ? kSmoothTime : kSmoothSpace) / count;
        for (size_t i = row; i < plane.values.size() - row; ++i) {
          const double bend = static_cast<double>(plane.values[i - row]) -
                              2 * static_cast<double>(plane.values[i]) +
                              static_cast<double>(plane.values[i + row]);
          sums[p] += weight * bend * bend;
          const auto pull = static_cast<float>(2 * weight * bend);
          by[i - row] += pull;
          by[i] -= 2 * pull;
          by[i + row] += pull;
        }
      }
      if (!hasTime(plane)) continue;
      const double weight = kSteadyTime / static_cast<double>(plane.values.size());
      for (size_t i = 0; i < plane.values.size(); ++i) {
        const double apart = static_cast<double>(plane.values[i]) - 1;
        sums[p] += weight * std::abs(apart);
        by[i] += static_cast<float>(apart > 0 ? weight : apart < 0 ? -weight : 0.0);
      }
    }
  });
  double sum = 0;
  for (const double one : sums) sum += one;
  return sum;
}

}  // namespace stipple
