#pragma once

#include <memory>

#include "densify/control_part.h"

namespace stipple {

/// With the published offset, three standard deviations of a child end where those of its parent
/// do: at the tips of the long axis, and at the equator around each child. That of a share d of the
/// parent's half-length 3 s, the offset is 3 d, the others 1 - d and sqrt(1 - d^2); published:
/// 0.45.
struct LongAxisSplitOptions {
  double offset = 1.35;      ///< from the parent's centre to a child's, over its largest scale
  double long_scale = 0.55;  ///< of a child over its parent's, along the parent's longest axis
  double minor_scale = 0.89302855497458755;  ///< sqrt(1 - 0.45^2), along both others
  double opacity = 0.6;                      ///< of a child over its parent's
};

/// Whatever multiplies is replaced by two children, side by side on its longest axis (the first one
/// of several). Owns kChildren and kChildOpacity. Appended: both children of a splat, then those of
/// the next. Quaternions and colours are the parent's.
std::unique_ptr<ControlPart> makeLongAxisSplit(const LongAxisSplitOptions& options = {});

}  // namespace stipple
