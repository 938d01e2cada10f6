#include "measure/fit_accuracy.h"

#include "io/reports/fit_report.h"
#include "measure/accuracy_choice.h"

namespace stipple {

AccuracyReport fitAccuracy(const std::string& path) {
  AccuracyReport report = readFitAccuracy(path);
  markFront(report);
  return report;
}

}  // namespace stipple
