#pragma once

#include <span>

namespace stipple {

struct ContributionNormalisation {
  bool clamp = true;            ///< anchors that do harm count as neutral: min(g, 0)
  bool clip = true;             ///< beyond the 90th percentile of |g| where g is not 0
  bool centre = true;           ///< minus the mean over all anchors
  bool counts_neutral = false;  ///< that percentile is of all anchors, as published
};

/// Makes what each anchor does to the loss (negative: lowers it) into the derivative that reaches
/// its log q, in this order: clamp, clip, centre. Anchors of 0 do not show, or were clamped: they
/// take no part in the percentile, as one view shows only a part of the anchors, but in the mean:
/// what never shows loses density.
/// Source: DeG (arXiv 2605.16355), gradient normalisation. Differs: the percentile.
void normaliseContributions(const ContributionNormalisation& options, std::span<double> g);

}  // namespace stipple
