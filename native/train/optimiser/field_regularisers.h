#pragma once

#include "data/clouds/splat_cloud.h"
#include "decode/field/field_decoder.h"

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
/// The spread counts all pairs of anchors, of which only those within an anchor's deviation are
/// visited: they are looked up in the grid that the order of leaves is. In: anchors whose leaves
/// hold their positions. Cost: O(N + pairs that count), and O(log P) for an anchor whose deviation
/// reaches past its nearest six.
double regularise(const FieldRegularisers& weights, const FieldParameters& field,
                  const AnchorSet& anchors, const FieldTape& tape, const SplatCloud& cloud,
                  SplatCloud& gradient);

}  // namespace stipple
