#include "nn/training/narrow_product.h"

#include <algorithm>
#include <bit>
#include <cstdint>

#include "base/parallel.h"
#include "nn/kernels/layer_kernel.h"
#include "nn/matrix_backend.h"
#include "nn/scratch.h"

namespace stipple {

namespace {

constexpr FactorPrecision kNarrow = FactorPrecision::kBfloat16;
/// Columns of a panel, and rows of a task. Backends keep machine code for each size that they meet,
/// so rows that are left are taken in powers of two, of which there are few.
constexpr size_t kPanelColumns = 256;
constexpr size_t kTaskRows = 64;
/// Rows of a layer that a derivative by weights sums at a time, powers of two for the same reason:
/// the last ones are filled up with zeros.
constexpr size_t kMostSummed = 512, kLeastSummed = 64;
/// Sides of tiles that are turned around, and rows that are rounded, by a task.
constexpr size_t kTile = 32;
constexpr size_t kRoundedRows = 16;
constexpr size_t kGrain = 1 << 14;
/// Floats of a cache line, at which each panel begins.
constexpr size_t kLine = 16;

size_t roundedUp(size_t count, size_t unit) {
  return (count + unit - 1) / unit * unit;
}

/// A matrix of bfloat16 numbers whose rows lie without gaps.
class NarrowMatrix {
 public:
  NarrowMatrix(size_t rows, size_t columns) : columns_(columns), room_((rows * columns + 1) / 2) {}

  /// Rounds [rows, columns], and fills what follows up to `all` rows with zeros.
  NarrowMatrix(size_t rows, size_t columns, const float* from, size_t all)
      : NarrowMatrix(all, columns) {
    const LayerKernel& kernel = chosenLayerKernel();
    parallelFor(rows, kRoundedRows, [&](size_t begin, size_t end) {
      kernel.narrow((end - begin) * columns_, from + begin * columns_, row(begin));
    });
    std::fill_n(row(rows), (all - rows) * columns_, uint16_t{0});
  }

  uint16_t* row(size_t index) {
    return reinterpret_cast<uint16_t*>(room_.data()) + index * columns_;
  }
  const uint16_t* row(size_t index) const {
    return reinterpret_cast<const uint16_t*>(room_.data()) + index * columns_;
  }

 private:
  size_t columns_;
  Scratch room_;
};

/// to [columns, rows] = from [rows, columns] turned around.
void turn(size_t rows, size_t columns, const uint16_t* from, uint16_t* to) {
  parallelFor(columns, kTile, [&](size_t begin, size_t end) {
    for (size_t first = 0; first < rows; first += kTile) {
      const size_t last = std::min(rows, first + kTile);
      for (size_t column = begin; column < end; ++column) {
        for (size_t row = first; row < last; ++row) {
          to[column * rows + row] = from[row * columns + column];
        }
      }
    }
  });
}

struct NarrowShape {
  size_t rows = 0, inner = 0, columns = 0;
};

/// c [rows, columns] = a [rows, inner] b + 1 biasᵀ. In: pack(first, count, packed) brings columns
/// of b into the backend's form.
template <class Pack>
void multiplyPanels(const NarrowShape& shape, const uint16_t* a, const Pack& pack,
                    const float* bias, float* c) {
  const MatrixBackend& backend = defaultMatrixBackend();
  const size_t panels = rangeCount(shape.columns, kPanelColumns);
  const size_t tasks = rangeCount(shape.rows, kTaskRows);
  const size_t room = roundedUp(
      backend.packedSize(shape.inner, std::min(kPanelColumns, shape.columns), kNarrow), kLine);
  const auto columnsOf = [&](size_t panel) {
    return std::min(kPanelColumns, shape.columns - panel * kPanelColumns);
  };
  Scratch packed(room * panels);
  parallelFor(panels, 1, [&](size_t panel, size_t) {
    pack(panel * kPanelColumns, columnsOf(panel), packed.data() + panel * room);
  });
  parallelFor(panels * tasks, 1, [&](size_t begin, size_t) {
    const size_t panel = begin / tasks, first_column = panel * kPanelColumns;
    size_t row = begin % tasks * kTaskRows;
    const size_t last = std::min(shape.rows, row + kTaskRows);
    while (row < last) {
      LinearPanel product;
      product.rows = std::bit_floor(last - row);
      product.inputs = product.in_stride = shape.inner;
      product.outputs = columnsOf(panel);
      product.narrow_in = a + row * shape.inner;
      product.bias = bias == nullptr ? nullptr : bias + first_column;
      product.out = c + row * shape.columns + first_column;
      product.out_stride = shape.columns;
      backend.multiply(product, packed.data() + panel * room, kNarrow);
      row += product.rows;
    }
  });
}

/// weight_gradient += out_gradientᵀ in, where both have zeros below their rows.
void addWeightGradient(const NarrowLayer& layer, size_t rows, const NarrowMatrix& in,
                       const NarrowMatrix& out_gradient, float* weight_gradient) {
  const MatrixBackend& backend = defaultMatrixBackend();
  const size_t count = layer.inputs * layer.outputs;
  Scratch made(count);
  for (size_t first = 0; first < rows;) {
    const size_t summed = std::min(kMostSummed, std::bit_floor(rows - first));
    NarrowMatrix turned(layer.outputs, summed);
    turn(summed, layer.outputs, out_gradient.row(first), turned.row(0));
    multiplyPanels(
        {layer.outputs, summed, layer.inputs}, turned.row(0),
        [&](size_t column, size_t columns, float* packed) {
          backend.packTurned(in.row(first) + column, layer.inputs, summed, columns, packed);
        },
        nullptr, made.data());
    parallelFor(count, kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) weight_gradient[i] += made.data()[i];
    });
    first += summed;
  }
}

}  // namespace

void applyNarrow(const NarrowLayer& layer, const float* in, const float* weight, const float* bias,
                 float* out) {
  const MatrixBackend& backend = defaultMatrixBackend();
  const WeightTensor tensor = {WeightType::kFloat32,
                               "F32",
                               {layer.outputs, layer.inputs},
                               reinterpret_cast<const uint8_t*>(weight)};
  const NarrowMatrix rows(layer.rows, layer.inputs, in, layer.rows);
  multiplyPanels(
      {layer.rows, layer.inputs, layer.outputs}, rows.row(0),
      [&](size_t first, size_t count, float* packed) {
        backend.pack(tensor, layer.inputs, first, count, kNarrow, packed);
      },
      bias, out);
}

void backwardNarrow(const NarrowLayer& layer, const float* in, const float* weight,
                    const float* out_gradient, float* weight_gradient, float* in_gradient) {
  const MatrixBackend& backend = defaultMatrixBackend();
  const size_t all = roundedUp(layer.rows, kLeastSummed);
  const NarrowMatrix by_out(layer.rows, layer.outputs, out_gradient, all);
  const NarrowMatrix rows(layer.rows, layer.inputs, in, all);
  addWeightGradient(layer, all, rows, by_out, weight_gradient);
  if (in_gradient == nullptr) return;
  const NarrowMatrix weights(layer.outputs, layer.inputs, weight, layer.outputs);
  multiplyPanels(
      {layer.rows, layer.outputs, layer.inputs}, by_out.row(0),
      [&](size_t first, size_t count, float* packed) {
        backend.packTurned(weights.row(0) + first, layer.inputs, layer.outputs, count, packed);
      },
      nullptr, in_gradient);
}

}  // namespace stipple
