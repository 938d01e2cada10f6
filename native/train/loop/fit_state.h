#pragma once

#include <cstdint>
#include <optional>

#include "data/fit_history.h"
#include "data/tensor_table.h"

namespace stipple {

/// What a trainer adds to the tensors of its model in a checkpoint: "iteration", "history.*", and
/// the state of the model that has done best as "best.*".
void addFitState(TensorTable& table, uint64_t iteration, const FitHistory& history);
void addBest(TensorTable& table, const TensorTable& best);

/// The other way round. Out: records, measures and best iteration of the history; returns the
/// iteration. Errors: kFormat for tensors that are missing or of another shape.
uint64_t takeFitState(const TensorTable& table, FitHistory& history);
std::optional<TensorTable> takeBest(const TensorTable& table);
/// The tensors of the model alone.
TensorTable modelState(const TensorTable& table);

}  // namespace stipple
