// Based on: Ye, Li, Liu, Dou, Zhang, Zhang, AbsGS: Recovering Fine Details for 3D Gaussian
// Splatting, ACM MM 2024, section 4, with the constants of its published program, which also holds
// opacities to 0.8 now and then. Differs: what adaptive control differs in (adaptive.cpp).

#include "densify/strategies/absolute.h"

namespace stipple {

AbsoluteOptions::AbsoluteOptions() {
  pull.split_statistic = Statistic::kAbsoluteScreenGradients;
  pull.split_threshold = 4e-4;
  pull.small_share = 0.001;
  reset.soft_interval = 500;
  reset.soft_opacity = 0.8;
}

ControlAssembly absoluteControl(const AbsoluteOptions& options) {
  return adaptiveControl(options);
}

}  // namespace stipple
