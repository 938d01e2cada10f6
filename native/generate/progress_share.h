#pragma once

#include "base/progress.h"

namespace stipple {

/// The part of a whole that a piece of work is: 0..1 of the piece means begin..end of what
/// listeners are told. Pieces can be cut again.
struct ProgressShare {
  double begin = 0.0;
  double end = 1.0;

  /// In: from, to: 0..1 of this piece.
  ProgressShare part(double from, double to) const { return {at(from), at(to)}; }
  double at(double fraction) const { return begin + (end - begin) * fraction; }
  /// In: progress: null where nobody listens. Errors: kCancelled (Progress::advance).
  void tell(Progress* progress, double fraction, const char* stage) const {
    advance(progress, at(fraction), stage);
  }
};

}  // namespace stipple
