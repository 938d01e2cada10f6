#pragma once

#include <cstddef>
#include <span>

#include "nn/positions.h"

namespace stipple {

/// Of rotateAdjacent(). In: table, rows, heads, head_width as it had them; rotated: what it made,
/// rotated_stride; gradient: the derivative by that, gradient_stride. Out: gradient, by what it was
/// given, in its place; by_angles [rows, pairs of the table], which this adds to.
void rotateAdjacentBackward(const RotaryTable& table, size_t rows, size_t heads, size_t head_width,
                            const float* rotated, size_t rotated_stride, float* gradient,
                            size_t gradient_stride, std::span<float> by_angles);

}  // namespace stipple
