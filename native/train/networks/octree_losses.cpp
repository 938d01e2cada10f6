// Based on: DeG, density-sampled Gaussians (arXiv 2605.16355), its structural loss and density
// gradient, without automatic differentiation.
#include "train/networks/octree_losses.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace stipple {

namespace {

constexpr size_t kChildren = 8;

}  // namespace

std::vector<OctreeLevel> levelsAbove(std::span<const uint64_t> leaves, int leaf_level,
                                     std::span<const double> weights) {
  std::vector<size_t> order(leaves.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return leaves[a] < leaves[b]; });
  std::vector<OctreeLevel> levels(static_cast<size_t>(leaf_level));
  for (int level = 0; level < leaf_level; ++level) {
    OctreeLevel& made = levels[static_cast<size_t>(level)];
    made.level = level;
    for (const size_t i : order) {
      const uint64_t child = leaves[i] >> 3 * (leaf_level - level - 1);
      if (made.cells.empty() || made.cells.back() != child >> 3) {
        made.cells.push_back(child >> 3);
        made.weights.resize(made.weights.size() + kChildren, 0.0);
      }
      made.weights[(made.cells.size() - 1) * kChildren + (child & 7)] += weights[i];
    }
  }
  return levels;
}

double weighLogProbabilities(std::span<const OctreeLevel> levels, std::span<const float> logits,
                             double factor, std::span<float> gradient) {
  double whole = 0;
  size_t row = 0;
  for (const OctreeLevel& level : levels) {
    for (size_t cell = 0; cell < level.cells.size(); ++cell, ++row) {
      const float* of = &logits[row * kChildren];
      const double* weights = &level.weights[cell * kChildren];
      const double peak = static_cast<double>(*std::max_element(of, of + kChildren));
      double shares[kChildren], sum = 0, weight = 0;
      for (size_t k = 0; k < kChildren; ++k) {
        shares[k] = std::exp(static_cast<double>(of[k]) - peak);
        sum += shares[k];
        weight += weights[k];
      }
      for (size_t k = 0; k < kChildren; ++k) {
        const double log_q = static_cast<double>(of[k]) - peak - std::log(sum);
        if (weights[k] != 0) whole += weights[k] * log_q;
        gradient[row * kChildren + k] =
            static_cast<float>(factor * (weights[k] - weight * shares[k] / sum));
      }
    }
  }
  return factor * whole;
}

double leastCrossEntropy(const OctreeLevel& level) {
  constexpr double kNothing = 1e-8;
  double sum = 0;
  for (size_t cell = 0; cell < level.cells.size(); ++cell) {
    const double* weights = &level.weights[cell * kChildren];
    const double whole = std::accumulate(weights, weights + kChildren, 0.0);
    for (size_t k = 0; k < kChildren; ++k) {
      if (weights[k] > 0) sum -= weights[k] * std::log(weights[k] / whole + kNothing);
    }
  }
  return sum;
}

}  // namespace stipple
