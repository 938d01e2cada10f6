#include <utility>

#include "api/fit.h"
#include "api/guard.h"
#include "api/job.h"
#include "data/views/view_check.h"
#include "densify/strategies.h"
#include "train/loop/densify_cloud.h"

using namespace stipple;
using namespace stipple::api;

namespace {

constexpr uint64_t kMostSplats = uint64_t{1} << 28;

DensifyOptions densifyOptions(const StippleDensifyOptions& given) {
  DensifyOptions options;
  if (given.strategy_utf8) options.strategy = given.strategy_utf8;
  if (given.max_splats > kMostSplats) {
    fail(ErrorCode::kInvalidArgument, "options->max_splats is " + std::to_string(given.max_splats) +
                                          "; 0 to " + std::to_string(kMostSplats) + " is allowed");
  }
  if (given.event_count < 1 || given.event_count > kMaxDensifyEvents) {
    fail(ErrorCode::kInvalidArgument, "options->event_count is " +
                                          std::to_string(given.event_count) + "; 1 to " +
                                          std::to_string(kMaxDensifyEvents) + " is allowed");
  }
  options.max_splats = given.max_splats;
  options.event_count = given.event_count;
  options.seed = given.seed;
  options.picture_bytes = given.picture_bytes;
  makeStrategy(options.strategy);  // says now what is wrong with it
  return options;
}

/// Parameters, two moments, derivatives twice and what is drawn, with a quarter of spare room; the
/// cloud that comes out; 150 bytes of drawing. Sweeps draw once more beside it.
uint64_t densifyMemoryBound(const SplatCloud& cloud, const ViewSource& views,
                            const DensifyOptions& options) {
  const uint64_t row = (11 + cloud.shStride()) * sizeof(float);
  return 2 * pictureMemoryBound(views, options.picture_bytes) +
         densifyLimit(cloud.size(), options) * (row * 10 + 2 * 150);
}

}  // namespace

extern "C" {

void stipple_densify_options_init(StippleDensifyOptions* options) {
  if (!options) return;
  const DensifyOptions defaults;
  *options = {};
  options->struct_size = sizeof(StippleDensifyOptions);
  options->event_count = static_cast<uint32_t>(defaults.event_count);
  options->picture_bytes = defaults.picture_bytes;
}

StippleStatus stipple_densify_start(StippleContext* context, const StippleCloud* cloud,
                                    const StippleViews* views, const StippleDensifyOptions* options,
                                    StippleJob** job) {
  return guarded([&] {
    require(context, "context");
    require(cloud, "cloud");
    require(views, "views");
    require(job, "job");
    StippleDensifyOptions defaults;
    stipple_densify_options_init(&defaults);
    const StippleDensifyOptions given = completed(options, defaults, "options");
    const DensifyOptions settings = densifyOptions(given);
    const std::shared_ptr<const SplatCloud> start = cloud->cloud;
    const std::shared_ptr<const ViewSource> source = sourceOf(*views);
    requireDensifiable(*start, *source, settings);
    context->state->requireMemory(densifyMemoryBound(*start, *source, settings),
                                  "densifying this cloud");
    const FitViews split = splitOf(*views, *source, given.holdout);
    *job = startJob(context->state, [start, source, split, settings,
                                     backends = context->state->backends](Progress& progress) {
      checkViews(*source, {}, &progress);
      SplatQuantities seen;
      SplatCloud made =
          densifyCloud(*backends, *start, source, split.training, settings, &progress, &seen);
      return JobResult{SeenCloud(std::move(made), std::move(seen))};
    });
  });
}

}  // extern "C"
