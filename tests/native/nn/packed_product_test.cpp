#include "nn/training/packed_product.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/parallel.h"
#include "nn/kernels/panel_kernel.h"
#include "test_numbers.h"

namespace stipple {
namespace {

// Below and above a task of rows, and columns that fill no strip.
const MatmulShape kShapes[] = {{1, 1, 1}, {48, 7, 32}, {49, 300, 33}, {100, 5, 70}, {3, 0, 4}};

/// A matrix that lies in rows, and the same in columns.
struct Both {
  Both(size_t rows, size_t columns, uint64_t seed)
      : in_rows(numbers(rows * columns, seed)), in_columns(rows * columns) {
    for (size_t row = 0; row < rows; ++row) {
      for (size_t column = 0; column < columns; ++column) {
        in_columns[column * rows + row] = in_rows[row * columns + column];
      }
    }
    views[0] = {in_rows.data(), columns};
    views[1] = {in_columns.data(), 1, rows};
  }
  std::vector<float> in_rows, in_columns;
  MatrixView views[2];
};

TEST(PackedProduct, MultipliesWhateverWayMatricesLie) {
  for (const MatmulShape& shape : kShapes) {
    const Both a(shape.rows, shape.inner, 1), b(shape.inner, shape.columns, 2);
    const std::vector<float> bias = numbers(shape.columns, 3);
    std::vector<float> first;
    for (const MatrixView& of_a : a.views) {
      for (const MatrixView& of_b : b.views) {
        std::vector<float> c(shape.rows * shape.columns);
        multiplyPacked(shape, of_a, of_b, {c.data(), shape.columns}, bias.data());
        for (size_t i = 0; i < c.size(); ++i) {
          const size_t row = i / shape.columns, column = i % shape.columns;
          double expected = static_cast<double>(bias[column]);
          for (size_t k = 0; k < shape.inner; ++k) {
            expected += static_cast<double>(a.in_rows[row * shape.inner + k]) *
                        static_cast<double>(b.in_rows[k * shape.columns + column]);
          }
          // 300 sums of up to 10 or so, each rounded by half of 1e-6 and rarely to one side.
          ASSERT_NEAR(static_cast<double>(c[i]), expected, 3e-5) << i;
        }
        if (first.empty()) first = c;
        EXPECT_EQ(c, first) << "the same sums, in the same order";
      }
    }
    std::vector<float> alone(shape.rows * shape.columns);
    withThreads(1, [&] {
      multiplyPacked(shape, a.views[0], b.views[0], {alone.data(), shape.columns}, bias.data());
    });
    EXPECT_EQ(alone, first);
  }
}

TEST(PackedProduct, AddsToWhatIsThere) {
  for (const MatmulShape& shape : kShapes) {
    const Both a(shape.rows, shape.inner, 1), b(shape.inner, shape.columns, 2);
    const size_t stride = shape.columns + 3;
    const std::vector<float> before = numbers(shape.rows * stride, 4);
    std::vector<float> added = before, product(shape.rows * shape.columns);
    addPacked(shape, a.views[1], b.views[0], {added.data(), stride});
    multiplyPacked(shape, a.views[1], b.views[0], {product.data(), shape.columns});
    for (size_t i = 0; i < added.size(); ++i) {
      const size_t row = i / stride, column = i % stride;
      if (column >= shape.columns) {
        ASSERT_EQ(added[i], before[i]) << "what is beside it stays";
        continue;
      }
      const float more = product[row * shape.columns + column];
      // Twice as many sums as above, those of either order.
      ASSERT_NEAR(static_cast<double>(added[i]),
                  static_cast<double>(before[i]) + static_cast<double>(more), 6e-5);
    }
    std::vector<float> alone = before;
    withThreads(1, [&] { addPacked(shape, a.views[0], b.views[1], {alone.data(), stride}); });
    EXPECT_EQ(alone, added);
  }
}

TEST(PackedProduct, EveryKernelReadsTurnedMatrices) {
  const Both a(29, 17, 1);
  const std::vector<float> b = numbers(17 * 40, 2);
  for (const PanelKernel& kernel : panelKernels()) {
    std::vector<float> strips(stripFloats(kernel.strip, 17, 40));
    packRows(kernel.strip, 17, 40, b.data(), 40, strips.data());
    PanelProduct product;
    product.shape = {29, 17, 40};
    product.b = strips.data();
    std::vector<float> rows(29 * 40), columns(29 * 40);
    product.c_stride = 40;
    product.a = a.in_rows.data();
    product.a_stride = 17;
    product.c = rows.data();
    kernel.multiply(product);
    product.a = a.in_columns.data();
    product.a_stride = 29;
    product.is_turned = true;
    product.c = columns.data();
    kernel.multiply(product);
    EXPECT_EQ(rows, columns) << kernel.target;
  }
}

}  // namespace
}  // namespace stipple
