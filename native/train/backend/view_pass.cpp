#include "train/backend/view_pass.h"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <string>

#include "base/error.h"
#include "splat/render/render_backward.h"

namespace stipple {

namespace {

constexpr const GradientArray* kStatistics =
    std::find_if(std::begin(kGradientArrays), std::end(kGradientArrays),
                 [](const GradientArray& array) { return array.is_statistic; });
static_assert(std::end(kGradientArrays) - kStatistics == static_cast<ptrdiff_t>(kStatisticCount));

}  // namespace

ImageLossOptions lossFor(const StatisticRequest& request, double ssim_share) {
  ImageLossOptions options;
  options.ssim_share = ssim_share;
  options.with_structure_errors = request.structure_errors || request.error_maps;
  return options;
}

const GradientArray& arrayOf(Statistic statistic) {
  return kStatistics[static_cast<size_t>(statistic)];
}

void requireCount(size_t seen, size_t needed, const char* what) {
  if (seen != needed) {
    fail(ErrorCode::kInvalidArgument, std::string(what) + " holds " + std::to_string(seen) +
                                          " values; " + std::to_string(needed) + " are needed");
  }
}

}  // namespace stipple
