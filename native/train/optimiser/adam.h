#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace stipple {

struct AdamOptions {
  double beta1 = 0.9;    ///< 0..1, decay of the first moment; raising it smooths directions
  double beta2 = 0.999;  ///< 0..1, decay of the second moment; raising it steadies step sizes
  /// 1e-15..1, added to the root of the second moment: as gradients of splats are tiny, so is this.
  double epsilon = 1e-15;
};

/// Parameters that share a learning rate, [row_count, row_length], one row per Gaussian. Moments
/// start as zeros and belong to this function from then on. Rows of the four arrays may lie apart,
/// as the first harmonic and the others of a Gaussian do, which have rates of their own.
struct AdamGroup {
  float* parameters = nullptr;
  const float* gradients = nullptr;
  float* first_moments = nullptr;
  float* second_moments = nullptr;
  size_t row_count = 0;
  size_t row_length = 0;
  double learning_rate = 0;  ///< 0..kMaxLearningRate
  size_t row_stride = 0;     ///< elements from a row to the next; 0: row_length, nothing between
};

constexpr double kMaxLearningRate = 1e6;
/// Largest magnitude of a gradient: its square stays inside float32.
constexpr float kLargestGradient = 1e18f;
/// Moments below this become 0: they move nothing, and processors are slow on denormal numbers.
constexpr float kSmallestMoment = 1e-36f;

struct AdamKernel;

/// One step of Adam for all groups in one pass over memory:
/// m += (1 - b1)(g - m), v += (1 - b2)(g^2 - v), p -= rate * m' / (sqrt(v') + epsilon),
/// m' = m/(1 - b1^step), v' = v/(1 - b2^step).
/// In: step: 1 for the first. visible [row_count] or null: rows where it is 0 are left as they are,
/// moments too (sparse Adam; the bias correction stays that of `step`); all groups must then have
/// as many rows.
/// Errors: kInvalidArgument for step 0, options or a rate out of range, null arrays, rows that
/// disagree or overlap; then nothing is changed. For a gradient that is not finite or beyond +-1e18
/// that element keeps its parameter and moments, all others take the step, and the message names
/// the first one: nothing that is not finite enters a parameter. Threads and determinism: pieces in
/// parallel, elements independent: same bits for any number of threads. Cost: O(elements), 28 bytes
/// of memory traffic each; allocates nothing. Source: Kingma, Ba, Adam: A Method for Stochastic
/// Optimization, ICLR 2015, algorithm 1.
void adamStep(std::span<const AdamGroup> groups, uint64_t step, const AdamOptions& options = {},
              const uint8_t* visible = nullptr);

/// The same with a kernel of adamKernels(): for tests and benchmarks.
void adamStepWith(const AdamKernel& kernel, std::span<const AdamGroup> groups, uint64_t step,
                  const AdamOptions& options = {}, const uint8_t* visible = nullptr);

}  // namespace stipple
