#include "io/accuracy_file.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "io/output_file.h"
#include "io/svg_plot.h"

namespace stipple {

namespace {

using Json = nlohmann::ordered_json;

/// JSON has no infinity: null.
Json number(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}

Json rowOf(const AccuracyRow& row) {
  Json knobs = Json::object();
  for (const auto& [name, value] : row.knobs) knobs[name] = value;
  return {{"name", row.name},
          {"knobs", std::move(knobs)},
          {"seconds", number(row.seconds)},
          {"seconds_low", number(row.seconds_low)},
          {"seconds_high", number(row.seconds_high)},
          {"repetitions", row.repetitions},
          {"is_estimated", row.is_estimated},
          {"psnr", number(row.psnr)},
          {"largest_error", number(row.largest_error)},
          {"error_99_9", number(row.error_99_9)},
          {"splats", row.splat_count},
          {"visible", row.visible_count},
          {"on_front", row.is_on_front}};
}

std::string jsonOf(const AccuracyReport& report) {
  Json rows = Json::array();
  for (const AccuracyRow& row : report.rows) rows.push_back(rowOf(row));
  const Json all = {{"stipple_accuracy_report", 1},
                    {"width", report.width},
                    {"height", report.height},
                    {"compared_pixels", report.compared_pixels},
                    {"splats", report.splat_count},
                    {"threads", report.thread_count},
                    {"cut_seconds", number(report.cut_seconds)},
                    {"settings", std::move(rows)}};
  return all.dump(1) + "\n";
}

/// Names have no quotes or line ends; a comma is what needs quotes.
std::string csvOf(const AccuracyReport& report) {
  std::string out =
      "setting,seconds,seconds_low,seconds_high,repetitions,is_estimated,psnr,largest_error,"
      "error_99_9,splats,visible,on_front\n";
  for (const AccuracyRow& row : report.rows) {
    char text[320];
    std::snprintf(text, sizeof(text), ",%.9g,%.9g,%.9g,%u,%d,%.6g,%.6g,%.6g,%llu,%llu,%d\n",
                  row.seconds, row.seconds_low, row.seconds_high, row.repetitions,
                  row.is_estimated ? 1 : 0, row.psnr, row.largest_error, row.error_99_9,
                  static_cast<unsigned long long>(row.splat_count),
                  static_cast<unsigned long long>(row.visible_count), row.is_on_front ? 1 : 0);
    out += '"' + row.name + '"' + text;
  }
  return out;
}

bool endsWith(const std::string& path, const char* ending) {
  const std::string end = ending;
  return path.size() >= end.size() && path.compare(path.size() - end.size(), end.size(), end) == 0;
}

std::string textOf(const AccuracyReport& report, const std::string& path) {
  if (endsWith(path, ".json")) return jsonOf(report);
  if (endsWith(path, ".csv")) return csvOf(report);
  if (endsWith(path, ".svg")) return svgOf(accuracyPlot(report));
  fail(ErrorCode::kInvalidArgument,
       "'" + path + "' has no ending of a report; .json, .csv and .svg are allowed");
}

/// Root of the mean squared difference, of the colours' full range.
double errorOf(const AccuracyRow& row) {
  return std::pow(10.0, -row.psnr / 20);
}

}  // namespace

PlotSheet accuracyPlot(const AccuracyReport& report) {
  char title[160];
  std::snprintf(title, sizeof(title),
                "What accuracy costs: %u x %u pixels, %llu splats, %u threads", report.width,
                report.height, static_cast<unsigned long long>(report.splat_count),
                report.thread_count);
  PlotPanel panel;
  panel.title = title;
  panel.x_label = "milliseconds of a picture";
  panel.y_label = "error against reference (RMS, 1 = white)";
  panel.x_is_logarithmic = true;
  panel.y_is_logarithmic = true;
  std::vector<const AccuracyRow*> front;
  PlotLine all, best;
  all.label = "settings";
  all.has_markers = true;
  all.has_stroke = false;
  best.label = "best for their time";
  best.has_markers = true;
  for (const AccuracyRow& row : report.rows) {
    if (!std::isfinite(row.psnr)) continue;
    if (row.is_on_front) {
      front.push_back(&row);
      continue;
    }
    all.x.push_back(row.seconds * 1e3);
    all.y.push_back(errorOf(row));
    all.names.push_back(row.name);
  }
  std::sort(front.begin(), front.end(),
            [](const AccuracyRow* a, const AccuracyRow* b) { return a->seconds < b->seconds; });
  for (const AccuracyRow* row : front) {
    best.x.push_back(row->seconds * 1e3);
    best.y.push_back(errorOf(*row));
    best.names.push_back(row->name);
  }
  panel.lines = {std::move(best), std::move(all)};
  return sheetOf({std::move(panel)}, {840, 520});
}

void writeAccuracyReport(const AccuracyReport& report, const std::string& path) {
  const std::string text = textOf(report, path);
  OutputFile file(path);
  file.write(text.data(), text.size());
  file.commit();
}

}  // namespace stipple
