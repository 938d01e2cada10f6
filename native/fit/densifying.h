#pragma once

#include <cstdint>
#include <memory>

#include "base/progress.h"
#include "data/clouds/seen_cloud.h"
#include "data/views/view_source.h"
#include "train/backend/backend_factory.h"
#include "train/loop/densify_cloud.h"

namespace stipple {

/// What is known to be wrong before any view is looked at. Errors: kInvalidArgument for options out
/// of range, a strategy that is not there, and what requireDensifiable() refuses.
void requireDensifyOptions(const DensifyOptions& options, const SplatCloud& cloud,
                           const ViewSource& views);

/// Density control of a cloud that is there, by the views that are not held out (densifyCloud), and
/// what the strategy saw. In: holdout, as splitAsTold() has it.
SeenCloud densified(const BackendFactory& backends, const SplatCloud& cloud,
                    std::shared_ptr<const ViewSource> views, uint64_t holdout,
                    const DensifyOptions& options, Progress* progress);

}  // namespace stipple
