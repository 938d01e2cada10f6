#include "fit/fit_views.h"

namespace stipple {

FitViews splitAsTold(const ViewSource& views, uint64_t holdout) {
  FitViews split;
  for (size_t v = 0; v < views.count(); ++v) {
    const ViewRole role = views.role(v);
    if (role == ViewRole::kTest) {
      split.held_out.push_back(v);
    } else if (role != ViewRole::kValidation) {
      split.training.push_back(v);
    }
  }
  const bool is_told = !split.held_out.empty() && !split.training.empty();
  if (holdout == 0 || !is_told) return splitViews(views, holdout);
  return split;
}

}  // namespace stipple
