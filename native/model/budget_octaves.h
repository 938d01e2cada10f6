#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>

#include "decode/growth/splat_growth.h"
#include "model/splat_model.h"

namespace stipple {

/// The splats of a model at a budget that is one of the powers of two, and the anchors that they
/// were made of.
struct BudgetStep {
  uint64_t budget = 0;
  AnchorSet anchors;
  SplatCloud splats;
};

/// What lies on both sides of the last budget that was asked for, kept, since the next one is near.
class BudgetOctaves {
 public:
  /// Makes the step of a budget.
  struct Maker {
    virtual ~Maker() = default;
    virtual BudgetStep step(uint64_t budget) const = 0;
  };

  /// The splats of request.budget, on their way between the powers of two around it; at those it is
  /// their own. Several threads may call it. In: allowed: the model's own ranges.
  SplatCloud splats(const ModelRequest& request, const ModelSettings& allowed, const Maker& maker);

 private:
  struct Octave {
    ModelRequest request;  ///< with the budget of the smaller step
    std::shared_ptr<const BudgetStep> few, many;
    SplatGrowth growth;
  };
  std::mutex mutex_;
  std::shared_ptr<const Octave> last_;
};

/// The largest power of two that is at most the budget, and the next one, both kept in the model's
/// range. In: budget in that range.
struct OctaveEnds {
  uint64_t few = 0;
  uint64_t many = 0;  ///< equal to few where the model has only one budget
};
OctaveEnds octaveAround(uint64_t budget, const ModelSettings& allowed);

}  // namespace stipple
