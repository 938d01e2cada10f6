#include <memory>

#include "api/conversions.h"
#include "api/guard.h"
#include "api/handles.h"
#include "api/job.h"
#include "fit/densifying.h"
#include "fit/fit_memory.h"

using namespace stipple;
using namespace stipple::api;

namespace {

DensifyOptions densifyOptions(const StippleDensifyOptions& given) {
  DensifyOptions options;
  if (given.strategy_utf8) options.strategy = given.strategy_utf8;
  options.max_splats = given.max_splats;
  options.event_count = given.event_count;
  options.seed = given.seed;
  options.picture_bytes = given.image_bytes;
  return options;
}

}  // namespace

extern "C" {

void stipple_densify_options_init(StippleDensifyOptions* options) {
  if (!options) return;
  const DensifyOptions defaults;
  *options = {};
  options->struct_size = sizeof(StippleDensifyOptions);
  options->event_count = static_cast<uint32_t>(defaults.event_count);
  options->image_bytes = defaults.picture_bytes;
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
    const DensifyOptions wanted = densifyOptions(given);
    const std::shared_ptr<const SplatCloud> start = cloud->cloud;
    const std::shared_ptr<const ViewSource> source = sourceOf(*views);
    requireDensifyOptions(wanted, *start, *source);
    context->state->requireMemory(densifyMemoryBound(*start, *source, wanted),
                                  "densifying this cloud");
    const uint64_t holdout = given.holdout;
    *job = startJob(context->state, [start, source, holdout, wanted,
                                     backends = context->state->backends](Progress& progress) {
      return JobResult{densified(*backends, *start, source, holdout, wanted, &progress)};
    });
  });
}

}  // extern "C"
