#include <memory>

#include "api/conversions.h"
#include "api/guard.h"
#include "api/handles.h"
#include "api/job.h"
#include "fit/adding_detail.h"

using namespace stipple;
using namespace stipple::api;

extern "C" {

void stipple_detail_options_init(StippleDetailOptions* options) {
  if (!options) return;
  *options = {};
  options->struct_size = sizeof(StippleDetailOptions);
}

StippleStatus stipple_detail_start(StippleContext* context, const StippleCloud* cloud,
                                   const StippleViews* views, const char* weights_path,
                                   const StippleDetailOptions* options, StippleJob** job) {
  return guarded([&] {
    require(context, "context");
    require(cloud, "cloud");
    require(views, "views");
    require(weights_path, "weights_path");
    require(job, "job");
    StippleDetailOptions defaults;
    stipple_detail_options_init(&defaults);
    const StippleDetailOptions given = completed(options, defaults, "options");
    const auto adding = std::make_shared<const DetailAdding>(
        context->state->backends, cloud->cloud, sourceOf(*views), weights_path,
        AddDetailOptions{given.max_splats, given.view_count});
    context->state->requireMemory(adding->memoryBound(), "adding detail to this cloud");
    *job = startJob(context->state, [adding](Progress& progress) {
      return JobResult{std::make_shared<const SplatCloud>(adding->run(&progress))};
    });
  });
}

}  // extern "C"
