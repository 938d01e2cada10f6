#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "nn/network_run.h"

namespace stipple {

/// What all heads of an attention look at: rows of a few numbers, of which each head has keys and
/// values by a linear map of its own.
struct SharedRows {
  SharedRows() = default;
  /// In: values [count, width].
  SharedRows(size_t count, size_t width, const float* values);
  static uint64_t bytes(uint64_t count, uint64_t width);

  size_t count = 0;
  size_t width = 0;
  std::vector<float> rows;     ///< [count, width + 1], the last of each 1
  std::vector<float> columns;  ///< [width, count]
};

/// Key j of head h is rates[h, j] times key_map_h (row j, 1); its value is value_map_h (row j, 1).
struct SharedHeads {
  size_t count = 0;
  size_t width = 0;                   ///< of queries and of results
  std::span<const float> key_maps;    ///< [count, row width + 1, width], transposed
  std::span<const float> value_maps;  ///< [count, width, row width + 1]
  std::span<const float> rates;       ///< [count, rows]
};

/// Per head, softmax(q kᵀ) v with these keys and values, none of which is ever made: a query goes
/// through the map of the keys once and then meets rows, and what it gathers of rows goes through
/// the map of the values. That is width / (row width) times less work, and memory of the rows
/// alone. In: q [queries, heads.count * heads.width], `stride` floats from row to row; heads side
/// by side. Out: out likewise; it may be q itself. Errors: kInvalidArgument for no rows;
/// kCancelled. Numbers: float32, whatever the run's precision, by our own kernels. Threads and
/// determinism: parallel over heads and queries; same bits for any number of threads, and for a
/// query whatever queries are beside it. Cost: O(queries * heads * rows * row width).
void sharedAttention(const NetworkRun& run, const SharedHeads& heads, const SharedRows& rows,
                     size_t queries, const float* q, size_t stride, float* out);

}  // namespace stipple
