#include "nn/matmul.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/parallel.h"
#include "base/random.h"
#include "nn/kernels/matrix_kernel.h"

namespace stipple {
namespace {

std::vector<float> numbers(size_t count, uint64_t seed) {
  std::vector<float> out(count);
  for (size_t i = 0; i < count; ++i) {
    out[i] = 2.0f * unitFloat(keyedBits(seed, RandomUse::kNetworkStart, i)) - 1.0f;
  }
  return out;
}

struct Case {
  MatmulShape shape;
  bool transposed;
  bool with_bias;
};

// Rows and columns on both sides of the kernels' blocks (6 rows, one and two vectors), and empty.
const Case kCases[] = {{{1, 1, 1}, false, true},       {{5, 7, 3}, false, false},
                       {{6, 53, 64}, false, true},     {{13, 64, 120}, false, true},
                       {{64, 2300, 128}, true, false}, {{40, 9, 33}, true, true},
                       {{7, 0, 17}, false, true},      {{0, 5, 5}, false, false}};

TEST(Matmul, EveryKernelAgreesWithSumsInDouble) {
  for (const MatrixKernel& kernel : matrixKernels()) {
    for (const Case& c : kCases) {
      const auto [rows, inner, columns] = c.shape;
      const std::vector<float> a = numbers(rows * inner, 1);
      const std::vector<float> b = numbers(inner * columns, 2);
      const std::vector<float> bias = numbers(columns, 3);
      std::vector<float> out(rows * columns, 99.0f);
      const MatrixView view =
          c.transposed ? MatrixView{a.data(), 1, rows} : MatrixView{a.data(), inner, 1};
      multiplyWith(kernel, c.shape, view, {b.data(), columns}, {out.data(), columns},
                   c.with_bias ? bias.data() : nullptr);
      for (size_t i = 0; i < rows; ++i) {
        for (size_t j = 0; j < columns; ++j) {
          double expected = c.with_bias ? static_cast<double>(bias[j]) : 0.0;
          double size = std::abs(expected);
          for (size_t k = 0; k < inner; ++k) {
            const double term =
                static_cast<double>(view.values[i * view.row_stride + k * view.column_stride]) *
                static_cast<double>(b[k * columns + j]);
            expected += term;
            size += std::abs(term);
          }
          // A sum of n float32 terms is off by at most n rounding errors of its terms' sizes; they
          // cancel to about the root of that.
          const double tolerance = 6e-8 * size * (2 + std::sqrt(static_cast<double>(inner)));
          ASSERT_NEAR(static_cast<double>(out[i * columns + j]), expected, tolerance)
              << kernel.target << " " << rows << "x" << inner << "x" << columns;
        }
      }
    }
  }
}

TEST(Matmul, HasTheSameBitsForAnyNumberOfThreads) {
  const MatmulShape shape = {101, 700, 120};
  const std::vector<float> a = numbers(shape.rows * shape.inner, 4);
  const std::vector<float> b = numbers(shape.inner * shape.columns, 5);
  std::vector<float> first;
  for (const unsigned threads : {1u, 2u, 5u}) {
    std::vector<float> out(shape.rows * shape.columns);
    withThreads(threads, [&] {
      multiply(shape, {a.data(), shape.inner}, {b.data(), shape.columns},
               {out.data(), shape.columns});
    });
    if (first.empty()) first = out;
    EXPECT_EQ(out, first) << threads;
  }
}

TEST(Silu, EveryKernelAgreesWithDouble) {
  std::vector<float> z = {0.0f, 1.0f, -1.0f, 20.0f, -20.0f, 100.0f, -100.0f, 1e30f, -1e30f};
  for (const float value : numbers(50, 6)) z.push_back(8.0f * value);
  for (const MatrixKernel& kernel : matrixKernels()) {
    std::vector<float> out(z.size());
    std::vector<float> gradient(z.size(), 1.0f);
    kernel.silu(z.size(), z.data(), out.data());
    kernel.siluBackward(z.size(), z.data(), gradient.data());
    for (size_t i = 0; i < z.size(); ++i) {
      const double x = static_cast<double>(z[i]);
      const double s = 1.0 / (1.0 + std::exp(-x));
      // Exponentials are held at exp(80): what is left of -1e30 is below 1e-4 of float32's range.
      const double value = std::abs(x) > 80 ? (x > 0 ? x : 0.0) : x * s;
      const double slope = std::abs(x) > 80 ? (x > 0 ? 1.0 : 0.0) : s * (1 + x * (1 - s));
      EXPECT_NEAR(static_cast<double>(out[i]), value, 3e-7 * std::abs(x) + 1e-30) << kernel.target;
      EXPECT_NEAR(static_cast<double>(gradient[i]), slope, 1e-6 * (1 + std::abs(x)))
          << kernel.target << " at " << x;
    }
  }
}

}  // namespace
}  // namespace stipple
