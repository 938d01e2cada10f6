#pragma once

#include <memory>
#include <utility>

#include "data/clouds/splat_cloud.h"
#include "data/clouds/splat_quantities.h"

namespace stipple {

/// Splats, and what density control saw of them.
struct SeenCloud {
  SeenCloud() = default;
  SeenCloud(SplatCloud splats, SplatQuantities quantities)
      : cloud(std::make_shared<const SplatCloud>(std::move(splats))),
        seen(std::make_shared<const SplatQuantities>(std::move(quantities))) {}

  std::shared_ptr<const SplatCloud> cloud;
  std::shared_ptr<const SplatQuantities> seen;
};

}  // namespace stipple
