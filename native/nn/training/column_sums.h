#pragma once

#include <cstddef>
#include <vector>

#include "base/parallel.h"

namespace stipple {

/// sums[i] += the sum over rows of what visit(row, part) adds to part[i], in double. In: width
/// sums. Threads and determinism: blocks of rows in parallel, added up in their order: same bits
/// for any number of threads.
template <class Visit>
void addColumnSums(size_t rows, size_t width, const Visit& visit, float* sums) {
  constexpr size_t kBlock = 64;
  const size_t blocks = rangeCount(rows, kBlock);
  std::vector<double> parts(blocks * width, 0.0);
  parallelFor(rows, kBlock, [&](size_t begin, size_t end) {
    double* part = parts.data() + begin / kBlock * width;
    for (size_t row = begin; row < end; ++row) visit(row, part);
  });
  for (size_t i = 0; i < width; ++i) {
    double sum = 0;
    for (size_t block = 0; block < blocks; ++block) sum += parts[block * width + i];
    sums[i] += static_cast<float>(sum);
  }
}

}  // namespace stipple
