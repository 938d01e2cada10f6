#include "fit/densifying.h"

#include <string>
#include <utility>

#include "base/error.h"
#include "data/views/view_check.h"
#include "densify/strategies.h"
#include "fit/fit_views.h"

namespace stipple {

namespace {

constexpr uint64_t kMaxSplats = uint64_t{1} << 28;

void requireRange(uint64_t value, uint64_t first, uint64_t last, const char* name) {
  if (value >= first && value <= last) return;
  fail(ErrorCode::kInvalidArgument, std::string("options->") + name + " is " +
                                        std::to_string(value) + "; " + std::to_string(first) +
                                        " to " + std::to_string(last) + " is allowed");
}

}  // namespace

void requireDensifyOptions(const DensifyOptions& options, const SplatCloud& cloud,
                           const ViewSource& views) {
  requireRange(options.max_splats, 0, kMaxSplats, "max_splats");
  requireRange(options.event_count, 1, kMaxDensifyEvents, "event_count");
  makeStrategy(options.strategy);  // says now what is wrong with it
  requireDensifiable(cloud, views, options);
}

SeenCloud densified(const BackendFactory& backends, const SplatCloud& cloud,
                    std::shared_ptr<const ViewSource> views, uint64_t holdout,
                    const DensifyOptions& options, Progress* progress) {
  checkViews(*views, {}, progress);
  const FitViews split = splitAsTold(*views, holdout);
  SplatQuantities seen;
  SplatCloud made = densifyCloud(backends, cloud, std::move(views), split.training, options,
                                 progress, &seen);
  return SeenCloud(std::move(made), std::move(seen));
}

}  // namespace stipple
