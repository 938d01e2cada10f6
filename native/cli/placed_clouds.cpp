#include "cli/placed_clouds.h"

#include "cli/commands.h"

namespace stipple::cli {

namespace {

Cloud cloudOf(const Context& context, const std::string& path, double seconds) {
  if (!hasModelExtension(path)) {
    return make<Cloud>(stipple_cloud_load, context.get(), path.c_str());
  }
  const auto model = make<Model>(stipple_model_load, context.get(), path.c_str());
  auto settings = sized<StippleModelSettings>();
  check(stipple_model_settings(model.get(), &settings));
  StippleDecodeOptions options;
  stipple_decode_options_init(&options);
  options.anchor_count = settings.default_budget;
  options.gaussians_per_anchor = settings.default_gaussians_per_anchor;
  options.time = seconds;
  const auto job =
      make<Job>(stipple_model_decode_start, const_cast<const StippleModel*>(model.get()),
                const_cast<const StippleDecodeOptions*>(&options));
  finish(job);
  return make<Cloud>(stipple_job_cloud, const_cast<const StippleJob*>(job.get()));
}

}  // namespace

PlacedClouds::PlacedClouds(const Context& context, const std::vector<std::string>& paths,
                           double seconds) {
  for (const std::string& path : paths) {
    clouds_.push_back(cloudOf(context, path, seconds));
    auto instance = sized<StippleInstance>();
    instance.cloud = clouds_.back().get();
    for (int i = 0; i < 4; ++i) instance.matrix[i * 5] = 1.0;
    instances_.push_back(instance);
  }
}

}  // namespace stipple::cli
