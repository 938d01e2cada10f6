#pragma once

#include <cstdint>
#include <optional>

#include "density/anchor_sampling.h"

namespace stipple {

/// What the budget of a model counts.
enum class BudgetUnit : uint32_t {
  kAnchors = 0,  ///< places that are drawn; each becomes K splats
  kSplats = 1,   ///< splats of those that the model has; its largest budget is all of them
};

/// From when to when something moves.
struct TimeRange {
  double begin = 0;  ///< seconds
  double end = 0;    ///< seconds, >= begin; both stand still outside
};

/// Which settings a kind of model has. One model may have fewer than its kind.
struct ModelTraits {
  BudgetUnit budget_unit = BudgetUnit::kAnchors;
  bool has_order = false;   ///< AnchorOrder changes the splats
  bool has_seed = false;    ///< the seed changes the splats
  bool has_smooth = false;  ///< ModelRequest::smooth changes the splats between powers of two
  bool takes_mask = false;  ///< splats of its own can be left out (SplatModel::keep)
};

/// Which settings one model has, and their ranges.
struct ModelSettings : ModelTraits {
  uint64_t minimum_budget = 1;
  uint64_t maximum_budget = kMaxAnchorCount;
  uint64_t default_budget = 20000;
  /// Budgets that it was learned for; 0: all are alike to it.
  uint64_t minimum_learned_budget = 0;
  uint64_t maximum_learned_budget = 0;
  uint32_t minimum_gaussians_per_anchor = 1;
  uint32_t maximum_gaussians_per_anchor = 1;
  uint32_t default_gaussians_per_anchor = 1;
  std::optional<TimeRange> time = {};  ///< none: it gives the same splats at every time
};

}  // namespace stipple
