#pragma once

#include <memory>

#include "decode/tree/hierarchy_decoder.h"
#include "model/splat_model.h"

namespace stipple {

/// The kind "hierarchy": an existing cloud at any budget, by the tree of its merges. It has no
/// density.
std::shared_ptr<const SplatModel> makeHierarchySplats(
    std::shared_ptr<const HierarchyDecoder> hierarchy, ModelNotes notes = {});

}  // namespace stipple
