#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "train/optimiser/adam.h"

namespace stipple {

/// Rows of a large table that take a step; all others stay as they are, moments too.
struct SparseRows {
  std::span<const uint32_t> rows;
  size_t row_length = 0;
  float* parameters = nullptr;  ///< the table, as are the next three
  float* first_moments = nullptr;
  float* second_moments = nullptr;
  const float* gradients = nullptr;
  double learning_rate = 0;
};

/// Memory that the next step uses again.
struct SparseAdamScratch {
  std::vector<float> parameters, gradients, first_moments, second_moments;
};

/// adamStep for the rows alone. Cost: O(rows), whatever the size of the tables. No row twice.
void sparseAdamStep(std::span<const SparseRows> tables, uint64_t step, const AdamOptions& options,
                    SparseAdamScratch& scratch);

}  // namespace stipple
