#include "network_golden/compare_share.h"

#include <algorithm>
#include <cmath>

namespace stipple {

void compareShare(const std::string& stage, std::span<const float> seen,
                  std::span<const float> expected, double share, StageReport& report) {
  double largest = 0;
  for (const float value : expected) {
    largest = std::max(largest, std::abs(static_cast<double>(value)));
  }
  report.compare(stage, seen, expected, {share * largest, 0});
}

}  // namespace stipple
