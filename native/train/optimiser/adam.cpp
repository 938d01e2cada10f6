// Based on: Kingma, Ba, Adam: A Method for Stochastic Optimization, ICLR 2015, algorithm 1.
// Differs: moments below 1e-36 become 0; rows can be left out.

#include "train/optimiser/adam.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "train/optimiser/adam_kernel.h"

namespace stipple {

namespace {

/// Elements of a piece of work: 4 arrays of 64 KB, so that starting a piece costs nothing beside
/// it.
constexpr size_t kPiece = 16384;

void requireWithin(double value, double low, double high, const char* what) {
  if (value >= low && value <= high) return;
  fail(ErrorCode::kInvalidArgument, std::string(what) + " is " + std::to_string(value) +
                                        "; it must be within " + std::to_string(low) + " and " +
                                        std::to_string(high));
}

void validate(std::span<const AdamGroup> groups, uint64_t step, const AdamOptions& options,
              bool sparse) {
  if (step == 0) fail(ErrorCode::kInvalidArgument, "step is 0; the first step is 1");
  // At 1 a moment would never move and its bias correction would divide by zero.
  constexpr double kLargestBeta = 1 - 1e-7;
  requireWithin(options.beta1, 0, kLargestBeta, "beta1");
  requireWithin(options.beta2, 0, kLargestBeta, "beta2");
  if (!(options.epsilon >= 1e-15 && options.epsilon <= 1)) {
    fail(ErrorCode::kInvalidArgument,
         "epsilon is " + std::to_string(options.epsilon) + "; it must be within 1e-15 and 1");
  }
  for (size_t i = 0; i < groups.size(); ++i) {
    const AdamGroup& group = groups[i];
    const std::string name = "group " + std::to_string(i);
    if (!(group.learning_rate >= 0 && group.learning_rate <= kMaxLearningRate)) {
      fail(ErrorCode::kInvalidArgument, name + ": learning_rate is " +
                                            std::to_string(group.learning_rate) +
                                            "; it must be within 0 and 1e6");
    }
    if (group.row_count * group.row_length > 0 &&
        (!group.parameters || !group.gradients || !group.first_moments || !group.second_moments)) {
      fail(ErrorCode::kInvalidArgument, name + ": an array is null; four are needed");
    }
    if (group.row_stride != 0 && group.row_stride < group.row_length) {
      fail(ErrorCode::kInvalidArgument, name + ": row_stride is " +
                                            std::to_string(group.row_stride) + "; 0 or at least " +
                                            std::to_string(group.row_length) + " is allowed");
    }
    if (sparse && group.row_count != groups[0].row_count) {
      fail(ErrorCode::kInvalidArgument,
           name + " has " + std::to_string(group.row_count) +
               " rows; with flags of visibility it must have as many as group 0, " +
               std::to_string(groups[0].row_count));
    }
  }
}

AdamFactors factorsOf(const AdamGroup& group, uint64_t step, const AdamOptions& options) {
  const double exponent = static_cast<double>(step);
  AdamFactors factors;
  factors.first_share = static_cast<float>(1 - options.beta1);
  factors.second_share = static_cast<float>(1 - options.beta2);
  factors.rate = static_cast<float>(group.learning_rate / (1 - std::pow(options.beta1, exponent)));
  factors.inverse_root_second =
      static_cast<float>(1 / std::sqrt(1 - std::pow(options.beta2, exponent)));
  factors.epsilon = static_cast<float>(options.epsilon);
  return factors;
}

size_t strideOf(const AdamGroup& group) {
  return group.row_stride == 0 ? group.row_length : group.row_stride;
}

/// Rows of a piece: whole ones, at least one.
size_t rowsPerPiece(const AdamGroup& group) {
  return std::max<size_t>(1, kPiece / std::max<size_t>(1, group.row_length));
}

struct Step {
  const AdamKernel& kernel;
  std::span<const AdamGroup> groups;
  uint64_t number;
  const AdamOptions& options;
  const uint8_t* visible;
  std::atomic<bool> all_usable{true};

  void stepRows(const AdamGroup& group, const AdamFactors& factors, size_t begin, size_t end) {
    if (strideOf(group) == group.row_length) {
      stepElements(group, factors, begin * group.row_length, (end - begin) * group.row_length);
      return;
    }
    for (size_t row = begin; row < end; ++row) {
      stepElements(group, factors, row * group.row_stride, group.row_length);
    }
  }

  void stepElements(const AdamGroup& group, const AdamFactors& factors, size_t first,
                    size_t count) {
    if (!kernel.step(factors, count, group.parameters + first, group.gradients + first,
                     group.first_moments + first, group.second_moments + first)) {
      all_usable = false;
    }
  }

  /// In: piece: counted through the groups in order.
  void run(size_t piece) {
    const AdamGroup* group = groups.data();
    for (; piece >= rangeCount(group->row_count, rowsPerPiece(*group)); ++group) {
      piece -= rangeCount(group->row_count, rowsPerPiece(*group));
    }
    const AdamFactors factors = factorsOf(*group, number, options);
    const size_t begin = piece * rowsPerPiece(*group);
    const size_t end = std::min(group->row_count, begin + rowsPerPiece(*group));
    if (!visible) {
      stepRows(*group, factors, begin, end);
      return;
    }
    // Runs of visible rows, as long as they come.
    for (size_t row = begin; row < end;) {
      if (!visible[row]) {
        ++row;
        continue;
      }
      const size_t run_begin = row;
      while (row < end && visible[row]) ++row;
      stepRows(*group, factors, run_begin, row);
    }
  }
};

void failForGradient(std::span<const AdamGroup> groups, const uint8_t* visible) {
  for (size_t g = 0; g < groups.size(); ++g) {
    const AdamGroup& group = groups[g];
    for (size_t i = 0; i < group.row_count * group.row_length; ++i) {
      if (visible && !visible[i / group.row_length]) continue;
      const float value =
          group.gradients[i / group.row_length * strideOf(group) + i % group.row_length];
      if (std::isfinite(value) && std::abs(value) <= kLargestGradient) continue;
      fail(ErrorCode::kInvalidArgument,
           "gradient " + std::to_string(i % group.row_length) + " of row " +
               std::to_string(i / group.row_length) + " in group " + std::to_string(g) + " is " +
               std::to_string(value) + "; it must be within -1e18 and 1e18");
    }
  }
}

}  // namespace

void adamStep(std::span<const AdamGroup> groups, uint64_t step, const AdamOptions& options,
              const uint8_t* visible) {
  adamStepWith(chosenAdamKernel(), groups, step, options, visible);
}

void adamStepWith(const AdamKernel& kernel, std::span<const AdamGroup> groups, uint64_t step,
                  const AdamOptions& options, const uint8_t* visible) {
  validate(groups, step, options, visible != nullptr);
  size_t pieces = 0;
  for (const AdamGroup& group : groups) pieces += rangeCount(group.row_count, rowsPerPiece(group));
  Step work = {kernel, groups, step, options, visible};
  parallelFor(pieces, 1, [&work](size_t begin, size_t end) {
    for (size_t piece = begin; piece < end; ++piece) work.run(piece);
  });
  if (!work.all_usable) failForGradient(groups, visible);
}

}  // namespace stipple
