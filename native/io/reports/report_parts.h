#pragma once

#include <cstddef>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "plot/plot.h"

// What reports of fits and of trainings have in common: JSON with curves beside it.

namespace stipple {

/// Points of a curve: as many as a panel has pixels to show.
constexpr size_t kCurvePoints = 300;

/// What tells a report from other files.
struct ReportKind {
  const char* key;   ///< of its first line
  const char* name;  ///< for messages: "the report of a fit"
};

/// Null where a number is not finite.
nlohmann::ordered_json reportNumber(double value);
/// Six digits of a float: what was measured has no more, and files stay small.
nlohmann::ordered_json reportNumber(float value);

/// Where the curves of a report lie: under its name, with the extension .svg.
std::string curvesPath(const std::string& report_path);
/// Refuses places where a report or its curves cannot be written, or would replace a file of
/// another kind. Errors: kIo, kInvalidArgument.
void requireReportPlaces(const std::string& path, const ReportKind& kind);
/// Errors: as requireReportPlaces(), of the one file.
void writeReport(const nlohmann::ordered_json& report, const ReportKind& kind,
                 const std::string& path);
void writeCurves(const std::vector<PlotPanel>& panels, const std::string& path);

/// Means of `value` over equal pieces of `count` steps, against the number of the step from 1 on.
/// What is not finite counts for nothing.
PlotLine meanCurve(const char* label, size_t count, size_t point_count,
                   const std::function<double(size_t)>& value);

}  // namespace stipple
