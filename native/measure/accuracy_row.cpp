#include "measure/accuracy_row.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace stipple {

namespace {

/// The value below which a share of sorted numbers lies, between two of them in proportion.
double quantile(const std::vector<double>& sorted, double share) {
  const double place = share * static_cast<double>(sorted.size() - 1);
  const size_t below = static_cast<size_t>(place);
  const size_t above = std::min(below + 1, sorted.size() - 1);
  const double rest = place - static_cast<double>(below);
  return sorted[below] * (1 - rest) + sorted[above] * rest;
}

}  // namespace

void setErrors(std::vector<float>& differences, AccuracyRow& row) {
  double squares = 0;
  for (float& value : differences) {
    value = std::abs(value);
    squares += static_cast<double>(value) * static_cast<double>(value);
  }
  if (differences.empty()) return;
  const double mean = squares / static_cast<double>(differences.size());
  row.psnr = mean > 0 ? -10 * std::log10(mean) : std::numeric_limits<double>::infinity();
  row.largest_error =
      static_cast<double>(*std::max_element(differences.begin(), differences.end()));
  const double place = std::ceil(0.999 * static_cast<double>(differences.size())) - 1;
  const auto at = differences.begin() + static_cast<ptrdiff_t>(place);
  std::nth_element(differences.begin(), at, differences.end());
  row.error_99_9 = static_cast<double>(*at);
}

void setSeconds(std::vector<double> times, AccuracyRow& row) {
  std::sort(times.begin(), times.end());
  row.repetitions = static_cast<uint32_t>(times.size());
  row.seconds = quantile(times, 0.5);
  row.seconds_low = quantile(times, 0.25);
  row.seconds_high = quantile(times, 0.75);
}

}  // namespace stipple
