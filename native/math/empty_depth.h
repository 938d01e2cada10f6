#pragma once

namespace stipple {

/// Depth of pixels that nothing covers, metres (Blender's value for empty pixels).
constexpr float kEmptyDepth = 1e10f;

}  // namespace stipple
