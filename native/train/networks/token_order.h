#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/progress.h"

namespace stipple {

/// Which of some places each of as many others goes to, so that the sum of squared distances is the
/// least there is.
struct Assignment {
  std::vector<uint32_t> place_of;  ///< [n] each place once
  double cost = 0;                 ///< that sum
  /// Prices that prove it: cost(i, j) >= row[i] + column[j] for all pairs, and equal where i goes
  /// to j, but for rounding.
  std::vector<double> row, column;
};

/// In: points, places: [n,3] each, finite. Errors: kInvalidArgument for counts that differ, and for
/// numbers that are not finite; kCancelled. Determinism: one thread; the same result everywhere.
/// Cost: O(n^3) at worst; measured in docs/methods/flow.md. Source: R. Jonker, A. Volgenant, A
/// Shortest Augmenting Path Algorithm for Dense and Sparse Linear Assignment Problems, Computing
/// 38, 1987.
Assignment leastSquaresAssignment(std::span<const float> points, std::span<const float> places,
                                  Progress* progress = nullptr);

/// In which order the tokens of a latent are a sequence: token order[j] is the j-th, the one that
/// goes to the j-th of the scrambled Sobol points. In: points [n,3] of the tokens, in the unit
/// cube.
std::vector<uint32_t> tokenOrder(std::span<const float> points, Progress* progress = nullptr);

}  // namespace stipple
