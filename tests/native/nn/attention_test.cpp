#include "nn/attention.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "base/parallel.h"
#include "io/scratch_folder.h"
#include "nn/matrix_backend.h"
#include "test_numbers.h"

namespace stipple {
namespace {

struct Case {
  AttentionShape shape;
  bool with_bias;
};

// On both sides of a tile of queries (120) and of keys (256); a wide head; widths that are not a
// multiple of a vector.
const Case kCases[] = {{{1, 64, 1, 1}, false},   {{2, 64, 130, 300}, true},
                       {{3, 20, 7, 513}, false}, {{1, 512, 121, 257}, true},
                       {{2, 5, 3, 256}, true},   {{2, 64, 0, 5}, false}};

std::vector<double> byHand(const AttentionShape& s, const std::vector<float>& q,
                           const std::vector<float>& k, const std::vector<float>& v, size_t stride,
                           const std::vector<float>& bias, double scale) {
  std::vector<double> out(s.queries * s.heads * s.head_width);
  std::vector<double> powers(s.keys);
  for (size_t i = 0; i < s.queries; ++i) {
    for (size_t h = 0; h < s.heads; ++h) {
      double peak = -1e300, sum = 0;
      for (size_t j = 0; j < s.keys; ++j) {
        double score = 0;
        for (size_t d = 0; d < s.head_width; ++d) {
          score += static_cast<double>(q[i * stride + h * s.head_width + d]) *
                   static_cast<double>(k[j * stride + h * s.head_width + d]);
        }
        powers[j] = score * scale + (bias.empty() ? 0.0 : static_cast<double>(bias[j]));
        peak = std::max(peak, powers[j]);
      }
      for (double& power : powers) sum += power = std::exp(power - peak);
      for (size_t d = 0; d < s.head_width; ++d) {
        double value = 0;
        for (size_t j = 0; j < s.keys; ++j) {
          value += powers[j] * static_cast<double>(v[j * stride + h * s.head_width + d]);
        }
        out[(i * s.heads + h) * s.head_width + d] = value / sum;
      }
    }
  }
  return out;
}

/// Queries, keys and values with gaps between rows.
struct Inputs {
  explicit Inputs(const AttentionShape& s, float size)
      : stride(s.heads * s.head_width + 7),
        q(numbers(s.queries * stride, 1)),
        k(numbers(s.keys * stride, 2)),
        v(numbers(s.keys * stride, 3)) {
    for (float& value : q) value *= size;
  }
  size_t stride;
  std::vector<float> q, k, v;
};

TEST(Attention, AgreesWithSumsInDouble) {
  for (const Case& c : kCases) {
    // Scores of about 0.3 and of up to about 30: nearly even weights, and nearly one winner.
    for (const float size : {1.0f, 60.0f}) {
      const AttentionShape& s = c.shape;
      const Inputs in(s, size);
      std::vector<float> bias;
      if (c.with_bias) bias = numbers(s.keys, 4);
      const size_t width = s.heads * s.head_width, out_stride = width + 2;
      std::vector<float> out(s.queries * out_stride, 99.0f);
      const float scale = c.with_bias ? 0.2f : kDefaultScale;
      attention({}, s, {in.q.data(), in.stride}, {in.k.data(), in.stride}, {in.v.data(), in.stride},
                out.data(), out_stride, bias, scale);
      const double rate = c.with_bias ? static_cast<double>(0.2f)
                                      : 1.0 / std::sqrt(static_cast<double>(s.head_width));
      const std::vector<double> expected = byHand(s, in.q, in.k, in.v, in.stride, bias, rate);
      // A score is off by 6e-8 of its terms' sizes, of which there are head_width; so is the weight
      // that is its exponential, relatively; values are at most 1.
      const double terms = rate * static_cast<double>(size) * static_cast<double>(s.head_width);
      const double tolerance = 3e-7 + 6e-8 * terms;
      for (size_t i = 0; i < s.queries; ++i) {
        for (size_t j = 0; j < width; ++j) {
          ASSERT_NEAR(static_cast<double>(out[i * out_stride + j]), expected[i * width + j],
                      tolerance)
              << s.heads << "x" << s.head_width << " " << s.queries << "x" << s.keys;
        }
        for (size_t j = width; j < out_stride; ++j) EXPECT_EQ(out[i * out_stride + j], 99.0f);
      }
    }
  }
}

TEST(Attention, InBfloat16IsAsNearAsItsFactors) {
  // Every shape again, and tiles of 192 queries and 1024 keys.
  std::vector<Case> cases(std::begin(kCases), std::end(kCases));
  cases.push_back({{2, 64, 200, 1100}, true});
  for (const MatrixBackend* backend : matrixBackends()) {
    if (!backend->has(FactorPrecision::kBfloat16)) continue;
    NetworkRun run;
    run.backend = backend;
    run.precision = FactorPrecision::kBfloat16;
    for (const Case& c : cases) {
      const AttentionShape& s = c.shape;
      const Inputs in(s, 1.0f);
      std::vector<float> bias;
      if (c.with_bias) bias = numbers(s.keys, 4);
      const size_t width = s.heads * s.head_width;
      std::vector<float> out(s.queries * width, 99.0f);
      attention(run, s, {in.q.data(), in.stride}, {in.k.data(), in.stride},
                {in.v.data(), in.stride}, out.data(), width, bias);
      const std::vector<double> expected = byHand(
          s, in.q, in.k, in.v, in.stride, bias, 1.0 / std::sqrt(static_cast<double>(s.head_width)));
      // Values and weights of keys are rounded by 2^-9 each, and scores, of about 0.3, by as much
      // of themselves; values are at most 1, and of many keys errors nearly cancel.
      for (size_t i = 0; i < out.size(); ++i) {
        ASSERT_NEAR(static_cast<double>(out[i]), expected[i], 6e-3)
            << backend->name() << " " << s.queries << "x" << s.keys;
      }
    }
  }
}

TEST(Attention, WritesOverItsQueriesWithTheSameBitsForAnyNumberOfThreads) {
  const AttentionShape shape = {3, 64, 250, 600};
  const Inputs in(shape, 5.0f);
  for (const FactorPrecision precision : {FactorPrecision::kBfloat16, FactorPrecision::kFloat32}) {
    NetworkRun run;
    run.precision = precision;
    std::vector<float> first;
    for (const unsigned threads : {1u, 2u, 5u}) {
      std::vector<float> q = in.q;
      withThreads(threads, [&] {
        attention(run, shape, {q.data(), in.stride}, {in.k.data(), in.stride},
                  {in.v.data(), in.stride}, q.data(), in.stride);
      });
      if (first.empty()) first = q;
      EXPECT_EQ(q, first) << threads;
    }
    const std::vector<double> expected = byHand(shape, in.q, in.k, in.v, in.stride, {}, 1.0 / 8.0);
    // bfloat16, where a backend has it, rounds values and weights by 2^-9.
    EXPECT_NEAR(static_cast<double>(first[0]), expected[0],
                precision == FactorPrecision::kFloat32 ? 1e-5 : 2e-2);
  }
}

TEST(Attention, LeavesOutKeysWhoseBiasIsMinusInfinity) {
  // The first tile of keys as a whole, and one of the second.
  const AttentionShape shape = {1, 16, 5, 300};
  const Inputs in(shape, 1.0f);
  std::vector<float> bias(300, 0.0f);
  for (size_t i = 0; i < 257; ++i) bias[i] = -std::numeric_limits<float>::infinity();
  std::vector<float> out(5 * 16);
  attention({}, shape, {in.q.data(), in.stride}, {in.k.data(), in.stride}, {in.v.data(), in.stride},
            out.data(), 16, bias);
  const AttentionShape rest = {1, 16, 5, 43};
  std::vector<float> of_rest(5 * 16);
  attention({}, rest, {in.q.data(), in.stride}, {&in.k[257 * in.stride], in.stride},
            {&in.v[257 * in.stride], in.stride}, of_rest.data(), 16);
  for (size_t i = 0; i < out.size(); ++i) EXPECT_NEAR(out[i], of_rest[i], 1e-6f);
}

TEST(Attention, RefusesNoKeysAndStopsWhenCancelled) {
  const std::vector<float> q(16);
  std::vector<float> out(16);
  expectError(ErrorCode::kInvalidArgument, {"0 keys"}, [&] {
    attention({}, {1, 16, 1, 0}, {q.data(), 16}, {q.data(), 16}, {q.data(), 16}, out.data(), 16);
  });
  Progress progress;
  progress.cancel();
  NetworkRun run;
  run.progress = &progress;
  expectError(ErrorCode::kCancelled, {}, [&] {
    attention(run, {1, 16, 1, 1}, {q.data(), 16}, {q.data(), 16}, {q.data(), 16}, out.data(), 16);
  });
}

}  // namespace
}  // namespace stipple
