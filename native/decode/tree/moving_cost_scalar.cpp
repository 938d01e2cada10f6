#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

#include "decode/tree/moving_cost.h"

namespace stipple {

namespace {

#include "decode/tree/merge_numbers-inl.h"
#include "decode/tree/merge_steps-inl.h"
#include "decode/tree/moving_steps-inl.h"

}  // namespace

MovingMergeKernel scalarMovingMergeKernel() {
  return {"scalar", costsOverTime<double>, mergeRowsOverTime<double>};
}

}  // namespace stipple
