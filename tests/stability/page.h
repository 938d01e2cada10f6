#pragma once

#include <string>

namespace stipple::testing {

/// Rows of docs/numerical_stability.md, as the tests that measure them fill them in.
struct StabilityPage {
  std::string levels;   ///< lines of the table of levels
  std::string effects;  ///< of that of effects

  static StabilityPage& ofThisRun();
};

/// "1.2e-06", or "0".
std::string shortNumber(double value);

/// Where STIPPLE_STABILITY_TABLE names a file, writes the page there after the last test; fails
/// where a table was not measured or a test has failed.
void writePageAfterTests();

}  // namespace stipple::testing
