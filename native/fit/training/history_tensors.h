#pragma once

#include <vector>

#include "data/tensor_table.h"
#include "data/training_history.h"
#include "fit/training/collection.h"

namespace stipple {

/// Adds to a checkpoint what a training knows beside the state of its trainer: its history, which
/// objects it learns from, and its best weights.
void putHistory(const TrainingHistory& history, const Collection& collection,
                const std::vector<float>& best, double best_psnr, TensorTable& tensors);

/// The other way round. Out: records, measures and best_step of history; the rest stays.
/// Errors: kFormat for a table with parts missing; kInvalidArgument for one of other objects.
void takeHistory(const TensorTable& tensors, const Collection& collection, TrainingHistory& history,
                 std::vector<float>& best, double& best_psnr);

}  // namespace stipple
