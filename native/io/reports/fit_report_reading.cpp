#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <vector>

#include "base/error.h"
#include "io/bytes/input_file.h"
#include "io/bytes/json_text.h"
#include "io/bytes/limits.h"
#include "io/reports/fit_report.h"

namespace stipple {

namespace {

using Json = nlohmann::ordered_json;

/// The seconds of all parts of an iteration, summed up to each: [iterations + 1].
std::vector<double> secondsUpTo(const Json& report) {
  const Json& each = report.at("by_iteration").at("seconds");
  std::vector<double> sums(report.at("iterations").get<uint64_t>() + 1, 0.0);
  for (const auto& part : each.items()) {
    if (part.value().size() + 1 != sums.size()) {
      fail(ErrorCode::kFormat, "its part '" + part.key() + "' has " +
                                   std::to_string(part.value().size()) + " times for " +
                                   std::to_string(sums.size() - 1) + " iterations");
    }
    for (size_t i = 0; i + 1 < sums.size(); ++i) {
      if (part.value()[i].is_number()) sums[i + 1] += part.value()[i].get<double>();
    }
  }
  for (size_t i = 1; i < sums.size(); ++i) sums[i] += sums[i - 1];
  return sums;
}

AccuracyRow rowOf(const Json& measure, const std::vector<double>& seconds) {
  const auto iteration = measure.at("iteration").get<uint64_t>();
  if (iteration >= seconds.size()) {
    fail(ErrorCode::kFormat, "it measured iteration " + std::to_string(iteration) + " of " +
                                 std::to_string(seconds.size() - 1));
  }
  AccuracyRow row;
  row.name = "iteration " + std::to_string(iteration);
  row.knobs = {{"iterations", std::to_string(iteration)}};
  row.value = static_cast<double>(iteration);
  row.seconds = row.seconds_low = row.seconds_high = seconds[iteration];
  row.repetitions = 1;
  const Json& psnr = measure.at("psnr");
  row.psnr = psnr.is_null() ? std::numeric_limits<double>::infinity() : psnr.get<double>();
  row.largest_error = row.error_99_9 = std::numeric_limits<double>::quiet_NaN();
  row.splat_count = row.visible_count = measure.at("gaussians").get<uint64_t>();
  return row;
}

AccuracyReport reportOf(const Json& json) {
  if (json.at("stipple_fit_report") != 1) {
    fail(ErrorCode::kUnsupported, "it is of version " + json.at("stipple_fit_report").dump() +
                                      "; 1 is what this library reads");
  }
  const std::vector<double> seconds = secondsUpTo(json);
  AccuracyReport report;
  report.subject = AccuracySubject::kFit;
  for (const Json& measure : json.at("measures")) {
    report.rows.push_back(rowOf(measure, seconds));
    report.splat_count = report.rows.back().splat_count;
  }
  if (report.rows.empty()) {
    fail(ErrorCode::kInvalidArgument, "it has 0 measurements; a fit that ran on has at least 1");
  }
  return report;
}

}  // namespace

AccuracyReport readFitAccuracy(const std::string& path) {
  const std::string text = readTextFile(path, kMaxJsonBytes);
  const std::string what = "'" + path + "' is not the report of a fit: ";
  const Json json = parseOrderedJson(text, what + "its text");
  try {
    return reportOf(json);
  } catch (const Json::exception& error) {
    fail(ErrorCode::kFormat, what + error.what());
  } catch (const Error& error) {
    fail(error.code(), "'" + path + "' cannot be read: " + error.what());
  }
}

}  // namespace stipple
