#pragma once

#include <vector>

#include "data/accuracy_report.h"

namespace stipple {

/// PSNR and errors of a row. In: differences from the reference, any sign; they are reordered.
void setErrors(std::vector<float>& differences, AccuracyRow& row);

/// Median and quartiles of a row's times. In: at least one, seconds.
void setSeconds(std::vector<double> times, AccuracyRow& row);

}  // namespace stipple
