#pragma once

#include "data/clouds/splat_cloud.h"
#include "math/vec.h"

namespace stipple {

/// The cloud in the frame that `matrix` leads to: any affine matrix that can be inverted.
/// Covariances become M C M^T. Rotation, translation, one scale and mirroring keep each splat's
/// axes and their order, and are exact up to one rounding to float32 per value. Uneven scale and
/// shear give each splat new axes, in double, in the order of those that they come from.
/// Harmonics turn (and mirror) with the orthogonal part of the matrix's polar decomposition. So
/// colours equal those of the same cloud drawn through the matrix, unless the matrix scales
/// unevenly or shears and the degree is above 0: drawing then bends the viewing directions, which
/// no harmonics of the same degree can store.
/// The label of the frame stays: what the matrix leads to is the caller's knowledge.
/// Errors: kInvalidArgument for a cloud that validate() refuses, for a matrix that validateAffine
/// refuses (singular, not affine), and where a position or scale leaves the range of float32.
/// Cost: O(splats x coefficients), all threads; same result for any number of threads.
SplatCloud transformed(const SplatCloud& cloud, const Mat4d& matrix);

}  // namespace stipple
