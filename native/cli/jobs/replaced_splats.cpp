#include "cli/jobs/replaced_splats.h"

#include "cli/formats.h"
#include "cli/report.h"

namespace stipple::cli {

namespace {

uint64_t countOf(const Cloud& cloud) {
  auto info = sized<StippleCloudInfo>();
  check(stipple_cloud_info(cloud.get(), &info));
  return info.count;
}

}  // namespace

void requireSplats(const std::string& out) {
  if (hasSplatExtension(out)) return;
  throw Failure("'" + out + "' is not a splat file; " + splatExtensions(true) + " is expected");
}

void saveReplaced(const Job& job, const Cloud& before, const std::string& out, bool as_json) {
  const auto made = make<Cloud>(stipple_job_cloud, job.get());
  check(stipple_cloud_save(made.get(), out.c_str(), nullptr));
  Report report;
  report.add("gaussians_before", countOf(before));
  report.add("gaussians", countOf(made));
  report.print(as_json);
}

}  // namespace stipple::cli
