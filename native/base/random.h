#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace stipple {

/// 64 well-mixed bits of a key: the finaliser of SplitMix64 (Steele, Lea, Flood, Fast Splittable
/// Pseudorandom Number Generators, OOPSLA 2014).
inline uint64_t mixBits(uint64_t x) {
  x += 0x9e3779b97f4a7c15ull;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}

/// What a keyed number is for; part of the key, so that two uses never share a number.
enum class RandomUse : uint32_t {
  kSystematicSplit = 1,
  kProgressiveSplit = 2,
  kLeafJitter = 3,
  kSurfaceSample = 4,
  kDecoder = 5,
  kGroundPlane = 6,
  kPalette = 9,
  kViewRig = 10,
  kViewOrder = 11,
  kThinning = 12,
  kDropout = 14,
  kSplitOffset = 20,
  kDensifyChoice = 23,
  kRelocation = 24,
  kSplatNoise = 25,
  kBirthChoice = 26,
  kBirthPlace = 27,
  kBirthAcceptance = 28,
  kRemovalChoice = 29,
  kStartChoice = 21,
  kStartPoint = 22,
  kBackground = 13,
  kStartMoment = 14,
  kNetworkStart = 30,
  kFieldStart = 31,
  kAnchorBudget = 32,
  kAnchorSeed = 33,
  kPriorSample = 34,
  kSeeThrough = 35,
  kSurfacePart = 36,
  kMovingSample = 37,
  kColourNoise = 40,
  kTokenNoise = 41,
  kCameraNoise = 42,
  kFlowTime = 43,
};

/// 64 random bits keyed by (seed, use, index): the same key gives the same bits in any order and
/// on any thread.
inline uint64_t keyedBits(uint64_t seed, RandomUse use, uint64_t index) {
  return mixBits(mixBits(seed ^ (static_cast<uint64_t>(use) << 56)) ^ index);
}

/// Uniform double in [0, 1) from the upper 53 bits.
inline double unitDouble(uint64_t bits) {
  return static_cast<double>(bits >> 11) * 0x1.0p-53;
}

/// A number of the standard normal distribution from two uniform ones in [0, 1): Box, Muller, A
/// Note on the Generation of Random Normal Deviates, Annals of Mathematical Statistics 1958.
inline double normalOf(double u, double v) {
  return std::sqrt(-2 * std::log1p(-u)) * std::cos(6.283185307179586 * v);
}

/// Uniform float in [0, 1) from 24 bits.
inline float unitFloat(uint64_t bits) {
  return static_cast<float>(bits >> 40) * 0x1.0p-24f;
}

}  // namespace stipple
