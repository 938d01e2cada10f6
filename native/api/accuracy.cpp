#include <string>

#include "api/conversions.h"
#include "api/job.h"
#include "api/plot.h"
#include "io/reports/accuracy_file.h"
#include "measure/accuracy_choice.h"
#include "measure/fit_accuracy.h"

using namespace stipple;
using namespace stipple::api;

namespace {

const AccuracyReport& reportOf(const StippleAccuracyReport* report) {
  return require(report, "report").result->report;
}

StippleAccuracyRow rowTo(const MeasuredAccuracy& measured, size_t index) {
  const AccuracyRow& from = measured.report.rows[index];
  StippleAccuracyRow out = {};
  out.is_on_front = from.is_on_front ? 1 : 0;
  out.name_utf8 = from.name.c_str();
  out.setting.struct_size = sizeof(out.setting);
  if (!measured.accuracies.empty()) out.setting = accuracyTo(measured.accuracies[index]);
  out.seconds = from.seconds;
  out.seconds_low = from.seconds_low;
  out.seconds_high = from.seconds_high;
  out.psnr = from.psnr;
  out.largest_error = from.largest_error;
  out.error_99_9 = from.error_99_9;
  out.splat_count = from.splat_count;
  out.visible_count = from.visible_count;
  out.repetitions = from.repetitions;
  out.is_estimated = from.is_estimated ? 1 : 0;
  out.value = from.value;
  out.verdict_utf8 = measured.accuracies.empty()
                         ? accuracyVerdict(from.psnr)
                         : accuracyVerdict(measured.accuracies[index], from.psnr);
  return out;
}

}  // namespace

extern "C" {

StippleStatus stipple_accuracy_init(uint32_t level, StippleAccuracy* accuracy) {
  return guarded([&] {
    const auto wanted = enumValue<AccuracyLevel>(level, kAccuracyLevelCount - 1, "level");
    require(accuracy, "accuracy") = accuracyTo(accuracyOf(wanted));
  });
}

StippleStatus stipple_accuracy_check(const StippleAccuracy* accuracy) {
  return guarded([&] { accuracyFrom(accuracy, "accuracy"); });
}

StippleStatus stipple_accuracy_knob_count(uint64_t* count) {
  return guarded([&] { require(count, "count") = accuracyKnobs().size(); });
}

StippleStatus stipple_accuracy_knob_info(uint64_t index, StippleAccuracyKnobInfo* info) {
  return guarded([&] {
    const size_t count = accuracyKnobs().size();
    if (index >= count) {
      fail(ErrorCode::kInvalidArgument, "index is " + std::to_string(index) + "; 0 to " +
                                            std::to_string(count - 1) + " is allowed");
    }
    const AccuracyKnob& knob = accuracyKnobs()[index];
    StippleAccuracyKnobInfo out = {};
    out.has_bound = knob.has_bound ? 1 : 0;
    out.name_utf8 = knob.name;
    out.label_utf8 = knob.label;
    out.bound_utf8 = knob.bound;
    deliver(info, out, "info");
  });
}

const char* stipple_accuracy_level_name(uint32_t level) {
  return level < kAccuracyLevelCount ? accuracyLevelName(static_cast<AccuracyLevel>(level))
                                     : nullptr;
}

const char* stipple_accuracy_verdict(double psnr) {
  return accuracyVerdict(psnr);
}

StippleStatus stipple_job_accuracy_report(const StippleJob* job, StippleAccuracyReport** report) {
  return guarded([&] {
    const auto& made = jobResult<std::shared_ptr<const MeasuredAccuracy>>(require(job, "job"),
                                                                          "report of accuracy");
    require(report, "report") = new StippleAccuracyReport{made};
  });
}

void stipple_accuracy_report_free(StippleAccuracyReport* report) {
  delete report;
}

StippleStatus stipple_fit_accuracy_report(const char* path_utf8, StippleAccuracyReport** report) {
  return guarded([&] {
    const std::string path = &require(path_utf8, "path_utf8");
    require(report, "report") = new StippleAccuracyReport{
        std::make_shared<const MeasuredAccuracy>(MeasuredAccuracy{fitAccuracy(path), {}})};
  });
}

StippleStatus stipple_accuracy_report_info(const StippleAccuracyReport* report,
                                           StippleAccuracyReportInfo* info) {
  return guarded([&] {
    const AccuracyReport& made = reportOf(report);
    StippleAccuracyReportInfo out = {};
    out.width = made.width;
    out.height = made.height;
    out.thread_count = made.thread_count;
    out.compared_pixels = made.compared_pixels;
    out.splat_count = made.splat_count;
    out.row_count = made.rows.size();
    out.cut_seconds = made.cut_seconds;
    out.subject = static_cast<uint32_t>(made.subject);
    deliver(info, out, "info");
  });
}

StippleStatus stipple_accuracy_report_row(const StippleAccuracyReport* report, uint64_t index,
                                          StippleAccuracyRow* row) {
  return guarded([&] {
    const AccuracyReport& made = reportOf(report);
    if (index >= made.rows.size()) {
      fail(ErrorCode::kInvalidArgument, "index is " + std::to_string(index) + "; 0 to " +
                                            std::to_string(made.rows.size() - 1) + " is allowed");
    }
    deliver(row, rowTo(*report->result, index), "row");
  });
}

StippleStatus stipple_accuracy_report_best_within(const StippleAccuracyReport* report,
                                                  double seconds, uint64_t* index) {
  return guarded([&] { require(index, "index") = bestWithin(reportOf(report), seconds); });
}

StippleStatus stipple_accuracy_report_cheapest_above(const StippleAccuracyReport* report,
                                                     double psnr, uint64_t* index) {
  return guarded([&] { require(index, "index") = cheapestAbove(reportOf(report), psnr); });
}

StippleStatus stipple_accuracy_report_save(const StippleAccuracyReport* report,
                                           const char* path_utf8) {
  return guarded([&] { writeAccuracyReport(reportOf(report), &require(path_utf8, "path_utf8")); });
}

StippleStatus stipple_accuracy_report_draw(const StippleAccuracyReport* report, double scale,
                                           uint64_t capacity, float* pixels, uint32_t* width,
                                           uint32_t* height) {
  return guarded(
      [&] { deliverPlot(accuracyPlot(reportOf(report)), scale, capacity, pixels, width, height); });
}

}  // extern "C"
