#include "cli/hierarchy.h"

namespace stipple::cli {

Model hierarchyOf(const Context& context, const Cloud& cloud, uint64_t seed) {
  StippleModelFromCloudOptions options;
  stipple_model_from_cloud_options_init(&options);
  options.seed = seed;
  const auto job = make<Job>(stipple_model_from_cloud_start, context.get(),
                             const_cast<const StippleCloud*>(cloud.get()),
                             const_cast<const StippleModelFromCloudOptions*>(&options));
  finish(job);
  return make<Model>(stipple_job_model, job.get());
}

Cloud cutOf(const Model& hierarchy, uint64_t count) {
  StippleDecodeOptions options;
  stipple_decode_options_init(&options);
  options.anchor_count = count;
  const auto job = make<Job>(stipple_model_decode_start, hierarchy.get(), &options);
  finish(job);
  return make<Cloud>(stipple_job_cloud, job.get());
}

}  // namespace stipple::cli
