#include "cli/networks/weights_report.h"

#include <cstdio>

namespace stipple::cli {

namespace {

const char* stateText(uint32_t state) {
  switch (state) {
    case STIPPLE_WEIGHTS_MISSING:
      return "missing";
    case STIPPLE_WEIGHTS_OTHER_SIZE:
      return "another size than the published file";
    case STIPPLE_WEIGHTS_PUBLISHED:
      return "as published";
    case STIPPLE_WEIGHTS_OTHER_CONTENT:
      return "another content than the published file";
    case STIPPLE_WEIGHTS_TRAINED:
      return "trained by stipple";
    case STIPPLE_WEIGHTS_NOT_NEEDED:
      return "not needed";
    default:
      return "not checked";
  }
}

}  // namespace

void addWeights(const Context& context, const std::string& folder, bool json, Report& report) {
  const auto found =
      make<Weights>(stipple_weights_find, context.get(), folder.empty() ? nullptr : folder.c_str());
  const auto job =
      make<Job>(stipple_weights_check_start, const_cast<const StippleWeights*>(found.get()));
  finish(job);
  const auto weights = make<Weights>(stipple_job_weights, const_cast<const StippleJob*>(job.get()));
  auto info = sized<StippleWeightsInfo>();
  check(stipple_weights_info(weights.get(), &info));
  for (uint32_t role = 0; role < info.file_count; ++role) {
    auto file = sized<StippleWeightsFile>();
    check(stipple_weights_file(weights.get(), role, &file));
    if (json) {
      report.add(std::string(file.label_utf8) + ".state", stateText(file.state));
      report.add(std::string(file.label_utf8) + ".bytes", file.bytes);
      report.add(std::string(file.label_utf8) + ".sha256", file.sha256_utf8);
    } else {
      std::printf("%-26s %s, %llu bytes, SHA-256 %s\n", file.label_utf8, stateText(file.state),
                  static_cast<unsigned long long>(file.bytes), file.sha256_utf8);
    }
  }
}

}  // namespace stipple::cli
