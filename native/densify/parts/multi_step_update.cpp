// Based on: Deng, Diao, Li, Yu, Xu, Improving Densification in 3D Gaussian Splatting for
// High-Fidelity Rendering, arXiv 2508.12313, section 3.4.

#include "densify/parts/multi_step_update.h"

namespace stipple {

namespace {

class MultiStepUpdate final : public ControlPart {
 public:
  explicit MultiStepUpdate(const MultiStepUpdateOptions& options) : options_(options) {}

  const char* name() const override { return "multi_step_update"; }
  ControlRoles owns() const override { return roles(ControlRole::kSteps); }

  bool stepGate(const ControlMoment& moment) const override {
    if (!moment.isAfter(options_.every_until)) return true;
    const uint64_t published = moment.isAfter(options_.few_until) ? options_.many : options_.few;
    const uint64_t interval = scaleSchedule(published, moment.iterations);
    if (interval == 1) return true;
    // As published, the last iteration has no step: its views' would be one of few.
    return moment.iteration % interval == 0 && moment.iteration < moment.iterations;
  }

 private:
  MultiStepUpdateOptions options_;
};

}  // namespace

std::unique_ptr<ControlPart> makeMultiStepUpdate(const MultiStepUpdateOptions& options) {
  return std::make_unique<MultiStepUpdate>(options);
}

}  // namespace stipple
