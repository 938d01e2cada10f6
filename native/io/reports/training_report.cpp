#include "io/reports/training_report.h"

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/error.h"
#include "io/bytes/json_text.h"
#include "io/reports/report_parts.h"

namespace stipple {

namespace {

using Json = nlohmann::ordered_json;

constexpr ReportKind kReport = {"stipple_training_report", "the report of a training"};
constexpr size_t kMeanPieces = 40;
constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();

constexpr std::pair<const char*, float TrainingRecord::*> kColumns[] = {
    {"loss", &TrainingRecord::loss},
    {"structure", &TrainingRecord::structure},
    {"divergence", &TrainingRecord::divergence},
    {"l1", &TrainingRecord::l1},
    {"ssim", &TrainingRecord::ssim},
    {"learning_rate", &TrainingRecord::learning_rate},
    {"gradient_norm", &TrainingRecord::gradient_norm},
    {"seconds", &TrainingRecord::seconds}};

Json rows(const std::vector<TrainingMeasure>& measures) {
  Json list = Json::array();
  for (const TrainingMeasure& measure : measures) {
    Json row = {{"step", measure.step},
                {"anchors", measure.anchors},
                {"objects", measure.objects},
                {"psnr", reportNumber(measure.psnr)},
                {"ssim", reportNumber(measure.ssim)},
                {"training_psnr", reportNumber(measure.training_psnr)}};
    if (measure.cut_psnr > 0) {
      row["coarse_splats"] = measure.coarse_splats;
      row["coarse_psnr"] = reportNumber(measure.coarse_psnr);
      row["cut_psnr"] = reportNumber(measure.cut_psnr);
    }
    list.push_back(std::move(row));
  }
  return list;
}

/// Each part of the training has a line of its own, since its loss is of other things.
void addParts(const TrainingHistory& history, float TrainingRecord::*member, PlotPanel& panel) {
  const std::vector<TrainingRecord>& records = history.records;
  for (size_t part = 0; part < history.part_names.size(); ++part) {
    PlotLine line =
        meanCurve(history.part_names[part].c_str(), records.size(), kCurvePoints, [&](size_t i) {
          const bool counts = records[i].part == part && !records[i].is_skipped;
          return counts ? static_cast<double>(records[i].*member) : kNothing;
        });
    panel.lines.push_back(std::move(line));
  }
}

PlotPanel partsPanel(const TrainingHistory& history, const char* title, const char* unit,
                     float TrainingRecord::*member) {
  PlotPanel panel{title, "step", unit, false, false, true, {}};
  addParts(history, member, panel);
  return panel;
}

PlotPanel qualityPanel(const std::vector<TrainingMeasure>& measures, const std::string& title,
                       bool by_anchors) {
  PlotPanel panel{title, by_anchors ? "anchors" : "step", "PSNR, dB", by_anchors, false, false, {}};
  PlotLine line;
  line.has_markers = true;
  for (const TrainingMeasure& measure : measures) {
    line.x.push_back(static_cast<double>(by_anchors ? measure.anchors : measure.step));
    line.y.push_back(measure.psnr);
  }
  panel.lines = {std::move(line)};
  return panel;
}

}  // namespace

void requireTrainingReportPlace(const std::string& path) {
  requireReportPlaces(path, kReport);
}

void writeTrainingReport(const std::string& settings_json, const TrainingHistory& history,
                         const std::string& path) {
  Json settings = parseOrderedJson(settings_json, "the text of the report's settings",
                                   ErrorCode::kInvalidArgument);
  Json report;
  report[kReport.key] = 1;
  report["settings"] = std::move(settings);
  report["steps"] = history.records.size();
  report["best_step"] = history.best_step;
  uint64_t skipped = 0;
  double seconds = 0;
  for (const TrainingRecord& record : history.records) {
    skipped += record.is_skipped;
    seconds += static_cast<double>(record.seconds);
  }
  report["skipped_steps"] = skipped;
  report["seconds"] = reportNumber(seconds);
  report["measured_on"] = history.measured_on_held_out ? "held-out objects" : "training objects";
  report["by_budget"] = rows(history.by_budget);
  report["measures"] = rows(history.measures);
  report["parts"] = history.part_names;
  Json by_step = Json::object(), parts = Json::array();
  for (const TrainingRecord& record : history.records) parts.push_back(record.part);
  by_step["part"] = std::move(parts);
  for (const auto& [name, member] : kColumns) {
    Json values = Json::array();
    for (const TrainingRecord& record : history.records) {
      values.push_back(reportNumber(record.*member));
    }
    by_step[name] = std::move(values);
  }
  report["by_step"] = std::move(by_step);
  writeReport(report, kReport, path);
  writeCurves(trainingPlots(history), curvesPath(path));
}

std::vector<PlotPanel> trainingPlots(const TrainingHistory& history) {
  const std::string objects =
      history.measured_on_held_out ? "held-out objects" : "training objects";
  std::vector<PlotPanel> panels;
  panels.push_back(partsPanel(history, "Loss", "loss", &TrainingRecord::loss));
  panels.push_back(partsPanel(history, "Density above the surface's entropy", "nats",
                              &TrainingRecord::structure));
  panels.push_back(partsPanel(history, "Images", "L1", &TrainingRecord::l1));
  panels.push_back(qualityPanel(history.measures, "Quality on " + objects, false));
  // One budget is a number, not a curve.
  if (history.by_budget.size() != 1) {
    panels.push_back(qualityPanel(history.by_budget, "Quality by budget, " + objects, true));
  }
  PlotPanel rate{"Learning rate", "step", "rate", false, false, true, {}};
  rate.lines = {meanCurve("", history.records.size(), kMeanPieces, [&](size_t i) {
    return static_cast<double>(history.records[i].learning_rate);
  })};
  panels.push_back(std::move(rate));
  return panels;
}

}  // namespace stipple
