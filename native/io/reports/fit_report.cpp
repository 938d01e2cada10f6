#include "io/reports/fit_report.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/error.h"
#include "io/bytes/json_text.h"
#include "io/reports/report_parts.h"

namespace stipple {

namespace {

using Json = nlohmann::ordered_json;

constexpr ReportKind kReport = {"stipple_fit_report", "the report of a fit"};

Json column(const FitHistory& history, float FitRecord::*member) {
  Json values = Json::array();
  for (const FitRecord& record : history.records) values.push_back(reportNumber(record.*member));
  return values;
}

Json row(const FitMeasure& measure) {
  return {{"iteration", measure.iteration},
          {"budget", measure.budget},
          {"gaussians", measure.splat_count},
          {"psnr", reportNumber(measure.psnr)},
          {"foreground_psnr", reportNumber(measure.foreground_psnr)},
          {"ssim", reportNumber(measure.ssim)},
          {"density_entropy", reportNumber(measure.density_entropy)},
          {"training_psnr", reportNumber(measure.training_psnr)},
          {"moving_psnr", reportNumber(measure.moving_psnr)}};
}

Json rows(const std::vector<FitMeasure>& measures) {
  Json list = Json::array();
  for (const FitMeasure& measure : measures) list.push_back(row(measure));
  return list;
}

constexpr std::pair<const char*, float FitRecord::*> kParts[] = {
    {"render", &FitRecord::render_seconds}, {"backward", &FitRecord::backward_seconds},
    {"field", &FitRecord::field_seconds},   {"optimiser", &FitRecord::optimiser_seconds},
    {"edit", &FitRecord::edit_seconds},     {"other", &FitRecord::other_seconds}};

/// Means of a figure over equal pieces of the fit.
PlotLine curveOf(const FitHistory& history, const char* label, double factor,
                 const std::function<double(const FitRecord&)>& value, size_t point_count) {
  return meanCurve(label, history.records.size(), point_count,
                   [&](size_t i) { return factor * value(history.records[i]); });
}

double lossOf(const FitRecord& record) {
  return static_cast<double>(record.loss);
}

PlotLine measuredCurve(const std::vector<FitMeasure>& measures, const char* label,
                       double FitMeasure::*value, bool by_count) {
  PlotLine line;
  line.label = label;
  line.has_markers = true;
  for (const FitMeasure& measure : measures) {
    line.x.push_back(static_cast<double>(by_count ? measure.splat_count : measure.iteration));
    line.y.push_back(measure.*value);
  }
  return line;
}

}  // namespace

std::string fitPlotsPath(const std::string& report_path) {
  return curvesPath(report_path);
}

void requireFitReportPlace(const std::string& path) {
  requireReportPlaces(path, kReport);
}

void writeFitReport(const FitReportHead& head, const FitHistory& history, const std::string& path) {
  Json settings = parseOrderedJson(head.settings_json, "the text of the report's settings",
                                   ErrorCode::kInvalidArgument);
  Json report;
  report[kReport.key] = 1;
  report["model"] = head.model;
  if (!head.strategy.empty()) report["strategy"] = head.strategy;
  report["settings"] = std::move(settings);
  report["iterations"] = history.records.size();
  report["best_iteration"] = history.best_iteration;
  report["training_views"] = history.training_view_count;
  report["measured_views"] = history.measured_view_count;
  report["measured_on"] = history.measured_on_held_out ? "held-out views" : "training views";
  report["by_budget"] = rows(history.by_budget);
  Json seconds = Json::object(), each = Json::object();
  double all = 0;
  for (const auto& [name, member] : kParts) {
    double sum = 0;
    for (const FitRecord& record : history.records) sum += static_cast<double>(record.*member);
    seconds[name] = reportNumber(sum);
    each[name] = column(history, member);
    all += sum;
  }
  seconds["all"] = reportNumber(all);
  report["seconds"] = std::move(seconds);
  report["measures"] = rows(history.measures);
  Json counts = Json::array();
  for (const FitRecord& record : history.records) counts.push_back(record.splat_count);
  report["by_iteration"] = {{"loss", column(history, &FitRecord::loss)},
                            {"l1", column(history, &FitRecord::l1)},
                            {"ssim", column(history, &FitRecord::ssim)},
                            {"gaussians", std::move(counts)},
                            {"seconds", std::move(each)}};
  writeReport(report, kReport, path);
}

std::vector<PlotPanel> fitPlots(const FitHistory& history) {
  const char* views = history.measured_on_held_out ? "held-out views" : "training views";
  std::vector<PlotPanel> panels;
  PlotPanel loss{"Loss", "iteration", "L1 and SSIM loss", false, true, false, {}};
  loss.lines = {curveOf(history, "each", 1, lossOf, kCurvePoints),
                curveOf(history, "mean of 20 pieces", 1, lossOf, 20)};
  loss.lines[0].is_faint = true;
  panels.push_back(std::move(loss));

  PlotPanel quality{
      std::string("Quality on ") + views, "iteration", "PSNR, dB", false, false, false, {}};
  quality.lines = {measuredCurve(history.measures, "PSNR", &FitMeasure::psnr, false)};
  panels.push_back(std::move(quality));

  // One budget is a number, not a curve.
  if (history.by_budget.size() != 1) {
    PlotPanel budgets{
        std::string("Quality by budget, ") + views, "splats", "PSNR, dB", true, false, false, {}};
    budgets.lines = {measuredCurve(history.by_budget, "PSNR", &FitMeasure::psnr, true)};
    panels.push_back(std::move(budgets));
  }

  PlotPanel counts{"Splats", "iteration", "splats", false, false, true, {}};
  counts.lines = {curveOf(
      history, "splats", 1,
      [](const FitRecord& record) { return static_cast<double>(record.splat_count); },
      kCurvePoints)};
  panels.push_back(std::move(counts));

  PlotPanel time{"Time of an iteration", "iteration", "milliseconds", false, false, true, {}};
  for (const auto& [name, member] : kParts) {
    PlotLine line = curveOf(
        history, name, 1e3,
        [member = member](const FitRecord& record) { return static_cast<double>(record.*member); },
        60);
    // Parts that a model does not have would only fill the legend.
    if (std::any_of(line.y.begin(), line.y.end(), [](double y) { return y > 0; })) {
      time.lines.push_back(std::move(line));
    }
  }
  panels.push_back(std::move(time));

  if (std::any_of(history.measures.begin(), history.measures.end(),
                  [](const FitMeasure& m) { return std::isfinite(m.density_entropy); })) {
    PlotPanel entropy{"Entropy of the density", "iteration", "nats", false, false, false, {}};
    entropy.lines = {
        measuredCurve(history.measures, "entropy", &FitMeasure::density_entropy, false)};
    panels.push_back(std::move(entropy));
  }
  return panels;
}

void writeFitPlots(const FitHistory& history, const std::string& path) {
  writeCurves(fitPlots(history), path);
}

}  // namespace stipple
