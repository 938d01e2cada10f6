#include "io/reports/accuracy_file.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "io/bytes/output_file.h"
#include "io/bytes/output_kind.h"
#include "plot/svg_plot.h"

namespace stipple {

namespace {

using Json = nlohmann::ordered_json;

constexpr char kCsvHead[] =
    "setting,seconds,seconds_low,seconds_high,repetitions,is_estimated,psnr,largest_error,"
    "error_99_9,";
/// What tells the kind of a file.
constexpr size_t kHeadBytes = 256;

/// JSON has no infinity: null.
Json number(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}

struct Words {
  const char* subject;
  const char* counted;  ///< what splat_count counts
  const char* value;    ///< name of AccuracyRow::value; null: there is none
  const char* made;     ///< what the seconds are of
  const char* judge;
};

Words wordsOf(AccuracySubject subject) {
  switch (subject) {
    case AccuracySubject::kVolume:
      return {"volume", "voxels", "voxel_size", "a volume", "the finest"};
    case AccuracySubject::kFit:
      return {"fit", "splats", "iteration", "a fit", "views"};
    default:
      return {"picture", "splats", nullptr, "an image", "reference"};
  }
}

Json rowOf(const AccuracyRow& row, const Words& words) {
  Json knobs = Json::object();
  for (const auto& [name, value] : row.knobs) knobs[name] = value;
  Json json = {{"name", row.name},
               {"knobs", std::move(knobs)},
               {"seconds", number(row.seconds)},
               {"seconds_low", number(row.seconds_low)},
               {"seconds_high", number(row.seconds_high)},
               {"repetitions", row.repetitions},
               {"is_estimated", row.is_estimated},
               {"psnr", number(row.psnr)},
               {"largest_error", number(row.largest_error)},
               {"error_99_9", number(row.error_99_9)},
               {words.counted, row.splat_count},
               {"visible", row.visible_count},
               {"on_front", row.is_on_front}};
  if (words.value) json[words.value] = number(row.value);
  return json;
}

std::string jsonOf(const AccuracyReport& report) {
  const Words words = wordsOf(report.subject);
  Json rows = Json::array();
  for (const AccuracyRow& row : report.rows) rows.push_back(rowOf(row, words));
  const Json all = {{"stipple_accuracy_report", 1},
                    {"subject", words.subject},
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
  const Words words = wordsOf(report.subject);
  std::string out = kCsvHead;
  out.append(words.counted).append(",visible,on_front\n");
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

bool endsWith(const std::string& path, const char* extension) {
  const std::string end = extension;
  return path.size() >= end.size() && path.compare(path.size() - end.size(), end.size(), end) == 0;
}

std::string textOf(const AccuracyReport& report, const std::string& path) {
  if (endsWith(path, ".json")) return jsonOf(report);
  if (endsWith(path, ".csv")) return csvOf(report);
  if (endsWith(path, ".svg")) return svgOf(accuracyPlot(report));
  fail(ErrorCode::kInvalidArgument,
       "'" + path + "' has no extension of a report; .json, .csv and .svg are allowed");
}

std::string titleOf(const AccuracyReport& report) {
  const auto splats = static_cast<unsigned long long>(report.splat_count);
  char title[160];
  switch (report.subject) {
    case AccuracySubject::kVolume:
      std::snprintf(title, sizeof(title), "What the voxel size costs: %llu splats, %u threads",
                    splats, report.thread_count);
      break;
    case AccuracySubject::kFit:
      std::snprintf(title, sizeof(title), "What iterations bring: a fit of %llu splats", splats);
      break;
    default:
      std::snprintf(title, sizeof(title),
                    "What accuracy costs: %u x %u pixels, %llu splats, %u threads", report.width,
                    report.height, splats, report.thread_count);
  }
  return title;
}

/// Root of the mean squared difference, of the colours' full range.
double errorOf(const AccuracyRow& row) {
  return std::pow(10.0, -row.psnr / 20);
}

}  // namespace

PlotSheet accuracyPlot(const AccuracyReport& report) {
  const Words words = wordsOf(report.subject);
  // Fits take minutes.
  const double factor = report.subject == AccuracySubject::kFit ? 1 : 1e3;
  PlotPanel panel;
  panel.title = titleOf(report);
  panel.x_label = std::string(factor == 1 ? "seconds" : "milliseconds") + " of " + words.made;
  panel.y_label = std::string("error against ") + words.judge + " (RMS, 1 = white)";
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
    all.x.push_back(row.seconds * factor);
    all.y.push_back(errorOf(row));
    all.names.push_back(row.name);
  }
  std::sort(front.begin(), front.end(),
            [](const AccuracyRow* a, const AccuracyRow* b) { return a->seconds < b->seconds; });
  for (const AccuracyRow* row : front) {
    best.x.push_back(row->seconds * factor);
    best.y.push_back(errorOf(*row));
    best.names.push_back(row->name);
  }
  panel.lines = {std::move(best), std::move(all)};
  return sheetOf({std::move(panel)}, {840, 520});
}

void writeAccuracyReport(const AccuracyReport& report, const std::string& path) {
  const std::string text = textOf(report, path);
  requireOutputKind(path, "the report", [](const std::string& file) {
    const std::string head = headOfFile(file, kHeadBytes);
    return head.find("{\n \"stipple_accuracy_report\": ") == 0 || head.find(kCsvHead) == 0 ||
           isHeadOfSvgPlot(head);
  });
  OutputFile file(path);
  file.write(text.data(), text.size());
  file.commit();
}

}  // namespace stipple
