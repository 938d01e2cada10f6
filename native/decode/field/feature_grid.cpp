#include "decode/field/feature_grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 256;
constexpr int kMaxGridLevel = 12;
/// A level whose cells are as large as a footprint counts two thirds, one of a quarter of that a
/// fifth.
constexpr float kFade = 1.25f;

uint64_t cornerCount(int level) {
  const uint64_t side = (uint64_t{1} << level) + 1;
  return side * side * side;
}

bool isHashed(const FeatureLevel& level) {
  return level.row_count < cornerCount(level.level);
}

/// The primes of Instant Neural Graphics Primitives, equation 4.
uint32_t hashOf(uint32_t x, uint32_t y, uint32_t z) {
  return x ^ (y * 2654435761u) ^ (z * 805459861u);
}

/// Blocks of 2x2x2 corners are hashed as one and stand together, so that the corners of a cell lie
/// in few cache lines.
uint32_t hashedRow(const FeatureLevel& level, uint32_t x, uint32_t y, uint32_t z) {
  const uint32_t block = hashOf(x >> 1, y >> 1, z >> 1) & (level.row_count / 8 - 1);
  return block * 8 + (x & 1) + 2 * (y & 1) + 4 * (z & 1);
}

/// Eight corners of the cell around a place, with the weights of trilinear interpolation; corner
/// dx + 2 dy + 4 dz.
struct Corners {
  std::array<uint32_t, 8> rows;
  std::array<float, 8> weights;
  std::array<float, 3> inside;  ///< place in the cell, 0..1
  std::array<uint8_t, 3> held;  ///< 1 where the place is outside the cube and stands at its face
};

Corners cornersOf(const FeatureLevel& level, bool hashed, const float* position) {
  Corners corners;
  const uint32_t side = uint32_t{1} << level.level;
  std::array<uint32_t, 3> low;
  for (size_t axis = 0; axis < 3; ++axis) {
    const float held = std::clamp(position[axis], 0.0f, 1.0f);
    corners.held[axis] = held == position[axis] ? 0 : 1;
    const float scaled = held * static_cast<float>(side);
    low[axis] = std::min(static_cast<uint32_t>(scaled), side - 1);
    corners.inside[axis] = scaled - static_cast<float>(low[axis]);
  }
  for (uint32_t c = 0; c < 8; ++c) {
    const std::array<uint32_t, 3> d = {c & 1, c >> 1 & 1, c >> 2 & 1};
    float weight = 1;
    for (size_t axis = 0; axis < 3; ++axis) {
      weight *= d[axis] != 0 ? corners.inside[axis] : 1.0f - corners.inside[axis];
    }
    corners.weights[c] = weight;
    const uint32_t x = low[0] + d[0], y = low[1] + d[1], z = low[2] + d[2];
    corners.rows[c] = hashed ? hashedRow(level, x, y, z) : x + (side + 1) * (y + (side + 1) * z);
  }
  return corners;
}

/// How much a level counts at a place.
float levelWeight(const FeatureLevel& level, float footprint) {
  const float cell = 1.0f / static_cast<float>(uint32_t{1} << level.level);
  return cell / std::sqrt(cell * cell + kFade * footprint * footprint);
}

}  // namespace

void FeatureGradient::clear(size_t channels) {
  for (const uint32_t row : rows) {
    listed[row] = 0;
    std::fill_n(&values[row * channels], channels, 0.0f);
  }
  rows.clear();
}

FeatureGrid::FeatureGrid(size_t channels, std::span<const int> levels,
                         std::span<const uint32_t> most_rows, float amplitude, uint64_t seed)
    : channels_(channels) {
  uint64_t number = 0;
  for (size_t i = 0; i < levels.size(); ++i) {
    FeatureLevel level;
    level.level = levels[i];
    level.row_count =
        static_cast<uint32_t>(std::min<uint64_t>(cornerCount(level.level), most_rows[i]));
    level.values.resize(level.row_count * channels);
    for (float& value : level.values) {
      const float u = unitFloat(keyedBits(seed, RandomUse::kFieldStart, number++));
      value = amplitude * (2.0f * u - 1.0f);
    }
    levels_.push_back(std::move(level));
  }
}

FeatureGrid::FeatureGrid(size_t channels, std::vector<FeatureLevel> levels)
    : channels_(channels), levels_(std::move(levels)) {
  for (const FeatureLevel& level : levels_) {
    const std::string name = "features of level " + std::to_string(level.level);
    const bool in_range = level.level >= 0 && level.level <= kMaxGridLevel;
    const bool is_power = (level.row_count & (level.row_count - 1)) == 0;
    if (!in_range || level.row_count == 0 ||
        (level.row_count != cornerCount(level.level) &&
         (!is_power || level.row_count < 8 || level.row_count > cornerCount(level.level))) ||
        level.values.size() != level.row_count * channels_) {
      fail(ErrorCode::kFormat,
           name + " have " + std::to_string(level.row_count) + " rows and " +
               std::to_string(level.values.size()) + " values; one row per corner or a power of " +
               "two below, each of " + std::to_string(channels_) + ", are needed");
    }
    requireFinite(level.values.data(), level.values.size(), channels_, name.c_str());
  }
}

uint64_t FeatureGrid::bytes() const {
  uint64_t bytes = 0;
  for (const FeatureLevel& level : levels_) bytes += level.values.size() * sizeof(float);
  return bytes;
}

void FeatureGrid::concatenate(const FeaturePlaces& places, float* out, size_t stride) const {
  parallelFor(places.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t l = 0; l < levels_.size(); ++l) {
      const FeatureLevel& level = levels_[l];
      const bool hashed = isHashed(level);
      for (size_t i = begin; i < end; ++i) {
        const Corners corners = cornersOf(level, hashed, &places.positions[i * 3]);
        const float share = levelWeight(level, places.footprints[i]);
        float* to = out + i * stride + l * channels_;
        std::fill_n(to, channels_, 0.0f);
        for (size_t c = 0; c < 8; ++c) {
          const float weight = share * corners.weights[c];
          const float* from = &level.values[corners.rows[c] * channels_];
          for (size_t k = 0; k < channels_; ++k) to[k] += weight * from[k];
        }
      }
    }
  });
}

void FeatureGrid::addSum(const FeaturePlaces& places, float* out, size_t stride) const {
  parallelFor(places.size(), kGrain, [&](size_t begin, size_t end) {
    for (const FeatureLevel& level : levels_) {
      const bool hashed = isHashed(level);
      for (size_t i = begin; i < end; ++i) {
        const Corners corners = cornersOf(level, hashed, &places.positions[i * 3]);
        const float share = levelWeight(level, places.footprints[i]);
        float* to = out + i * stride;
        for (size_t c = 0; c < 8; ++c) {
          const float weight = share * corners.weights[c];
          const float* from = &level.values[corners.rows[c] * channels_];
          for (size_t k = 0; k < channels_; ++k) to[k] += weight * from[k];
        }
      }
    }
  });
}

void FeatureGrid::backward(const FeaturePlaces& places, const float* gradient, size_t stride,
                           size_t level_step, std::vector<FeatureGradient>& gradients) const {
  gradients.resize(levels_.size());
  parallelFor(levels_.size(), 1, [&](size_t begin, size_t end) {
    for (size_t l = begin; l < end; ++l) {
      const FeatureLevel& level = levels_[l];
      const bool hashed = isHashed(level);
      FeatureGradient& out = gradients[l];
      out.values.resize(level.values.size(), 0.0f);
      out.listed.resize(level.row_count, 0);
      for (size_t i = 0; i < places.size(); ++i) {
        const Corners corners = cornersOf(level, hashed, &places.positions[i * 3]);
        const float share = levelWeight(level, places.footprints[i]);
        const float* from = gradient + i * stride + l * level_step;
        for (size_t c = 0; c < 8; ++c) {
          const uint32_t row = corners.rows[c];
          if (!out.listed[row]) {
            out.listed[row] = 1;
            out.rows.push_back(row);
          }
          const float weight = share * corners.weights[c];
          float* to = &out.values[row * channels_];
          for (size_t k = 0; k < channels_; ++k) to[k] += weight * from[k];
        }
      }
    }
  });
}

void FeatureGrid::backwardConcatenated(const FeaturePlaces& places, const float* gradient,
                                       size_t stride,
                                       std::vector<FeatureGradient>& gradients) const {
  backward(places, gradient, stride, channels_, gradients);
}

void FeatureGrid::backwardSum(const FeaturePlaces& places, const float* gradient, size_t stride,
                              std::vector<FeatureGradient>& gradients) const {
  backward(places, gradient, stride, 0, gradients);
}

void FeatureGrid::addPositionGradient(const FeaturePlaces& places, const float* gradient,
                                      size_t stride, std::span<float> position_gradient) const {
  parallelFor(places.size(), kGrain, [&](size_t begin, size_t end) {
    for (const FeatureLevel& level : levels_) {
      const bool hashed = isHashed(level);
      const float side = static_cast<float>(uint32_t{1} << level.level);
      for (size_t i = begin; i < end; ++i) {
        const Corners corners = cornersOf(level, hashed, &places.positions[i * 3]);
        const float share = side * levelWeight(level, places.footprints[i]);
        std::array<float, 8> dots;
        for (size_t c = 0; c < 8; ++c) {
          const float* from = &level.values[corners.rows[c] * channels_];
          dots[c] = 0;
          for (size_t k = 0; k < channels_; ++k) dots[c] += from[k] * gradient[i * stride + k];
        }
        for (size_t axis = 0; axis < 3; ++axis) {
          if (corners.held[axis]) continue;
          const size_t next = (axis + 1) % 3, last = (axis + 2) % 3;
          float sum = 0;
          for (size_t c = 0; c < 8; ++c) {
            const auto part = [&](size_t other) {
              return (c >> other & 1) != 0 ? corners.inside[other] : 1.0f - corners.inside[other];
            };
            const float slope = (c >> axis & 1) != 0 ? 1.0f : -1.0f;
            sum += slope * part(next) * part(last) * dots[c];
          }
          position_gradient[i * 3 + axis] += share * sum;
        }
      }
    }
  });
}

}  // namespace stipple
