#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "data/clouds/splat_cloud.h"
#include "math/vec.h"

namespace stipple {

/// Which splats have their centre in a box: 1 inside (faces included), 0 outside. [N]
/// In: cloud_to_box: affine and invertible, into the frame in which the box is the cube from -1 to
/// 1. Evaluated in double.
std::vector<uint8_t> insideBox(const SplatCloud& cloud, const Mat4d& cloud_to_box);

/// A selection becomes its opposite: 1 where it was 0.
void invertMask(std::vector<uint8_t>& mask);

/// How many splats a mask of 0 and 1 selects.
uint64_t selectedCount(std::span<const uint8_t> mask);

/// Positions [n,3] of splats whose mask [N] is not 0: all, or `most` that are evenly spread over
/// their indices. Errors: kInvalidArgument where the mask has another length than the cloud.
std::vector<float> selectedPositions(const SplatCloud& cloud, std::span<const uint8_t> mask,
                                     size_t most);

/// Which of `total` splats a plain thinning to `count` keeps: 1 for those with the smallest numbers
/// keyed by (seed, index). [total] A smaller count is a part of a larger one, and the choice looks
/// at nothing but the index: frames of a series whose splats keep their places thin alike. Errors:
/// kInvalidArgument where count is larger than total.
std::vector<uint8_t> thinningMask(size_t total, size_t count, uint64_t seed);

/// The splats of thinningMask(), in their order, each axis longer by the cube root of N / count:
/// together they keep their volume. All of them, bit for bit, where count is N. (Keeping the area
/// that they cover, by the square root, blurs scans whose splats overlap: 1 dB less on one of 150 k
/// splats at every share from 5 to 50 %, and as much as not widening them at all.)
SplatCloud thinned(const SplatCloud& cloud, size_t count, uint64_t seed);

/// The splats whose mask [N] is not 0, in their order, bit for bit.
/// Errors: kInvalidArgument where the mask has another length than the cloud.
SplatCloud kept(const SplatCloud& cloud, std::span<const uint8_t> mask);

}  // namespace stipple
