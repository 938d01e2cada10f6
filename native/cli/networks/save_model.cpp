#include "cli/networks/save_model.h"

#include <chrono>

#include "cli/commands.h"
#include "cli/formats.h"
#include "cli/numbers.h"

namespace stipple::cli {

namespace {

/// Splats at a budget: the one that was asked for, or the model's own.
Cloud decoded(const Model& model, const std::optional<int64_t>& anchors) {
  auto settings = sized<StippleModelSettings>();
  check(stipple_model_settings(model.get(), &settings));
  StippleDecodeOptions options;
  stipple_decode_options_init(&options);
  options.anchor_count = anchors ? counted(*anchors, "--anchors") : settings.default_budget;
  const auto job = make<Job>(stipple_model_decode_start, model.get(), &options);
  finish(job);
  return make<Cloud>(stipple_job_cloud, job.get());
}

}  // namespace

void requireModelOrSplats(const std::string& out) {
  if (hasModelExtension(out) || hasSplatExtension(out)) return;
  throw Failure("'" + out + "' is neither splats nor a model; " + splatExtensions(true) +
                " or .stipple.safetensors is expected");
}

double saveModelOf(const Job& job, const std::string& out, const std::optional<int64_t>& anchors,
                   const std::string& prefix, Report& report) {
  const auto model = make<Model>(stipple_job_model, const_cast<const StippleJob*>(job.get()));
  if (hasModelExtension(out)) {
    check(stipple_model_save(model.get(), out.c_str()));
    return 0;
  }
  const auto start = std::chrono::steady_clock::now();
  const Cloud cloud = decoded(model, anchors);
  const double seconds = secondsSince(start);
  check(stipple_cloud_save(cloud.get(), out.c_str(), nullptr));
  auto info = sized<StippleCloudInfo>();
  check(stipple_cloud_info(cloud.get(), &info));
  report.add(prefix + "gaussians", info.count);
  return seconds;
}

}  // namespace stipple::cli
