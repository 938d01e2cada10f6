#pragma once

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "densify/statistic.h"
#include "train/backend/view_pass.h"
#include "train/loop/fit_model.h"

namespace stipple {

/// Draws the splats of a step's view, and goes back through the loss, for models that make their
/// splats anew in each step. Out: derivatives and statistics are the pass's to lend; report: count,
/// loss and seconds of both.
void passOverView(ViewPass& pass, const SplatCloud& cloud, const StepView& view,
                  const StatisticRequest& request, double ssim_share, Progress* progress,
                  StepReport& report);

}  // namespace stipple
