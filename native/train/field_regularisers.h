#pragma once

#include "data/splat_cloud.h"
#include "decode/field_decoder.h"

namespace stipple {

/// Weights of DeG's training (arXiv 2605.16355).
struct FieldRegularisers {
  double volume = 1.0;     ///< mean product of a Gaussian's three scales
  double opacity = 0.001;  ///< 1 minus the mean opacity: opaque where it does not matter
  /// Keeps the Gaussians of an anchor around it (their mean within half their deviation), and
  /// their deviation below the distance to any other anchor.
  double spread = 100.0;
};

/// Their value, and the derivative by the cloud added to `gradient`. Lengths are in the anchors'
/// units, as DeG's are in the unit cube. In: what FieldDecoder::forward got, left and gave.
/// Differs from DeG: distances to other anchors are looked up among the nearest ones only, where
/// the term can be positive, not among all pairs. Cost: O(N).
double regularise(const FieldRegularisers& weights, const FieldParameters& field,
                  const AnchorSet& anchors, const FieldTape& tape, const SplatCloud& cloud,
                  SplatCloud& gradient);

}  // namespace stipple
