#pragma once

#include <CLI/CLI.hpp>
#include <deque>
#include <optional>
#include <string>

#include "cli/library.h"

namespace stipple::cli {

/// The options of a fit as flags. Names, help, choices and defaults are the library's
/// (stipple_fit_option_info): a new option is a flag without being told here.
class FitFlags {
 public:
  /// Adds --quality, and a flag for every option but the path of the checkpoint.
  void addTo(CLI::App& command);

  /// In: checkpoint: the path that the tool has chosen. The result points into it and into this
  /// object. Throws Failure for a value out of range and for an option of the other model.
  StippleFitOptions options(const std::string& checkpoint) const;

 private:
  struct Flag {
    StippleFitOptionInfo info;
    std::string name;  ///< with --
    std::optional<std::string> text;
    /// The first other name of the option that counts in another unit, and what was given for any.
    std::string scaled_name;
    std::optional<std::string> scaled_text;

    bool isGiven() const { return text || scaled_text; }
  };

  const Flag& flag(const char* name) const;
  void requireModel(const Flag& flag, uint32_t model) const;

  std::deque<Flag> flags_;  ///< CLI11 points at them
  std::string quality_ = "balanced";
};

}  // namespace stipple::cli
