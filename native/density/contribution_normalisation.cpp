#include "density/contribution_normalisation.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/percentile.h"

namespace stipple {

void normaliseContributions(const ContributionNormalisation& options, std::span<double> g) {
  if (g.empty()) return;
  std::vector<double> sizes;
  for (double& value : g) {
    if (options.clamp) value = std::min(value, 0.0);
    if (value != 0 || options.counts_neutral) sizes.push_back(std::abs(value));
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
