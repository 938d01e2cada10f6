#pragma once

#include "data/clouds/splat_cloud.h"

namespace stipple {

/// The cloud between two that hold the same splats, row by row.
/// Positions, scales, opacities and harmonics go straight. Rotations go the shorter way, as the
/// straight line between unit quaternions of one half space, made unit again; half a turn apart,
/// where both ways are as short, it is the way of the quaternions as they are. Scales go straight
/// and not by their logarithms: what lies on a surface whose vertices go straight is stretched so,
/// a splat may grow from a scale of 0, and no value leaves what lies between the two. What is the
/// same in both stays bit for bit.
/// In: from, to: accepted by validate(), as many splats of one degree; share 0..1 of `to`.
/// Out: out, neither of the two, whose memory is used again; its labels are those of `from`.
/// Threads and determinism: parallel; same bits for any number of threads.
/// Cost: two clouds read and one written.
/// Errors: kInvalidArgument where counts or degrees differ.
void blendClouds(const SplatCloud& from, const SplatCloud& to, double share, SplatCloud& out);

}  // namespace stipple
