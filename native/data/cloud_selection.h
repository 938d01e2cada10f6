#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "data/splat_cloud.h"
#include "math/vec.h"

namespace stipple {

/// Which splats have their centre in a box: 1 inside (faces included), 0 outside. [N]
/// In: cloud_to_box: affine and invertible, into the frame in which the box is the cube from -1 to
/// 1. Evaluated in double.
std::vector<uint8_t> insideBox(const SplatCloud& cloud, const Mat4d& cloud_to_box);

/// The splats whose mask [N] is not 0, in their order, bit for bit.
/// Errors: kInvalidArgument where the mask has another length than the cloud.
SplatCloud kept(const SplatCloud& cloud, std::span<const uint8_t> mask);

}  // namespace stipple
