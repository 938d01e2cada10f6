#pragma once

#include <cstdint>

#include "cli/library.h"

namespace stipple::cli {

/// The merge tree of a cloud, with progress. In: seed of the views that tell what is seen.
Model hierarchyOf(const Context& context, const Cloud& cloud, uint64_t seed);

/// The splats of a budget, 1 to the count of the hierarchy's cloud.
Cloud cutOf(const Model& hierarchy, uint64_t count);

}  // namespace stipple::cli
