#pragma once

#include <span>
#include <string>

#include "network_golden/stage_report.h"

namespace stipple {

/// Compares where `share` of the largest of the expected numbers is allowed, wherever it is.
void compareShare(const std::string& stage, std::span<const float> seen,
                  std::span<const float> expected, double share, StageReport& report);

}  // namespace stipple
