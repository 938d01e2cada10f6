#pragma once

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/random.h"
#include "data/tensor_table.h"
#include "train/optimiser/weight_optimiser.h"

// What checkpoints of trainers have in common.

namespace stipple {

template <class T>
void putValues(const std::string& name, const std::vector<T>& values, TensorTable& table) {
  table[name] = {{values.size()}, values};
}

/// Errors: kFormat for a tensor that is missing, of a size that is not between both, or not finite.
template <class T>
std::vector<T> takeValues(const TensorTable& table, const std::string& name, size_t least,
                          size_t most) {
  const auto found = table.find(name);
  const auto* values =
      found == table.end() ? nullptr : std::get_if<std::vector<T>>(&found->second.values);
  if (values == nullptr) fail(ErrorCode::kFormat, "the checkpoint has no tensor '" + name + "'");
  if (values->size() < least || values->size() > most) {
    fail(ErrorCode::kFormat, "the checkpoint's tensor '" + name + "' has " +
                                 std::to_string(values->size()) + " numbers; " +
                                 std::to_string(least) + " to " + std::to_string(most) +
                                 " are needed: it is of a training with other settings");
  }
  for (const T& value : *values) {
    if (std::isfinite(static_cast<double>(value))) continue;
    fail(ErrorCode::kFormat,
         "the checkpoint's tensor '" + name + "' has a number that is not finite");
  }
  return *values;
}

/// Weights and the state of their optimiser, "weights" and "optimiser." behind a prefix.
void putWeights(const std::string& prefix, const std::vector<float>& values,
                const WeightOptimiser::State& state, TensorTable& table);
/// The other way round. In: count of weights; options of the optimiser. Out: values. Errors:
/// kFormat. The counts of steps are not among it.
WeightOptimiser::State takeWeights(const TensorTable& table, const std::string& prefix,
                                   size_t count, const WeightOptimiserOptions& options,
                                   std::vector<float>& values);

/// A trainer of one part: its weights, its optimiser, and the steps that it has taken.
struct TrainerState {
  std::vector<float> values;
  WeightOptimiser::State optimiser;
  uint64_t taken = 0;  ///< skipped ones among them
};
/// Its tensors behind a prefix ("flow.").
TensorTable trainerState(const std::string& prefix, const std::vector<float>& values,
                         const WeightOptimiser::State& optimiser, uint64_t taken);
/// The other way round. In: count of weights; options of the optimiser. Errors: kFormat.
TrainerState takeTrainerState(const TensorTable& table, const std::string& prefix, size_t count,
                              const WeightOptimiserOptions& options);

/// Which of `count` objects comes at a position, where all are seen once before any is seen again:
/// each round over them has an order of its own.
size_t objectInRounds(uint64_t seed, uint64_t position, size_t count);

}  // namespace stipple
