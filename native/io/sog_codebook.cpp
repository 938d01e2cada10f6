// Based on: Lloyd, Least Squares Quantization in PCM, IEEE Trans. Information Theory 1982; the
// start after Panter and Dite, Quantization Distortion in Pulse-Count Modulation, Proc. IRE 1951:
// the best density of many values is the cube root of the density of the data.
#include "io/sog_codebook.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace stipple {

namespace {

constexpr size_t kSize = 256;
// The squared error hardly grows where these few are kept out of the k-means, and the largest error
// falls by far: the ends of a distribution are too rare for the k-means to spend values on.
constexpr size_t kForTheRare = 8;
constexpr size_t kMeans = kSize - kForTheRare;
constexpr int kMaxRounds = 1000;
constexpr size_t kHistogramBins = 512;

/// Sorted different values with running sums, so that the mean of a range takes two look-ups.
struct Sorted {
  std::vector<float> values;
  std::vector<double> counts;  ///< [values + 1], of all before
  std::vector<double> sums;    ///< [values + 1]

  explicit Sorted(std::vector<float>& all) {
    std::sort(all.begin(), all.end());
    counts.push_back(0);
    sums.push_back(0);
    for (size_t i = 0; i < all.size();) {
      size_t end = i;
      while (end < all.size() && all[end] == all[i]) ++end;
      const double count = static_cast<double>(end - i);
      const double value = static_cast<double>(all[i]);
      values.push_back(all[i]);
      counts.push_back(counts.back() + count);
      sums.push_back(sums.back() + count * value);
      i = end;
    }
  }

  double mean(size_t begin, size_t end) const {
    return (sums[end] - sums[begin]) / (counts[end] - counts[begin]);
  }
};

/// Bounds of the ranges that the codebook's values stand for, into sorted.values: of kMeans, of
/// kSize in the end.
using Bounds = std::vector<size_t>;

constexpr auto kIsBelow = [](double value, float element) {
  return value < static_cast<double>(element);
};

Bounds startBounds(const Sorted& sorted) {
  const double low = static_cast<double>(sorted.values.front());
  const double step = (static_cast<double>(sorted.values.back()) - low) / kHistogramBins;
  // Share of the codebook below each bin, by the cube root of how many values lie in it.
  std::vector<double> below(kHistogramBins + 1, 0.0);
  std::vector<size_t> first(kHistogramBins + 1, sorted.values.size());
  size_t at = 0;
  for (size_t bin = 0; bin < kHistogramBins; ++bin) {
    first[bin] = at;
    const double end_value = low + step * static_cast<double>(bin + 1);
    while (at < sorted.values.size() &&
           (bin + 1 == kHistogramBins || static_cast<double>(sorted.values[at]) < end_value)) {
      ++at;
    }
    below[bin + 1] = below[bin] + std::cbrt(sorted.counts[at] - sorted.counts[first[bin]]);
  }
  Bounds bounds(kMeans + 1, 0);
  size_t bin = 0;
  for (size_t k = 1; k < kMeans; ++k) {
    const double share = below.back() * static_cast<double>(k) / kMeans;
    while (bin + 1 < kHistogramBins && below[bin + 1] < share) ++bin;
    const double fraction = (share - below[bin]) / (below[bin + 1] - below[bin]);
    const double width = static_cast<double>(first[bin + 1] - first[bin]);
    const size_t bound = first[bin] + static_cast<size_t>(std::clamp(fraction, 0.0, 1.0) * width);
    // Every value of the codebook stands for at least one of the data.
    bounds[k] = std::clamp(bound, bounds[k - 1] + 1, sorted.values.size() - (kMeans - k));
  }
  bounds[kMeans] = sorted.values.size();
  return bounds;
}

/// One round of Lloyd's: ranges end half-way between the means. False where nothing moved.
bool improve(const Sorted& sorted, Bounds& bounds) {
  std::array<double, kMeans> means{};
  for (size_t k = 0; k < kMeans; ++k) means[k] = sorted.mean(bounds[k], bounds[k + 1]);
  const Bounds before = bounds;
  for (size_t k = 1; k < kMeans; ++k) {
    const double half = 0.5 * (means[k - 1] + means[k]);
    const auto found = std::upper_bound(sorted.values.begin(), sorted.values.end(), half, kIsBelow);
    bounds[k] = std::clamp(static_cast<size_t>(found - sorted.values.begin()), bounds[k - 1] + 1,
                           sorted.values.size() - (kMeans - k));
  }
  return bounds != before;
}

/// Halves the widest range, which holds different values where there are more values than ranges.
void splitWidest(const Sorted& sorted, Bounds& bounds) {
  const auto end = [&](size_t k, size_t back) {
    return static_cast<double>(sorted.values[bounds[k + back] - back]);
  };
  size_t widest = 0;
  for (size_t k = 1; k + 1 < bounds.size(); ++k) {
    if (end(k, 1) - end(k, 0) > end(widest, 1) - end(widest, 0)) widest = k;
  }
  const double half = 0.5 * (end(widest, 0) + end(widest, 1));
  const auto first = sorted.values.begin() + static_cast<std::ptrdiff_t>(bounds[widest]);
  const auto last = sorted.values.begin() + static_cast<std::ptrdiff_t>(bounds[widest + 1]);
  // Above the middle; not the first, so that both halves hold a value, nor behind the last.
  const auto middle = std::upper_bound(first + 1, last - 1, half, kIsBelow);
  bounds.insert(bounds.begin() + static_cast<std::ptrdiff_t>(widest) + 1,
                static_cast<size_t>(middle - sorted.values.begin()));
}

}  // namespace

uint8_t Codebook::nearest(float value) const {
  const auto found = std::lower_bound(values.begin(), values.end(), value);
  if (found == values.begin()) return 0;
  if (found == values.end()) return static_cast<uint8_t>(kSize - 1);
  const auto index = static_cast<uint8_t>(found - values.begin());
  const double above = static_cast<double>(*found) - static_cast<double>(value);
  const double below = static_cast<double>(value) - static_cast<double>(*(found - 1));
  return above < below ? index : static_cast<uint8_t>(index - 1);
}

Codebook makeCodebook(std::vector<float> values) {
  Codebook codebook;
  if (values.empty()) return codebook;
  const Sorted sorted(values);
  if (sorted.values.size() <= kSize) {
    codebook.values.fill(sorted.values.back());
    std::copy(sorted.values.begin(), sorted.values.end(), codebook.values.begin());
    return codebook;
  }
  Bounds bounds = startBounds(sorted);
  for (int round = 0; round < kMaxRounds && improve(sorted, bounds); ++round) {
  }
  while (bounds.size() <= kSize) splitWidest(sorted, bounds);
  for (size_t k = 0; k < kSize; ++k) {
    codebook.values[k] = static_cast<float>(sorted.mean(bounds[k], bounds[k + 1]));
  }
  return codebook;
}

}  // namespace stipple
