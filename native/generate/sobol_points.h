#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace stipple {

/// Bits of a coordinate of the scrambled Sobol sequence.
constexpr uint32_t kSobolBits = 30;
/// The sequence repeats after so many points.
constexpr uint64_t kMostSobolPoints = uint64_t{1} << kSobolBits;

/// The first `count` points as integers of kSobolBits bits. Errors: kInvalidArgument for more than
/// kMostSobolPoints.
std::vector<std::array<uint32_t, 3>> sobolIntegers(uint64_t count);

/// The place of each token of a latent: [count, 3] in [0, 1), the integers times 2^-30 in float32.
/// The points of a smaller count are the first of those of a larger one. Published flow networks
/// were trained with exactly these, and their files do not hold them.
/// Errors: as sobolIntegers(). Cost: O(count); the scrambling costs 2790 random numbers.
std::vector<float> sobolPoints(uint64_t count);

}  // namespace stipple
