#pragma once

#include <string>

#include "data/accuracy_report.h"

namespace stipple {

/// What each measurement of a fit's written report cost and brought, with the front of the best for
/// their time. Errors: those of readFitAccuracy (io/reports/fit_report.h).
AccuracyReport fitAccuracy(const std::string& path);

}  // namespace stipple
