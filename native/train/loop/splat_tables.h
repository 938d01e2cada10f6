#pragma once

#include <string>

#include "data/tensor_table.h"
#include "train/backend/render_backend.h"

// What a checkpoint keeps of explicit splats, as named tensors.

namespace stipple {

/// "raw.positions" and so on, "adam.first.*", "adam.second.*", "adam.step", and "kept.*" where
/// there are kept gradients. Arrays: positions, rotations, log_scales, logits, sh, extra0...
void putTrainingState(const TrainingState& state, TensorTable& table);

/// The other way round. In: like: splats of the same kind (degree, extras), any number.
/// Errors: kFormat for tensors that are missing or of another shape, and numbers that are not
/// finite.
TrainingState takeTrainingState(const TensorTable& table, const RawSplats& like);

void putText(const std::string& text, const std::string& name, TensorTable& table);
/// Errors: kFormat where it is missing.
std::string takeText(const TensorTable& table, const std::string& name);

/// Tensors whose names begin with `prefix`, without it.
TensorTable takePart(const TensorTable& table, const std::string& prefix);

}  // namespace stipple
