#pragma once

#include <stipple/stipple.h>

#include <CLI/CLI.hpp>

#include <optional>
#include <string>

namespace stipple::cli {

/// --accuracy and the single knobs beside it.
struct AccuracyArguments {
  std::string level = "final";
  std::string order, projection, antialiasing, precision;
  std::optional<uint32_t> samples, degree;
  std::optional<double> min_alpha, share;
};

void addAccuracyOptions(CLI::App& command, AccuracyArguments& arguments);

/// The level with its knobs changed. Errors: Failure, by the library's message.
StippleAccuracy accuracyOf(const AccuracyArguments& arguments);

}  // namespace stipple::cli
