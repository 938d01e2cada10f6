// Based on: Deng, Diao, Li, Yu, Xu, Improving Densification in 3D Gaussian Splatting for
// High-Fidelity Rendering, arXiv 2508.12313, equation 10, with the constants of its published
// program.

#include "densify/parts/growth_control.h"

#include <algorithm>
#include <cmath>

namespace stipple {

namespace {

class GrowthControl final : public ControlPart {
 public:
  explicit GrowthControl(const GrowthControlOptions& options) : options_(options) {}

  const char* name() const override { return "growth_control"; }
  ControlRoles owns() const override { return roles(ControlRole::kGrowth); }
  ControlRoles needs() const override { return roles(ControlRole::kMultiplication); }

  uint64_t limit(const ControlMoment& moment, uint64_t) override {
    const uint64_t whole = most(moment);
    if (!moment.takes_steps) {
      return static_cast<uint64_t>(static_cast<double>(whole) * std::sqrt(moment.progress));
    }
    const uint64_t first = scaleSchedule(options_.first, moment.iterations);
    const uint64_t last = scaleSchedule(options_.last, moment.iterations);
    if (moment.iteration >= last) return whole;
    if (moment.iteration <= first) return 0;
    const double share =
        static_cast<double>(moment.iteration - first) / static_cast<double>(last - first);
    return static_cast<uint64_t>(static_cast<double>(whole) * std::sqrt(share));
  }

 private:
  uint64_t most(const ControlMoment& moment) const {
    if (moment.max_splats == 0) return options_.splats > 0 ? options_.splats : options_.otherwise;
    return options_.splats > 0 ? std::min(options_.splats, moment.max_splats) : moment.max_splats;
  }

  GrowthControlOptions options_;
};

}  // namespace

std::unique_ptr<ControlPart> makeGrowthControl(const GrowthControlOptions& options) {
  return std::make_unique<GrowthControl>(options);
}

}  // namespace stipple
