// Based on: Lloyd, Least Squares Quantization in PCM, IEEE Trans. Information Theory 1982; the
// start after Panter and Dite, Quantization Distortion in Pulse-Count Modulation, Proc. IRE 1951:
// the best density of many values is the cube root of the density of the data.
#include "io/splats/sog_codebook.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "math/radix_order.h"

namespace stipple {

namespace {

constexpr size_t kSize = 256;
// The squared error hardly grows where these few are kept out of the k-means, and the largest error
// falls by far: the ends of a distribution are too rare for the k-means to spend values on.
constexpr size_t kForTheRare = 8;
constexpr size_t kMeans = kSize - kForTheRare;
constexpr int kMaxRounds = 1000;
constexpr size_t kHistogramBins = 512;

constexpr auto kIsBelow = [](double value, float element) {
  return value < static_cast<double>(element);
};

/// Sorted different values with running sums, so that the mean of a range takes two look-ups.
struct Sorted {
  std::vector<float> values;
  std::vector<double> counts;  ///< [values + 1], of all before
  std::vector<double> sums;    ///< [values + 1]

  explicit Sorted(std::vector<float>& all) {
    sortFloats(all);
    for (std::vector<double>* running : {&counts, &sums}) {
      running->reserve(all.size() + 1);
      running->push_back(0);
    }
    values.reserve(all.size());
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

  /// The first value above a limit. In: near, about where it is; the search grows from there.
  size_t firstAbove(double limit, size_t near) const {
    size_t begin = near;
    size_t end = near;
    for (size_t step = 1; begin > 0 && static_cast<double>(values[begin - 1]) > limit; step *= 2) {
      begin -= std::min(begin, step);
    }
    for (size_t step = 1; end < values.size() && static_cast<double>(values[end]) <= limit;
         step *= 2) {
      end = std::min(values.size(), end + step);
    }
    const auto found =
        std::upper_bound(values.begin() + static_cast<std::ptrdiff_t>(begin),
                         values.begin() + static_cast<std::ptrdiff_t>(end), limit, kIsBelow);
    return static_cast<size_t>(found - values.begin());
  }

  double mean(size_t begin, size_t end) const {
    return (sums[end] - sums[begin]) / (counts[end] - counts[begin]);
  }
};

/// Bounds of the ranges that the codebook's values stand for, into sorted.values: of kMeans, of
/// kSize in the end.
using Bounds = std::vector<size_t>;

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
    bounds[k] = std::clamp(sorted.firstAbove(half, before[k]), bounds[k - 1] + 1,
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

/// The value or the one before, whichever is nearer. In: above, the first that is not below.
uint8_t nearerOf(const Codebook& codebook, size_t above, float value) {
  if (above == 0) return 0;
  if (above == kSize) return static_cast<uint8_t>(kSize - 1);
  const double up = static_cast<double>(codebook.values[above]) - static_cast<double>(value);
  const double down = static_cast<double>(value) - static_cast<double>(codebook.values[above - 1]);
  return static_cast<uint8_t>(up < down ? above : above - 1);
}

}  // namespace

uint8_t Codebook::nearest(float value) const {
  const auto found = std::lower_bound(values.begin(), values.end(), value);
  return nearerOf(*this, static_cast<size_t>(found - values.begin()), value);
}

NearestCode::NearestCode(const Codebook& codebook)
    : codebook_(codebook), low_(codebook.values.front()) {
  const float extent = codebook.values.back() - low_;
  const float scale = static_cast<float>(kBins) / extent;
  bins_per_value_ = extent > 0.0f && std::isfinite(scale) ? scale : 0.0f;
  size_t k = 0;
  for (size_t bin = 0; bin < kBins; ++bin) {
    while (k < kSize && binOf(codebook.values[k]) < bin) ++k;
    first_[bin] = static_cast<uint16_t>(k);
  }
}

/// Never falls where values rise, so that all before first_[binOf(value)] lie below the value.
size_t NearestCode::binOf(float value) const {
  const float place = (value - low_) * bins_per_value_;
  return place > 0.0f ? static_cast<size_t>(std::min(place, static_cast<float>(kBins - 1))) : 0;
}

uint8_t NearestCode::operator()(float value) const {
  size_t k = first_[binOf(value)];
  while (k < kSize && codebook_.values[k] < value) ++k;
  return nearerOf(codebook_, k, value);
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
