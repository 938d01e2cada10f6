#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <optional>
#include <string>

#include "cli/library.h"

namespace stipple::cli {

/// Flags that say which images of a scene that moves are used.
class SeriesFlags {
 public:
  void addTo(CLI::App& command);

  /// What was asked for. In: is_moving: the splats will move, so that all frames are wanted. The
  /// result points into this object. Throws Failure for texts that say nothing.
  void set(bool is_moving, StippleViewsOpenOptions& options) const;

  bool holdsOut() const { return held_out_.has_value(); }

 private:
  std::optional<std::string> frames_, held_out_;
  std::optional<double> frame_rate_;
  int64_t max_images_ = 0;
};

/// The views of a data set, whose pictures are read when they are wanted. In: downscale: as
/// --downscale has it; series: null: the listed images.
Views openViews(const Context& context, const std::string& dataset, int64_t downscale,
                const SeriesFlags* series = nullptr, bool is_moving = false);

/// Prints how many images, cameras and frames there are, where there are several frames.
void printSeries(const Views& views);

}  // namespace stipple::cli
