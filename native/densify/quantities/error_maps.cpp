// Based on: Wang, Bovik, Sheikh, Simoncelli, Image Quality Assessment: From Error Visibility to
// Structural Similarity, IEEE TIP 2004. With p = x + y and d = x - y four blurs are enough: sums
// and products of means and variances are those of p and d.

#include "densify/quantities/error_maps.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kReach = 5;
constexpr size_t kTaps = 2 * kReach + 1;
constexpr float kC1 = 0.01f * 0.01f;
constexpr float kC2 = 0.03f * 0.03f;
constexpr size_t kRowGrain = 8;

const std::array<float, kTaps>& window() {
  static const std::array<float, kTaps> values = [] {
    std::array<double, kTaps> bell;
    double sum = 0;
    for (size_t k = 0; k < kTaps; ++k) {
      const double x = static_cast<double>(k) - static_cast<double>(kReach);
      sum += bell[k] = std::exp(-0.5 * x * x / (1.5 * 1.5));
    }
    std::array<float, kTaps> made;
    for (size_t k = 0; k < kTaps; ++k) made[k] = static_cast<float>(bell[k] / sum);
    return made;
  }();
  return values;
}

/// One channel of both pictures, row after row, with zeros beside every row.
struct Channel {
  size_t width, height, stride;
  std::vector<float> sums, differences;

  Channel(uint32_t w, uint32_t h, std::span<const float> x, std::span<const float> y,
          size_t channel)
      : width(w), height(h), stride(width + 2 * kReach) {
    sums.assign(stride * height, 0.0f);
    differences.assign(stride * height, 0.0f);
    parallelFor(height, kRowGrain, [&](size_t begin, size_t end) {
      for (size_t row = begin; row < end; ++row) {
        for (size_t i = 0; i < width; ++i) {
          const size_t from = (row * width + i) * 3 + channel, to = row * stride + kReach + i;
          sums[to] = x[from] + y[from];
          differences[to] = x[from] - y[from];
        }
      }
    });
  }
};

/// The four statistics of one row: blurred along columns, then along the row.
class RowStatistics {
 public:
  explicit RowStatistics(const Channel& channel) : channel_(channel) {
    for (auto& row : along_columns_) row.resize(channel.stride);
    for (auto& row : blurred_) row.resize(channel.width);
  }

  const std::array<std::vector<float>, 4>& at(size_t row) {
    for (auto& values : along_columns_) std::fill(values.begin(), values.end(), 0.0f);
    for (size_t k = 0; k < kTaps; ++k) {
      if (row + k < kReach || row + k >= channel_.height + kReach) continue;
      const size_t begin = (row + k - kReach) * channel_.stride;
      addRow(window()[k], &channel_.sums[begin], &channel_.differences[begin]);
    }
    for (size_t s = 0; s < 4; ++s) {
      std::fill(blurred_[s].begin(), blurred_[s].end(), 0.0f);
      for (size_t k = 0; k < kTaps; ++k) {
        const float weight = window()[k];
        const float* from = &along_columns_[s][k];
        float* to = blurred_[s].data();
        for (size_t i = 0; i < channel_.width; ++i) to[i] += weight * from[i];
      }
    }
    return blurred_;
  }

 private:
  void addRow(float weight, const float* p, const float* d) {
    float *mean_p = along_columns_[0].data(), *mean_d = along_columns_[1].data();
    float *square_p = along_columns_[2].data(), *square_d = along_columns_[3].data();
    for (size_t i = 0; i < channel_.stride; ++i) {
      mean_p[i] += weight * p[i];
      mean_d[i] += weight * d[i];
      square_p[i] += weight * (p[i] * p[i]);
      square_d[i] += weight * (d[i] * d[i]);
    }
  }

  const Channel& channel_;
  std::array<std::vector<float>, 4> along_columns_;  ///< [stride]
  std::array<std::vector<float>, 4> blurred_;        ///< [width]
};

/// Adds a third of what a channel says.
void addChannel(const Channel& channel, ErrorMaps& maps) {
  parallelFor(channel.height, kRowGrain, [&](size_t begin, size_t end) {
    RowStatistics statistics(channel);
    for (size_t row = begin; row < end; ++row) {
      const auto& [p, d, pp, dd] = statistics.at(row);
      const float* differences = &channel.differences[row * channel.stride + kReach];
      float* dissimilarity = &maps.dissimilarity[row * channel.width];
      float* difference = &maps.difference[row * channel.width];
      for (size_t i = 0; i < channel.width; ++i) {
        const float p2 = p[i] * p[i], d2 = d[i] * d[i];
        // Rounding can leave a variance just below 0.
        const float spread_p = std::max(pp[i] - p2, 0.0f), spread_d = std::max(dd[i] - d2, 0.0f);
        const float similarity = (0.5f * (p2 - d2) + kC1) * (0.5f * (spread_p - spread_d) + kC2) /
                                 ((0.5f * (p2 + d2) + kC1) * (0.5f * (spread_p + spread_d) + kC2));
        dissimilarity[i] += (1.0f - similarity) / 3.0f;
        difference[i] += std::abs(differences[i]) / 3.0f;
      }
    }
  });
}

}  // namespace

ErrorMaps errorMaps(uint32_t width, uint32_t height, std::span<const float> picture,
                    std::span<const float> target) {
  ErrorMaps maps;
  maps.dissimilarity.assign(size_t{width} * height, 0.0f);
  maps.difference.assign(size_t{width} * height, 0.0f);
  for (size_t c = 0; c < 3; ++c) addChannel({width, height, picture, target, c}, maps);
  return maps;
}

}  // namespace stipple
