#pragma once

#include <string>
#include <vector>

#include "cli/library.h"

namespace stipple::cli {

/// Splat files, each where it was made, and models at the budget that shows them well.
class PlacedClouds {
 public:
  /// In: seconds, the time of splats that move.
  PlacedClouds(const Context& context, const std::vector<std::string>& paths, double seconds = 0);

  const StippleInstance* instances() const { return instances_.data(); }
  uint64_t count() const { return instances_.size(); }

 private:
  std::vector<Cloud> clouds_;
  std::vector<StippleInstance> instances_;
};

}  // namespace stipple::cli
