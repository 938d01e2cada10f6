#pragma once

#include <string>

#include "data/accuracy_report.h"
#include "data/fit_history.h"
#include "plot/plot.h"

namespace stipple {

/// What a report says beside the history.
struct FitReportHead {
  std::string model;     ///< "explicit", "field"
  std::string strategy;  ///< of explicit splats; else empty
  std::string settings_json = "{}";
};

/// The history of a fit as JSON (docs/formats.md, "Fit report"): a head, one array per figure of
/// the iterations, the measurements, and the result by budget. Numbers that are not finite are
/// null. Errors: kIo; kInvalidArgument where settings_json is no JSON, or the path has a file of
/// another kind.
void writeFitReport(const FitReportHead& head, const FitHistory& history, const std::string& path);

/// What each measurement of a written report cost and brought, in the form of a report of accuracy:
/// seconds are those of all iterations up to it, errors those of the views that it was measured on.
/// Which are on the front is left to measure/fit_accuracy.h.
/// Errors: kIo; kFormat for a file that is no such report; kInvalidArgument for one of a fit that
/// measured nothing.
AccuracyReport readFitAccuracy(const std::string& path);

/// Where the plots of a report lie: under its name, with the extension .svg.
std::string fitPlotsPath(const std::string& report_path);
/// Refuses places where a report or its plots cannot be written, or would replace a file of another
/// kind. Errors: kIo, kInvalidArgument.
void requireFitReportPlace(const std::string& path);

/// The same as plots: loss, quality on held-out views, quality by budget, number of splats, time by
/// part, entropy of the density where there is one.
std::vector<PlotPanel> fitPlots(const FitHistory& history);
void writeFitPlots(const FitHistory& history, const std::string& path);

}  // namespace stipple
