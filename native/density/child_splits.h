#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/random.h"

namespace stipple {

// The arithmetic of one 8-way choice, shared by the sampling of any model and by the precomputed
// tables of an OctreeDensity: both must give the same bits.

/// Key of a cell, unique over all levels: a leading one, then the path from the root, three bits
/// per level. Below 2^31 up to level 10.
inline uint64_t cellKey(int level, uint64_t cell) {
  return uint64_t{1} << (3 * level) | cell;
}

/// Probabilities of the eight children from their float logarithms; -inf gives 0 and never meets
/// exp. They need not sum to one. Errors: kInvalidArgument for NaN, +inf, or no positive one.
std::array<double, 8> childProbabilities(const float* log_probabilities);

/// Cumulative sums of the probabilities divided by their total; the last positive child has 1.
std::array<double, 8> cumulativeShares(const std::array<double, 8>& probabilities);

/// How many of the n points u_j = (U + j)/n, j = 0..n-1, lie at or below `upper`:
/// floor(n upper - U) + 1, kept within 0..n. In: one_minus_u = 1 - U.
inline uint32_t systematicBelow(uint32_t n, double upper, double one_minus_u) {
  const double below = static_cast<double>(n) * upper + one_minus_u;
  return std::min(n, static_cast<uint32_t>(static_cast<int32_t>(below)));
}

constexpr uint64_t kFullShare = uint64_t{1} << 32;

/// Shares of the upper halves of the seven binary splits of a cell, in units of 2^-32. Node 1
/// splits along z, nodes 2..3 along y, 4..7 along x; node h has the children 2h (lower half) and 2h
/// + 1, and node 8 + k is child k. A share is 0 or 2^32 only where the other half has no mass at
/// all.
using BinaryShares = std::array<uint64_t, 8>;
BinaryShares binaryShares(const std::array<double, 8>& probabilities);

/// Share of `upper` in lower + upper in units of 2^-32, within 2^-33 of the quotient, or 2^-32
/// where it keeps a half with mass from vanishing.
uint64_t upperShare(double lower, double upper);

/// How many of n anchors go to the upper half: floor(n p + U), p and U in units of 2^-32.
/// Both n - up and up never fall as n grows, which nests the anchors. In: n <= 2^28.
inline uint32_t upperCount(uint32_t n, uint64_t share, uint32_t u) {
  return static_cast<uint32_t>((n * share + u) >> 32);
}

/// The 32-bit U of a random number of the keyed generator.
inline uint32_t splitUniform(uint64_t bits) {
  return static_cast<uint32_t>(bits >> 32);
}

/// Parts the arrival ranks of a node's anchors as `upperCount` parts their number: the i-th anchor
/// goes up where floor(i p + U) > floor((i - 1) p + U). Stable: both parts stay ascending.
/// In: scratch [ranks.size()]. Out: lower part first.
void partRanks(std::span<uint32_t> ranks, uint64_t share, uint32_t u, uint32_t* scratch);

}  // namespace stipple
