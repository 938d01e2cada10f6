#include "train/loop/view_step.h"

#include <algorithm>

#include "base/stopwatch.h"

namespace stipple {

void passOverView(ViewPass& pass, const SplatCloud& cloud, const StepView& view,
                  const StatisticRequest& request, double ssim_share, Progress* progress,
                  StepReport& report) {
  report.splat_count = cloud.size();
  {
    const TimedBlock watch(report.seconds.render);
    RenderOptions options;
    options.with_depth = false;
    options.with_background = true;
    std::copy_n(view.background, 3, options.background);
    pass.forward(cloud, *view.camera, options, progress);
  }
  const TimedBlock watch(report.seconds.backward);
  const size_t pixel_count = size_t{view.camera->width} * view.camera->height;
  const ImageLossValue loss = pass.loss({view.target, pixel_count * 3},
                                        {view.weights, view.weights ? pixel_count : size_t{0}},
                                        lossFor(request, ssim_share));
  report.loss = loss.loss;
  report.l1 = loss.l1;
  report.ssim = loss.ssim;
  pass.backward(request, 0.0, progress);
}

}  // namespace stipple
