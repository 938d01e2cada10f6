#pragma once

#include <cstddef>
#include <vector>

#include "nn/matmul.h"

namespace stipple {

/// A matrix b [inner, columns] in strips of `PanelKernel::strip` columns: element (k, c) at
/// values[(c / strip * inner + k) * strip + c % strip], the last strip filled up with zeros.
inline size_t stripFloats(size_t strip, size_t inner, size_t columns) {
  return (columns + strip - 1) / strip * strip * inner;
}

/// What the sums of a product begin with.
enum class PanelStart { kBias, kSums };

struct PanelProduct {
  MatmulShape shape;
  const float* a = nullptr;  ///< [rows, inner]
  size_t a_stride = 0;
  bool is_turned = false;    ///< element (row, k) of a is at a[k * a_stride + row] instead
  const float* b = nullptr;  ///< [inner, columns] in strips
  PanelStart start = PanelStart::kBias;
  const float* bias = nullptr;  ///< [columns], or null for zeros
  float* c = nullptr;           ///< [rows, columns], written; kSums: added to
  size_t c_stride = 0;
};

/// Products with a matrix that lies in strips, so that it is read in order and only once for each
/// block of rows. Each element is one sum in the order of the inner index, whatever the block.
struct PanelKernel {
  const char* target;  ///< "scalar", or Highway's name of an instruction set
  size_t strip;        ///< columns of a strip
  /// On this thread.
  void (*multiply)(const PanelProduct& product);
};

/// The kernel to use: the best for this processor, or what STIPPLE_FORCE_TARGET names.
const PanelKernel& chosenPanelKernel();
/// Every kernel that is compiled and runs on this processor (base/kernel_choice.h).
std::vector<PanelKernel> panelKernels();
PanelKernel scalarPanelKernel();

/// Strips of b, where element (k, c) is at from[c * stride + k]: rows of a weight, or keys.
void packColumns(size_t strip, size_t inner, size_t columns, const float* from, size_t stride,
                 float* strips);
/// Strips of b, where element (k, c) is at from[k * stride + c]: values of an attention.
void packRows(size_t strip, size_t inner, size_t columns, const float* from, size_t stride,
              float* strips);

}  // namespace stipple
