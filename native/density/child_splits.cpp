#include "density/child_splits.h"

#include <cmath>
#include <limits>
#include <string>

#include "base/error.h"

namespace stipple {

std::array<double, 8> childProbabilities(const float* log_probabilities) {
  constexpr float kNothing = -std::numeric_limits<float>::infinity();
  std::array<double, 8> probabilities{};
  double total = 0.0;
  for (size_t k = 0; k < 8; ++k) {
    if (log_probabilities[k] == kNothing) continue;
    probabilities[k] = std::exp(static_cast<double>(log_probabilities[k]));
    total += probabilities[k];
  }
  if (!std::isfinite(total) || total <= 0.0) {
    std::string seen;
    for (size_t k = 0; k < 8; ++k) {
      seen += (k == 0 ? "" : ", ") + std::to_string(log_probabilities[k]);
    }
    fail(ErrorCode::kInvalidArgument,
         "the density model gave the child log-probabilities " + seen +
             "; allowed are finite values or -inf with at least one positive probability");
  }
  return probabilities;
}

std::array<double, 8> cumulativeShares(const std::array<double, 8>& probabilities) {
  std::array<double, 8> shares;
  double sum = 0.0;
  for (size_t k = 0; k < 8; ++k) shares[k] = sum += probabilities[k];
  for (double& share : shares) share /= sum;
  return shares;
}

uint64_t upperShare(double lower, double upper) {
  if (upper <= 0.0) return 0;
  if (lower <= 0.0) return kFullShare;
  const double share = upper / (lower + upper) * static_cast<double>(kFullShare);
  return std::clamp<uint64_t>(static_cast<uint64_t>(share + 0.5), 1, kFullShare - 1);
}

BinaryShares binaryShares(const std::array<double, 8>& probabilities) {
  std::array<double, 16> mass;
  std::copy(probabilities.begin(), probabilities.end(), mass.begin() + 8);
  BinaryShares shares{};
  for (size_t node = 7; node >= 1; --node) {
    mass[node] = mass[2 * node] + mass[2 * node + 1];
    shares[node] = upperShare(mass[2 * node], mass[2 * node + 1]);
  }
  return shares;
}

void partRanks(std::span<uint32_t> ranks, uint64_t share, uint32_t u, uint32_t* scratch) {
  size_t lower = 0;
  size_t upper = 0;
  uint64_t fraction = u;
  for (const uint32_t rank : ranks) {
    fraction += share;
    const size_t up = static_cast<size_t>(fraction >> 32);  // 0 or 1: the share is at most 2^32
    fraction &= kFullShare - 1;
    ranks[lower] = rank;
    scratch[upper] = rank;
    lower += 1 - up;
    upper += up;
  }
  std::copy(scratch, scratch + upper, ranks.begin() + static_cast<std::ptrdiff_t>(lower));
}

}  // namespace stipple
