#pragma once

#include <functional>
#include <string>
#include <vector>

namespace stipple::testing {

/// A row of the table of effects in docs/numerical_stability.md.
struct EffectCase {
  std::string name;
  std::string effect;
  std::string naive;  ///< what goes wrong in the plain form
  std::string ours;   ///< what stands here instead
  std::string judge;
  double most;  ///< error that is allowed, with its reason where the case is
  /// Draws, expects what every picture promises, and returns the error.
  std::function<double()> measure;
};

std::vector<EffectCase> effectCases();

}  // namespace stipple::testing
