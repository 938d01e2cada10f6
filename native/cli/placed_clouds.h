#pragma once

#include <string>
#include <vector>

#include "cli/library.h"

namespace stipple::cli {

/// Splat files, each where it was made.
class PlacedClouds {
 public:
  PlacedClouds(const Context& context, const std::vector<std::string>& paths);

  const StippleInstance* instances() const { return instances_.data(); }
  uint64_t count() const { return instances_.size(); }

 private:
  std::vector<Cloud> clouds_;
  std::vector<StippleInstance> instances_;
};

}  // namespace stipple::cli
