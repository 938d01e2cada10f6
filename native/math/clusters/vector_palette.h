#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/progress.h"

namespace stipple {

/// Few vectors that stand for many.
struct VectorPalette {
  size_t count = 0;
  std::vector<float> vectors;    ///< [count, width]
  std::vector<uint16_t> labels;  ///< [n] which of them stands for each of the data
};

struct PaletteOptions {
  size_t max_count = 65536;  ///< at most 65,536
  int rounds = 4;  ///< of k-means inside the cells; a round takes O(n sqrt(max_count) width)
  uint64_t seed = 1;
};

/// A palette of small squared error for vectors [n, width]: k-means in two levels, then moving
/// between cells. As many different vectors as max_count or fewer are kept exactly.
/// Errors: kCancelled. Determinism: the same for any number of threads.
/// Cost: O(n sqrt(max_count) width rounds); memory about 48 bytes per vector besides the result.
VectorPalette makeVectorPalette(const float* vectors, size_t n, size_t width,
                                const PaletteOptions& options, Progress* progress);

}  // namespace stipple
