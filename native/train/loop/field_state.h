#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "data/tensor_table.h"
#include "decode/field/field_parameters.h"
#include "density/learned_density.h"

namespace stipple {

/// Both moments of Adam for one array.
struct Moments {
  std::vector<float> first;
  std::vector<float> second;
};

/// All that a fit of a field moves: density, field, their moments and what a window of steps has
/// counted.
struct FieldState {
  LearnedDensity density;
  std::shared_ptr<FieldParameters> field;
  std::vector<Moments> logits;    ///< per level
  std::vector<Moments> features;  ///< per level
  std::vector<Moments> details;   ///< per level
  std::vector<Moments> weights;   ///< per layer of the network
  std::vector<Moments> biases;
  uint64_t density_steps = 0;
  uint64_t field_steps = 0;
  LearnedDensity::DrawCounts draws;
};

/// Moments of 0.
FieldState startState(LearnedDensity density, FieldParameters field);

/// Moments follow the cells of LearnedDensity::activate.
void insertMoments(FieldState& state, const std::vector<std::vector<uint32_t>>& rows);

/// As named tensors: "octree.*", "field.*", "adam.*".
TensorTable tensorsOf(const FieldState& state);
/// The other way round. In: like: a state of the same shape. Errors: kFormat for tensors that are
/// missing, of another shape, or not finite.
FieldState stateOf(const TensorTable& table, const FieldState& like);

}  // namespace stipple
