#include "train/networks/trainer_tensors.h"

#include <algorithm>
#include <utility>

namespace stipple {

void putWeights(const std::string& prefix, const std::vector<float>& values,
                const WeightOptimiser::State& state, TensorTable& table) {
  putValues(prefix + "weights", values, table);
  putValues(prefix + "optimiser.first", state.first, table);
  putValues(prefix + "optimiser.second", state.second, table);
  putValues(prefix + "optimiser.mean", state.mean, table);
  putValues(prefix + "optimiser.norms", state.norms, table);
  putValues(prefix + "optimiser.most_norm", std::vector<double>{state.most_norm}, table);
  putValues(prefix + "optimiser.loss_scale", std::vector<double>{state.loss_scale_log2}, table);
}

WeightOptimiser::State takeWeights(const TensorTable& table, const std::string& prefix,
                                   size_t count, const WeightOptimiserOptions& options,
                                   std::vector<float>& values) {
  WeightOptimiser::State state;
  state.first = takeValues<float>(table, prefix + "optimiser.first", count, count);
  state.second = takeValues<float>(table, prefix + "optimiser.second", count, count);
  state.mean = takeValues<double>(table, prefix + "optimiser.mean", count, count);
  state.norms = takeValues<float>(table, prefix + "optimiser.norms", 0, options.clip_buffer);
  state.most_norm = takeValues<double>(table, prefix + "optimiser.most_norm", 1, 1).front();
  // Checkpoints from before there were scales have none.
  if (options.loss_scaling == LossScaling::kDynamic) {
    state.loss_scale_log2 =
        takeValues<double>(table, prefix + "optimiser.loss_scale", 1, 1).front();
  }
  values = takeValues<float>(table, prefix + "weights", count, count);
  return state;
}

TensorTable trainerState(const std::string& prefix, const std::vector<float>& values,
                         const WeightOptimiser::State& optimiser, uint64_t taken) {
  TensorTable table;
  putWeights(prefix, values, optimiser, table);
  putValues(prefix + "counts", std::vector<uint64_t>{optimiser.steps, optimiser.skipped, taken},
            table);
  return table;
}

TrainerState takeTrainerState(const TensorTable& table, const std::string& prefix, size_t count,
                              const WeightOptimiserOptions& options) {
  const std::vector<uint64_t> counts = takeValues<uint64_t>(table, prefix + "counts", 3, 3);
  TrainerState state;
  state.optimiser = takeWeights(table, prefix, count, options, state.values);
  state.optimiser.steps = counts[0];
  state.optimiser.skipped = counts[1];
  state.taken = counts[2];
  return state;
}

size_t objectInRounds(uint64_t seed, uint64_t position, size_t count) {
  const uint64_t round = position / count;
  std::vector<std::pair<uint64_t, size_t>> order;
  for (size_t i = 0; i < count; ++i) {
    order.emplace_back(keyedBits(seed + round, RandomUse::kViewOrder, i), i);
  }
  const auto at = order.begin() + static_cast<ptrdiff_t>(position % count);
  std::nth_element(order.begin(), at, order.end());
  return at->second;
}

}  // namespace stipple
