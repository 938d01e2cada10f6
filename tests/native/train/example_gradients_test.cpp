#include "train/networks/example_gradients.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <span>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"

namespace stipple {
namespace {

constexpr size_t kNumbers = 50000;  // more than one task of the sum

/// Numbers that another order of summation rounds elsewhere.
void addNumbers(size_t example, std::span<float> gradients) {
  for (size_t i = 0; i < gradients.size(); ++i) {
    gradients[i] += std::sin(static_cast<float>(i + 1) * static_cast<float>(example + 1));
    gradients[i] += 0.1f * static_cast<float>(example);
  }
}

std::vector<float> sumOf(unsigned threads, size_t count, ExampleGradients& examples) {
  std::vector<float> gradients(kNumbers, 7.0f);  // is replaced
  withThreads(threads, [&] { examples.sum(count, gradients, addNumbers); });
  return gradients;
}

TEST(ExampleGradients, AddUpInOrderWhateverTheThreads) {
  for (const size_t count : {size_t{1}, size_t{2}, size_t{3}, size_t{7}}) {
    std::vector<float> expected(kNumbers, 0.0f);
    for (size_t example = 0; example < count; ++example) {
      std::vector<float> own(kNumbers, 0.0f);
      addNumbers(example, own);
      for (size_t i = 0; i < kNumbers; ++i) expected[i] += own[i];
    }
    ExampleGradients examples;
    for (const unsigned threads : {1u, 2u, 3u, 16u}) {
      EXPECT_EQ(sumOf(threads, count, examples), expected) << count << ", " << threads;
    }
  }
}

TEST(ExampleGradients, OfNoExampleAreZero) {
  ExampleGradients examples;
  EXPECT_EQ(sumOf(2, 0, examples), std::vector<float>(kNumbers, 0.0f));
}

TEST(ExampleGradients, AreEachAskedForOnceAndOnEachThreadOne) {
  constexpr size_t kCount = 11;
  std::vector<std::atomic<int>> asked(kCount);
  std::vector<float> gradients(3);
  ExampleGradients examples;
  std::atomic<int> now{0}, most{0};
  withThreads(3, [&] {
    EXPECT_EQ(examplesAtOnce(kCount), 3u);
    EXPECT_EQ(examplesAtOnce(2), 2u);
    EXPECT_EQ(examplesAtOnce(0), 1u);
    examples.sum(kCount, gradients, [&](size_t example, std::span<float>) {
      const int busy = ++now;
      for (int seen = most; seen < busy && !most.compare_exchange_weak(seen, busy);) {
      }
      ++asked[example];
      --now;
    });
  });
  for (size_t i = 0; i < kCount; ++i) EXPECT_EQ(asked[i], 1) << i;
  EXPECT_LE(most, 3);  // as much memory as was told of
}

TEST(ExampleGradients, HandOnWhatGoesWrongAndGoOnAfterwards) {
  ExampleGradients examples;
  std::vector<float> gradients(kNumbers);
  const auto broken = [](size_t example, std::span<float> of_example) {
    of_example[0] = 1;
    if (example == 4) fail(ErrorCode::kInvalidArgument, "the fifth object is broken");
  };
  withThreads(2, [&] { EXPECT_THROW(examples.sum(6, gradients, broken), Error); });
  ExampleGradients fresh;
  EXPECT_EQ(sumOf(2, 6, examples), sumOf(1, 6, fresh));
}

}  // namespace
}  // namespace stipple
