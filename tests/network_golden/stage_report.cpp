#include "network_golden/stage_report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace stipple {
namespace {

std::string countText(size_t seen, size_t expected) {
  return std::to_string(seen) + " numbers, " + std::to_string(expected) + " are expected";
}

}  // namespace

void StageReport::print(const std::string& stage, bool passed, const std::string& text) {
  ++stage_count_;
  if (!passed) ++failure_count_;
  std::printf("%s  %-32s %s\n", passed ? "ok  " : "FAIL", stage.c_str(), text.c_str());
}

void StageReport::compare(const std::string& stage, std::span<const float> seen,
                          std::span<const float> expected, StageTolerance tolerance) {
  if (seen.size() != expected.size() || seen.empty()) {
    print(stage, false, countText(seen.size(), expected.size()));
    return;
  }
  double largest = 0.0, worst = 0.0;  // error; error / what is allowed
  double errors = 0.0, squares = 0.0;
  size_t worst_index = 0;
  for (size_t i = 0; i < seen.size(); ++i) {
    const double want = static_cast<double>(expected[i]);
    double error = std::abs(static_cast<double>(seen[i]) - want);
    double ratio = error / (tolerance.absolute + tolerance.relative * std::abs(want));
    if (!std::isfinite(error)) error = ratio = HUGE_VAL;
    largest = std::max(largest, error);
    errors += error * error;
    squares += want * want;
    if (ratio > worst) {
      worst = ratio;
      worst_index = i;
    }
  }
  char text[160];
  if (judgement_ == StageJudgement::kErrors) {
    std::snprintf(text, sizeof(text),
                  "largest error %.2e, root of mean square %.2e of the numbers'", largest,
                  squares > 0.0 ? std::sqrt(errors / squares) : std::sqrt(errors));
    return print(stage, std::isfinite(errors), text);
  }
  std::snprintf(text, sizeof(text),
                "largest error %.2e, allowed %.0e + %.0e |x|: %.0f %% of it at %zu (%g for %g)",
                largest, tolerance.absolute, tolerance.relative, 100.0 * worst, worst_index,
                static_cast<double>(seen[worst_index]), static_cast<double>(expected[worst_index]));
  print(stage, worst <= 1.0, text);
}

template <typename T>
void StageReport::compareIntegers(const std::string& stage, std::span<const T> seen,
                                  std::span<const T> expected) {
  if (seen.size() != expected.size() || seen.empty()) {
    print(stage, false, countText(seen.size(), expected.size()));
    return;
  }
  size_t differing = 0, first = 0;
  for (size_t i = seen.size(); i-- > 0;) {
    if (seen[i] == expected[i]) continue;
    ++differing;
    first = i;
  }
  if (differing == 0) {
    print(stage, true, "all " + std::to_string(seen.size()) + " are equal");
    return;
  }
  print(stage, judgement_ == StageJudgement::kErrors,
        std::to_string(differing) + " of " + std::to_string(seen.size()) +
            " differ, the first at " + std::to_string(first) + " (" + std::to_string(seen[first]) +
            " for " + std::to_string(expected[first]) + ")");
}

void StageReport::compareExactly(const std::string& stage, std::span<const int64_t> seen,
                                 std::span<const int64_t> expected) {
  compareIntegers(stage, seen, expected);
}

void StageReport::compareExactly(const std::string& stage, std::span<const uint8_t> seen,
                                 std::span<const uint8_t> expected) {
  compareIntegers(stage, seen, expected);
}

void StageReport::failed(const std::string& stage, const std::string& reason) {
  print(stage, false, reason);
}

}  // namespace stipple
