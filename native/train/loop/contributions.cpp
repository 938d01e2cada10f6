#include "train/loop/contributions.h"

#include <algorithm>
#include <span>

namespace stipple {

std::vector<float> meanContributions(ViewEvaluator& views, size_t most) {
  const size_t count = std::min(views.viewCount(), most);
  std::vector<double> sums(views.splats().size(), 0.0);
  StatisticRequest request;
  request.blending_weights = true;
  for (size_t k = 0; k < count; ++k) {
    const ViewStatistics& view = views.evaluate(k * views.viewCount() / count, request);
    const std::span<const float> weights = view.of(Statistic::kBlendingWeights);
    for (size_t i = 0; i < sums.size(); ++i) sums[i] += static_cast<double>(weights[i]);
  }
  std::vector<float> means(sums.size());
  for (size_t i = 0; i < means.size(); ++i) {
    means[i] = static_cast<float>(sums[i] / static_cast<double>(std::max<size_t>(count, 1)));
  }
  return means;
}

}  // namespace stipple
