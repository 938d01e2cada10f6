#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

#include "decode/tree/moving_cost.h"

namespace stipple {

namespace {

#include "decode/tree/merge_numbers-inl.h"
#include "decode/tree/merge_steps-inl.h"
#include "decode/tree/moving_steps-inl.h"

double mergeOfDoubles(const MovingNodeRows& rows, uint32_t a, uint32_t b, const double* means,
                      MovingNode& node, float* samples) {
  return mergeOverTime<double>(*rows.scale, rows.nodes[a], rows.samplesOf(a), rows.nodes[b],
                               rows.samplesOf(b), means, node, samples);
}

void costsOneByOne(const MovingNodeRows& rows, uint32_t slot, const uint32_t* others, size_t count,
                   float* costs) {
  constexpr double kLargest = std::numeric_limits<float>::max();
  MovingNode node;
  for (size_t i = 0; i < count; ++i) {
    const double error = mergeOfDoubles(rows, slot, others[i], nullptr, node, nullptr);
    costs[i] = static_cast<float>(std::min(error, kLargest));
  }
}

void mergeRows(const MovingNodeRows& rows, uint32_t a, uint32_t b, const double* means,
               MovingMerge& merged) {
  merged.error = mergeOfDoubles(rows, a, b, means, merged.node, merged.samples.data());
}

}  // namespace

MovingMergeKernel scalarMovingMergeKernel() {
  return {"scalar", costsOneByOne, mergeRows};
}

}  // namespace stipple
