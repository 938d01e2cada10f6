#pragma once

#include "train/anchors/scaffold_state.h"

namespace stipple {

/// A state in which anchors begin with what a finished state has learned of those at the same
/// places (places do not learn, so that they tell which anchors are the same): their features,
/// scales, offsets and moments. It has the finished state's networks and count of steps, so that
/// Adam goes on where it was. Anchors that the finished state has lost begin with what they have
/// and moments of 0; what it has besides is left out. Nothing is counted yet.
/// In: finished: is used up; anchors: of the same shape as its own. Cost: A log A.
ScaffoldState handedOn(ScaffoldState finished, const ScaffoldParameters& anchors);

}  // namespace stipple
