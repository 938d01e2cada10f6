#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "data/tensor_table.h"
#include "decode/anchors/scaffold.h"
#include "densify/anchors/anchor_growth.h"
#include "train/loop/field_state.h"

namespace stipple {

/// All that a fit of a scaffold moves: its arrays, their moments and what a window of steps has
/// told.
struct ScaffoldState {
  std::shared_ptr<ScaffoldParameters> scaffold;
  /// In the order of forEachScaffoldArray(); none of the first, positions, which do not learn.
  std::vector<Moments> moments;
  AnchorStatistics statistics;
  std::vector<uint8_t> levels;  ///< [A] 0, 1 or 2: how varied features are; empty: nobody asked
  uint64_t steps = 0;

  /// Moments and statistics of 0 for anchors that were added at the end.
  void follow();
  /// Keeps these anchors, in this order.
  void keep(const std::vector<uint32_t>& rows);
};

/// What a scaffold with the same networks is made by.
ScaffoldShape shapeOf(const ScaffoldParameters& scaffold);

/// Moments of 0.
ScaffoldState startState(ScaffoldParameters scaffold);

/// As named tensors: "scaffold.*", "adam.*", "window.*".
TensorTable tensorsOf(const ScaffoldState& state);
/// The other way round. In: like: a state of the same networks. Errors: kFormat.
ScaffoldState scaffoldStateOf(const TensorTable& table, const ScaffoldState& like);

}  // namespace stipple
