#include "density/contribution_normalisation.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace stipple {

namespace {

/// Linear between the two nearest of the sorted values.
double percentile(std::vector<double> values, double share) {
  const double place = share * static_cast<double>(values.size() - 1);
  const size_t below = static_cast<size_t>(place);
  const auto at = values.begin() + static_cast<long>(below);
  std::nth_element(values.begin(), at, values.end());
  if (below + 1 == values.size()) return *at;
  const double above = *std::min_element(at + 1, values.end());
  return *at + (place - static_cast<double>(below)) * (above - *at);
}

}  // namespace

void normaliseContributions(const ContributionNormalisation& options, std::span<double> g) {
  if (g.empty()) return;
  std::vector<double> sizes;
  for (double& value : g) {
    if (options.clamp) value = std::min(value, 0.0);
    if (value != 0) sizes.push_back(std::abs(value));
  }
  if (options.clip && !sizes.empty()) {
    const double limit = percentile(std::move(sizes), 0.9);
    for (double& value : g) value = std::clamp(value, -limit, limit);
  }
  if (!options.centre) return;
  double sum = 0;
  for (const double value : g) sum += value;
  const double mean = sum / static_cast<double>(g.size());
  for (double& value : g) value -= mean;
}

}  // namespace stipple
