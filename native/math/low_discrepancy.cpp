#include "math/low_discrepancy.h"

#include <array>
#include <cassert>

namespace stipple {

namespace {

constexpr uint32_t kBits = 32;
using Directions = std::array<std::array<uint32_t, kBits>, kSobolDimensions>;

/// A primitive polynomial: its degree, its inner coefficients, and the first numbers m.
struct Polynomial {
  uint32_t degree;
  uint32_t coefficients;
  std::array<uint32_t, 3> first;
};

constexpr Directions makeDirections() {
  Directions v{};
  for (uint32_t i = 0; i < kBits; ++i) v[0][i] = 1u << (kBits - 1 - i);
  const Polynomial polynomials[kSobolDimensions - 1] = {
      {1, 0, {1, 0, 0}}, {2, 1, {1, 3, 0}}, {3, 1, {1, 3, 1}}, {3, 2, {1, 1, 1}}};
  for (uint32_t d = 1; d < kSobolDimensions; ++d) {
    const Polynomial& p = polynomials[d - 1];
    for (uint32_t i = 0; i < kBits; ++i) {
      if (i < p.degree) {
        v[d][i] = p.first[i] << (kBits - 1 - i);
        continue;
      }
      v[d][i] = v[d][i - p.degree] ^ (v[d][i - p.degree] >> p.degree);
      for (uint32_t k = 1; k < p.degree; ++k) {
        if (p.coefficients >> (p.degree - 1 - k) & 1u) v[d][i] ^= v[d][i - k];
      }
    }
  }
  return v;
}

constexpr Directions kDirections = makeDirections();

uint32_t reversed(uint32_t bits) {
  uint32_t result = 0;
  for (uint32_t i = 0; i < kBits; ++i) result |= (bits >> i & 1u) << (kBits - 1 - i);
  return result;
}

/// Each bit changes by a hash of the bits below it.
uint32_t permuted(uint32_t x, uint32_t seed) {
  x += seed;
  x ^= x * 0x6c50b47cu;
  x ^= x * 0xb82f1e52u;
  x ^= x * 0xc7afe638u;
  x ^= x * 0x8d22f6e6u;
  return x;
}

}  // namespace

double scrambledSobol(uint32_t index, uint32_t dimension) {
  assert(dimension < kSobolDimensions);
  uint32_t bits = 0;
  for (uint32_t i = 0; i < kBits; ++i) {
    if (index >> i & 1u) bits ^= kDirections[dimension][i];
  }
  // Any seeds; different ones keep dimensions apart.
  const uint32_t seed = 0x9e3779b9u * (dimension + 1);
  return reversed(permuted(reversed(bits), seed)) * 0x1p-32;
}

double radicalInverse(uint64_t index, uint32_t base) {
  double value = 0;
  double share = 1.0 / base;
  for (; index > 0; index /= base) {
    value += static_cast<double>(index % base) * share;
    share /= base;
  }
  return value;
}

}  // namespace stipple
