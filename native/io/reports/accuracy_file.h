#pragma once

#include <string>

#include "data/accuracy_report.h"
#include "plot/plot.h"

namespace stipple {

/// Writes a report by the extension of its name: .json (everything), .csv (a line per setting) or
/// .svg (accuracyPlot). docs/formats.md, "Accuracy report". Errors: kInvalidArgument for another
/// extension, and where the path has a file that is no such report; kIo.
void writeAccuracyReport(const AccuracyReport& report, const std::string& path);

/// Error against time, both logarithmic: a named dot for each setting whose error is not 0, and a
/// line through those on the front.
PlotSheet accuracyPlot(const AccuracyReport& report);

}  // namespace stipple
