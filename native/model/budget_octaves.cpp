#include "model/budget_octaves.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace stipple {

namespace {

bool sameButBudget(const ModelRequest& a, const ModelRequest& b) {
  return a.order == b.order && a.seed == b.seed &&
         a.gaussians_per_anchor == b.gaussians_per_anchor && a.time == b.time;
}

}  // namespace

OctaveEnds octaveAround(uint64_t budget, const ModelSettings& allowed) {
  const uint64_t power = std::bit_floor(budget);
  return {std::max(power, allowed.minimum_budget), std::min(2 * power, allowed.maximum_budget)};
}

SplatCloud BudgetOctaves::splats(const ModelRequest& request, const ModelSettings& allowed,
                                 const Maker& maker) {
  const OctaveEnds ends = octaveAround(request.budget, allowed);
  if (request.budget == ends.few) return maker.step(request.budget).splats;
  std::shared_ptr<const Octave> last;
  {
    const std::lock_guard lock(mutex_);
    last = last_;
  }
  if (!last || !sameButBudget(last->request, request) || last->few->budget != ends.few ||
      last->many->budget != ends.many) {
    const auto made = std::make_shared<Octave>();
    made->request = request;
    const auto stepOf = [&](uint64_t budget) -> std::shared_ptr<const BudgetStep> {
      if (last && sameButBudget(last->request, request)) {
        if (last->few->budget == budget) return last->few;
        if (last->many->budget == budget) return last->many;
      }
      return std::make_shared<BudgetStep>(maker.step(budget));
    };
    made->few = stepOf(ends.few);
    made->many = stepOf(ends.many);
    made->growth = growthOfAnchors(made->few->anchors, made->few->splats, made->many->anchors,
                                   made->many->splats);
    last = made;
    const std::lock_guard lock(mutex_);
    last_ = last;
  }
  const double along =
      std::log2(static_cast<double>(request.budget) / static_cast<double>(ends.few)) /
      std::log2(static_cast<double>(ends.many) / static_cast<double>(ends.few));
  return grownSplats(last->few->splats, last->many->splats, last->growth, along);
}

}  // namespace stipple
