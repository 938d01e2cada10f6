#pragma once

#include <memory>

#include "densify/control_part.h"

namespace stipple {

/// A splat and its copy, or two children, are together as opaque as their parent was, where they
/// lie over each other: o' = 1 - sqrt(1 - o). Otherwise pictures darken or brighten with every
/// copy. Owns kChildOpacity. In: copies_alone: children that replace their parent, which lie side
/// by side, keep its opacity.
std::unique_ptr<ControlPart> makeOpacityCorrection(bool copies_alone = false);

}  // namespace stipple
