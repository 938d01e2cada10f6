#pragma once

#include <cstdint>

namespace stipple {

constexpr uint32_t kSobolDimensions = 5;

/// Number `index` of one dimension of Sobol's sequence under Owen's scrambling with a fixed seed:
/// 0 <= result < 1. Every 2^k numbers from a multiple of 2^k on lie one in each of 2^k equal
/// intervals; of dimensions 0 and 1 together, one in each box of 2^-k in area.
/// In: dimension below kSobolDimensions.
/// Based on: Sobol, USSR Computational Mathematics 1967; Joe and Kuo, Constructing Sobol Sequences
/// with Better Two-Dimensional Projections, SIAM J. Sci. Comput. 2008 (direction numbers); Owen,
/// Randomly Permuted (t,m,s)-Nets, 1995; Burley, Practical Hash-based Owen Scrambling, JCGT 2020
/// (the hash).
double scrambledSobol(uint32_t index, uint32_t dimension);

/// Number `index` of van der Corput's sequence: its digits in `base`, mirrored at the point,
/// 0 <= result < 1. In: base: at least 2; prime ones of several dimensions make Halton's sequence.
double radicalInverse(uint64_t index, uint32_t base);

}  // namespace stipple
