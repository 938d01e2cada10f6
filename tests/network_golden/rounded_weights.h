#pragma once

#include "data/weight_table.h"

namespace stipple {

/// A table with the same names whose numbers are rounded to the nearest of 16 bits, ties to even,
/// and lie in memory as float32. Tensors that are not of floating point are left alone.
/// In: type: kFloat16 or kBfloat16.
WeightTable roundedWeights(const WeightTable& weights, WeightType type);

}  // namespace stipple
