#pragma once

#include <memory>

#include "decode/anchors/scaffold.h"
#include "model/splat_model.h"

namespace stipple {

/// The kind "scaffold": anchors with features, in the order of what removing them costs, and
/// networks that make splats of them. A budget is the first P anchors; it has no density.
/// Errors: kInvalidArgument for no anchors.
std::shared_ptr<const SplatModel> makeScaffoldSplats(
    std::shared_ptr<const ScaffoldParameters> scaffold, ModelNotes notes = {});

}  // namespace stipple
