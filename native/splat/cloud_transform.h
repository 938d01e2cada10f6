#pragma once

#include "data/splat_cloud.h"
#include "math/vec.h"

namespace stipple {

/// The cloud moved, turned and evenly scaled: data in the frame that `matrix` leads to. Harmonics
/// turn with the object. Results are exact up to one rounding to float32 per value.
/// In: matrix: rotation, translation, one positive scale.
/// Errors: kInvalidArgument for a cloud that validate() refuses, and for a matrix that mirrors,
/// shears or scales unevenly by more than 1e-4 (such objects are drawn through their matrix; splats
/// cannot hold them), or moves or scales a splat out of the range of float32.
/// Cost: O(splats x coefficients), all threads; same result for any number of threads.
SplatCloud transformed(const SplatCloud& cloud, const Mat4d& matrix);

}  // namespace stipple
