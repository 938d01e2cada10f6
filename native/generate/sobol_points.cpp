// Based on: Joe, Kuo, Remark on Algorithm 659: Implementing Sobol's Quasirandom Sequence Generator,
// ACM TOMS 2003, for the sequence; Matousek, On the L2-Discrepancy for Anchored Boxes, J.
// Complexity 1998, for the random lower-triangular scrambling. The order in which random bits are
// drawn is that of torch.quasirandom.SobolEngine(3, scramble=True, seed=123), since a published
// network depends on every bit of the points.
#include "generate/sobol_points.h"

#include <bit>
#include <random>
#include <string>

#include "base/error.h"

namespace stipple {

namespace {

constexpr size_t kDimensions = 3;
constexpr uint32_t kScramblingSeed = 123;
using Directions = std::array<std::array<uint32_t, kSobolBits>, kDimensions>;

struct Scrambled {
  std::array<uint32_t, kDimensions> shift = {};
  Directions directions = {};
};

/// Direction numbers of the first three dimensions: all m = 1; x + 1 from m = 1; x^2 + x + 1 from
/// m = 1, 3. Number j is m_j << (29 - j).
Directions plainDirections() {
  Directions directions = {};
  std::array<std::array<uint32_t, kSobolBits>, kDimensions> m = {};
  m[2][0] = 1;
  m[2][1] = 3;
  m[1][0] = 1;
  for (size_t j = 0; j < kSobolBits; ++j) {
    m[0][j] = 1;
    if (j >= 1) m[1][j] = m[1][j - 1] ^ (m[1][j - 1] << 1);
    if (j >= 2) m[2][j] = m[2][j - 2] ^ (m[2][j - 1] << 1) ^ (m[2][j - 2] << 2);
    for (size_t d = 0; d < kDimensions; ++d) directions[d][j] = m[d][j] << (kSobolBits - 1 - j);
  }
  return directions;
}

Scrambled scrambled() {
  std::mt19937 bits(kScramblingSeed);
  const auto drawBit = [&]() { return static_cast<uint32_t>(bits() & 1u); };
  Scrambled result;
  for (size_t d = 0; d < kDimensions; ++d) {
    for (uint32_t i = 0; i < kSobolBits; ++i) result.shift[d] |= drawBit() << i;
  }
  const Directions plain = plainDirections();
  for (size_t d = 0; d < kDimensions; ++d) {
    for (uint32_t row = 0; row < kSobolBits; ++row) {
      // A row of the lower triangle, column c at bit 29 - c. Bits right of the diagonal are drawn
      // too and go unused.
      uint32_t mask = 0;
      for (uint32_t column = 0; column < kSobolBits; ++column) {
        const uint32_t bit = drawBit();
        if (column < row) mask |= bit << (kSobolBits - 1 - column);
      }
      const uint32_t place = kSobolBits - 1 - row;
      mask |= 1u << place;
      for (size_t j = 0; j < kSobolBits; ++j) {
        const auto parity = static_cast<uint32_t>(std::popcount(mask & plain[d][j]) & 1);
        result.directions[d][j] |= parity << place;
      }
    }
  }
  return result;
}

}  // namespace

std::vector<std::array<uint32_t, 3>> sobolIntegers(uint64_t count) {
  if (count > kMostSobolPoints) {
    fail(ErrorCode::kInvalidArgument, std::to_string(count) +
                                          " Sobol points are asked for; there are " +
                                          std::to_string(kMostSobolPoints));
  }
  std::vector<std::array<uint32_t, 3>> points(count);
  const Scrambled table = scrambled();
  std::array<uint32_t, kDimensions> point = table.shift;
  for (uint64_t i = 0; i < count; ++i) {
    points[i] = point;
    const auto lowest_zero = static_cast<size_t>(std::countr_one(i));
    if (lowest_zero >= kSobolBits) break;
    for (size_t d = 0; d < kDimensions; ++d) point[d] ^= table.directions[d][lowest_zero];
  }
  return points;
}

std::vector<float> sobolPoints(uint64_t count) {
  const std::vector<std::array<uint32_t, 3>> integers = sobolIntegers(count);
  std::vector<float> points(kDimensions * integers.size());
  for (size_t i = 0; i < integers.size(); ++i) {
    for (size_t d = 0; d < kDimensions; ++d) {
      points[kDimensions * i + d] = static_cast<float>(integers[i][d]) * 0x1.0p-30f;
    }
  }
  return points;
}

}  // namespace stipple
