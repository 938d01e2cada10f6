#include "nn/shared_attention.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "base/parallel.h"
#include "base/progress.h"
#include "io/scratch_folder.h"
#include "nn/kernels/layer_kernel.h"
#include "test_numbers.h"

namespace stipple {
namespace {

struct Case {
  size_t heads, width, rows, row_width, queries;
};

// On both sides of a tile of rows (128) and of strips of queries (8 to 32); widths that are no
// multiple of anything; rows wider than heads; none asked.
const Case kCases[] = {{1, 1, 1, 1, 1},     {2, 64, 127, 16, 33}, {3, 24, 128, 16, 31},
                       {2, 5, 129, 7, 9},   {1, 16, 300, 3, 65},  {2, 8, 40, 20, 8},
                       {4, 64, 513, 16, 1}, {2, 8, 5, 4, 0}};

/// Maps, rates, rows and queries. In: size: of scores.
struct Inputs {
  Inputs(const Case& c, float size)
      : key_maps(numbers(c.heads * (c.row_width + 1) * c.width, 1)),
        value_maps(numbers(c.heads * c.width * (c.row_width + 1), 2)),
        rates(numbers(c.heads * c.rows, 3)),
        values(numbers(c.rows * c.row_width, 4)),
        rows(c.rows, c.row_width, values.data()),
        stride(c.heads * c.width + 5),
        queries(numbers(c.queries * stride, 5)) {
    for (float& rate : rates) rate = size * (1.1f + rate);
    heads = {c.heads, c.width, key_maps, value_maps, rates};
  }
  std::vector<float> key_maps, value_maps, rates, values;
  SharedRows rows;
  size_t stride;
  std::vector<float> queries;
  SharedHeads heads;
};

/// With keys and values of every row and head, in double. `size`: of what the sums are of.
double byHand(const Case& c, const Inputs& in, size_t query, size_t head, size_t output,
              double& steepness) {
  const size_t mapped = c.row_width + 1;
  std::vector<double> powers(c.rows), results(c.rows);
  double peak = -1e300, sum = 0, result = 0;
  for (size_t row = 0; row < c.rows; ++row) {
    double score = 0, terms = 0;
    for (size_t k = 0; k < mapped; ++k) {
      const double number =
          k < c.row_width ? static_cast<double>(in.values[row * c.row_width + k]) : 1.0;
      for (size_t i = 0; i < c.width; ++i) {
        const double term =
            number * static_cast<double>(in.queries[query * in.stride + head * c.width + i]) *
            static_cast<double>(in.key_maps[(head * mapped + k) * c.width + i]);
        score += term;
        terms += std::abs(term);
      }
      results[row] +=
          number * static_cast<double>(in.value_maps[(head * c.width + output) * mapped + k]);
    }
    const auto rate = static_cast<double>(in.rates[head * c.rows + row]);
    powers[row] = rate * score;
    steepness = std::max(steepness, rate * terms);
    peak = std::max(peak, powers[row]);
  }
  for (size_t row = 0; row < c.rows; ++row) {
    const double power = std::exp(powers[row] - peak);
    sum += power;
    result += power * results[row];
  }
  return result / sum;
}

std::vector<float> attended(const Case& c, const Inputs& in, size_t first, size_t queries) {
  std::vector<float> out(queries * in.stride, 99.0f);
  sharedAttention({}, in.heads, in.rows, queries, in.queries.data() + first * in.stride, in.stride,
                  out.data());
  for (size_t query = 0; query < queries; ++query) {
    for (size_t i = c.heads * c.width; i < in.stride; ++i) {
      EXPECT_EQ(out[query * in.stride + i], 99.0f) << "a gap was written to";
    }
  }
  return out;
}

TEST(SharedAttention, AgreesWithKeysAndValuesInDouble) {
  for (const Case& c : kCases) {
    // Weights nearly even, and nearly one winner.
    for (const float size : {0.05f, 3.0f}) {
      const Inputs in(c, size);
      const std::vector<float> out = attended(c, in, 0, c.queries);
      for (size_t query = 0; query < c.queries; ++query) {
        for (size_t head = 0; head < c.heads; ++head) {
          for (size_t i = 0; i < c.width; ++i) {
            double steepness = 0;
            const double expected = byHand(c, in, query, head, i, steepness);
            // A score of such terms is off by their rounding, which weights follow; results are
            // sums of row_width + 1 numbers below 1.
            const double tolerance =
                4e-7 * (2 + steepness) * (static_cast<double>(c.row_width) + 1);
            ASSERT_NEAR(static_cast<double>(out[query * in.stride + head * c.width + i]), expected,
                        tolerance)
                << c.rows << " rows, " << c.queries << " queries, size " << size;
          }
        }
      }
    }
  }
}

TEST(SharedAttention, AnswersAQueryWhateverIsAskedBesideIt) {
  const Case c = {2, 24, 300, 16, 70};
  const Inputs in(c, 1.0f);
  const std::vector<float> together = attended(c, in, 0, c.queries);
  for (const size_t query : {0, 1, 31, 32, 69}) {
    const std::vector<float> alone = attended(c, in, query, 1);
    for (size_t i = 0; i < c.heads * c.width; ++i) {
      EXPECT_EQ(alone[i], together[query * in.stride + i]) << query;
    }
  }
}

TEST(SharedAttention, HasTheSameBitsForAnyNumberOfThreadsAndInPlace) {
  const Case c = {3, 24, 300, 16, 70};
  const Inputs in(c, 1.0f);
  const std::vector<float> first = attended(c, in, 0, c.queries);
  for (const unsigned threads : {1u, 2u, 5u}) {
    std::vector<float> out = in.queries;
    withThreads(threads, [&] {
      sharedAttention({}, in.heads, in.rows, c.queries, out.data(), in.stride, out.data());
    });
    for (size_t query = 0; query < c.queries; ++query) {
      for (size_t i = 0; i < c.heads * c.width; ++i) {
        ASSERT_EQ(out[query * in.stride + i], first[query * in.stride + i]) << threads;
      }
    }
  }
}

TEST(SharedAttention, RefusesNoRowsAndStopsWhenCancelled) {
  const Case c = {1, 4, 3, 2, 1};
  Inputs in(c, 1.0f);
  Progress progress;
  progress.cancel();
  NetworkRun run;
  run.progress = &progress;
  std::vector<float> out(in.stride);
  expectError(ErrorCode::kCancelled, {}, [&] {
    sharedAttention(run, in.heads, in.rows, 1, in.queries.data(), in.stride, out.data());
  });
  in.rows = SharedRows();
  expectError(ErrorCode::kInvalidArgument, {"0 keys", "1 is needed"}, [&] {
    sharedAttention({}, in.heads, in.rows, 1, in.queries.data(), in.stride, out.data());
  });
}

// Two tiles of 37 and 5 keys, columns on both sides of vectors of 1 to 16 numbers.
TEST(SoftmaxColumns, OfEveryKernelAgreeWithSumsInDouble) {
  constexpr size_t kKeys[] = {37, 5};
  constexpr size_t kWidth = 3;
  for (const LayerKernel& kernel : layerKernels()) {
    for (const size_t columns : {1, 8, 15, 16, 17, 32}) {
      std::vector<float> peaks(columns, std::numeric_limits<float>::lowest());
      std::vector<float> sums(columns), out(kWidth * columns, 0.0f);
      std::vector<double> scores(42 * columns);
      size_t first = 0;
      for (const size_t keys : kKeys) {
        std::vector<float> tile = numbers(keys * columns, 1 + first),
                           rates = numbers(keys, 9 + first);
        for (float& rate : rates) rate *= 40;
        for (size_t i = 0; i < tile.size(); ++i) {
          scores[first * columns + i] =
              static_cast<double>(rates[i / columns]) * static_cast<double>(tile[i]);
        }
        SoftmaxColumns work;
        work.scores = tile.data();
        work.keys = keys;
        work.columns = columns;
        work.rates = rates.data();
        work.peaks = peaks.data();
        work.sums = sums.data();
        work.out = out.data();
        work.width = kWidth;
        kernel.softmaxColumns(work);
        // What the tile gathers, of values 1.
        for (size_t i = 0; i < keys; ++i) {
          for (size_t c = 0; c < columns; ++c) {
            for (size_t k = 0; k < kWidth; ++k) out[k * columns + c] += tile[i * columns + c];
          }
        }
        first += keys;
      }
      for (size_t c = 0; c < columns; ++c) {
        double peak = -1e300, sum = 0;
        for (size_t i = 0; i < first; ++i) peak = std::max(peak, scores[i * columns + c]);
        for (size_t i = 0; i < first; ++i) sum += std::exp(scores[i * columns + c] - peak);
        EXPECT_NEAR(static_cast<double>(peaks[c]), peak, 1e-7 * (1 + std::abs(peak)));
        // Scores of up to 40 are off by 2.4e-6, and exponentials by 2e-7 (1 + 80).
        EXPECT_NEAR(static_cast<double>(sums[c]), sum, 2e-5 * sum) << kernel.target << columns;
        for (size_t k = 0; k < kWidth; ++k) {
          EXPECT_NEAR(static_cast<double>(out[k * columns + c]), sum, 2e-5 * sum)
              << kernel.target << " " << columns;
        }
      }
    }
  }
}

}  // namespace
}  // namespace stipple
