#include "train/optimiser/adam.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "train/allocation_count.h"
#include "train/optimiser/adam_kernel.h"

namespace stipple {
namespace {

/// One group and its memory.
struct Parameters {
  size_t rows, length;
  double rate;
  std::vector<float> p, g, m, v;

  Parameters(size_t row_count, size_t row_length, double learning_rate)
      : rows(row_count),
        length(row_length),
        rate(learning_rate),
        p(rows * length),
        g(rows * length),
        m(rows * length),
        v(rows * length) {}
  AdamGroup group() { return {p.data(), g.data(), m.data(), v.data(), rows, length, rate}; }
};

void fill(std::vector<float>& values, float size, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<float> normal;
  for (float& value : values) value = size * normal(random);
}

/// The paper's algorithm 1 in double.
struct ReferenceAdam {
  std::vector<double> p, m, v;
  explicit ReferenceAdam(const std::vector<float>& start)
      : p(start.begin(), start.end()), m(start.size()), v(start.size()) {}
  void step(const std::vector<float>& gradients, double rate, int t) {
    for (size_t i = 0; i < p.size(); ++i) {
      const double g = static_cast<double>(gradients[i]);
      m[i] = 0.9 * m[i] + 0.1 * g;
      v[i] = 0.999 * v[i] + 0.001 * g * g;
      const double first = m[i] / (1 - std::pow(0.9, t));
      const double second = v[i] / (1 - std::pow(0.999, t));
      p[i] -= rate * first / (std::sqrt(second) + 1e-15);
    }
  }
};

TEST(Adam, FollowsTheDoubleReferenceForAThousandSteps) {
  for (const AdamKernel& kernel : adamKernels()) {
    SCOPED_TRACE(kernel.target);
    Parameters group(57, 3, 1e-3);
    fill(group.p, 1.0f, 1);
    ReferenceAdam reference(group.p);
    const AdamGroup groups[] = {group.group()};
    for (int t = 1; t <= 1000; ++t) {
      // Sizes as gradients of splats have them, from 1e-9 to 1.
      fill(group.g, std::pow(10.0f, static_cast<float>(-(t % 10))), static_cast<unsigned>(t));
      adamStepWith(kernel, groups, static_cast<uint64_t>(t));
      reference.step(group.g, 1e-3, t);
    }
    for (size_t i = 0; i < group.p.size(); ++i) {
      // Each step rounds p, of size up to 4, by 1.2e-7 either way: the walk of 1000 stays below
      // 6 sqrt(1000) 1.2e-7 = 2.3e-5, and the steps, 1e-3 at most, are off by 1e-6 of themselves.
      EXPECT_NEAR(group.p[i], reference.p[i], 3e-5);
      // A moment forgets its rounding errors as it forgets its past: 10 and 1000 steps of 6e-8.
      EXPECT_NEAR(group.m[i], reference.m[i], 1e-6 * std::sqrt(reference.v[i]));
      EXPECT_NEAR(group.v[i], reference.v[i], 1e-5 * reference.v[i]);
    }
  }
}

TEST(Adam, AConstantGradientMovesByTheRateEachStep) {
  // m' = g and v' = g^2 exactly, whatever g is: every step is rate * sign(g).
  for (const float g : {1e-12f, -3e-4f, 7e5f}) {
    Parameters group(5, 7, 0.01);
    std::fill(group.g.begin(), group.g.end(), g);
    const AdamGroup groups[] = {group.group()};
    for (uint64_t t = 1; t <= 1000; ++t) adamStep(groups, t);
    // 1000 roundings of numbers up to 10, 4.8e-7 each; at 1e-12 epsilon takes 1e-3 of a step.
    const double expected = -10.0 * std::copysign(1.0, static_cast<double>(g)) /
                            (1 + 1e-15 / std::abs(static_cast<double>(g)));
    for (const float p : group.p) EXPECT_NEAR(p, expected, 5e-4);
  }
}

TEST(Adam, GroupsHaveTheirOwnRates) {
  Parameters still(40, 3, 0.0), slow(40, 48, 1e-4), fast(17, 1, 0.5);
  for (Parameters* group : {&still, &slow, &fast}) fill(group->g, 1.0f, 4);
  const AdamGroup groups[] = {still.group(), slow.group(), fast.group()};
  adamStep(groups, 1);
  // The first step is rate * sign(g), up to the rounding of the factors.
  for (const float p : still.p) EXPECT_EQ(p, 0.0f);
  for (const float p : slow.p) EXPECT_NEAR(std::abs(p), 1e-4, 1e-9);
  for (const float p : fast.p) EXPECT_NEAR(std::abs(p), 0.5, 1e-6);
  EXPECT_NE(still.m[0], 0.0f);
}

TEST(Adam, RowsThatLieApartAreSteppedAsIfTheyDidNot) {
  // The first harmonic and the 15 others of 700 Gaussians, each with its rate.
  Parameters together(700, 48, 0);
  fill(together.p, 1.0f, 40);
  fill(together.g, 1.0f, 41);
  fill(together.m, 0.1f, 42);
  std::fill(together.v.begin(), together.v.end(), 0.2f);
  Parameters first(700, 3, 1e-2), others(700, 45, 5e-4);
  const auto copyRows = [&](const std::vector<float>& from, std::vector<float>& head,
                            std::vector<float>& tail) {
    for (size_t row = 0; row < 700; ++row) {
      std::copy_n(&from[row * 48], 3, &head[row * 3]);
      std::copy_n(&from[row * 48 + 3], 45, &tail[row * 45]);
    }
  };
  for (std::vector<float> Parameters::*array :
       {&Parameters::p, &Parameters::g, &Parameters::m, &Parameters::v}) {
    copyRows(together.*array, first.*array, others.*array);
  }
  const AdamGroup apart[] = {first.group(), others.group()};
  AdamGroup head = together.group();
  head.row_length = 3;
  head.row_stride = 48;
  head.learning_rate = 1e-2;
  AdamGroup tail = head;
  tail.row_length = 45;
  tail.learning_rate = 5e-4;
  tail.gradients += 3;
  for (float** array : {&tail.parameters, &tail.first_moments, &tail.second_moments}) *array += 3;
  const AdamGroup strided[] = {head, tail};
  std::vector<uint8_t> visible(700);
  for (size_t i = 0; i < 700; ++i) visible[i] = i % 5 != 0;
  for (const uint8_t* flags :
       {static_cast<const uint8_t*>(nullptr), static_cast<const uint8_t*>(visible.data())}) {
    adamStep(apart, 2, {}, flags);
    adamStep(strided, 2, {}, flags);
    for (std::vector<float> Parameters::*array : {&Parameters::p, &Parameters::m, &Parameters::v}) {
      std::vector<float> seen_first(700 * 3), seen_others(700 * 45);
      copyRows(together.*array, seen_first, seen_others);
      EXPECT_EQ(seen_first, first.*array);
      EXPECT_EQ(seen_others, others.*array);
    }
  }
  together.g[48 * 9 + 3 + 7] = std::numeric_limits<float>::infinity();
  try {
    adamStep(strided, 3);
    ADD_FAILURE() << "accepted";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("gradient 7 of row 9 in group 1 is inf"),
              std::string::npos)
        << error.what();
  }
  tail.row_stride = 44;
  EXPECT_THROW(adamStep({&tail, 1}, 3), Error);
}

TEST(Adam, RowsThatAreNotVisibleStayAsTheyAre) {
  for (const size_t length : {1u, 3u, 48u}) {
    Parameters sparse(1000, length, 1e-2), dense(1000, length, 1e-2);
    fill(sparse.p, 1.0f, 5);
    fill(sparse.m, 0.1f, 6);
    std::fill(sparse.v.begin(), sparse.v.end(), 0.3f);
    fill(sparse.g, 1.0f, 7);
    std::vector<uint8_t> visible(1000);
    for (size_t i = 0; i < 1000; ++i) visible[i] = i % 7 < 3 || (i > 400 && i < 600);
    // A row that is left out may hold anything.
    sparse.g[6 * length] = std::numeric_limits<float>::quiet_NaN();
    const Parameters before = sparse;
    dense = before;
    dense.g[6 * length] = 0;
    const AdamGroup sparse_group[] = {sparse.group()};
    const AdamGroup dense_group[] = {dense.group()};
    adamStep(sparse_group, 3, {}, visible.data());
    adamStep(dense_group, 3);
    for (size_t i = 0; i < sparse.p.size(); ++i) {
      const Parameters& expected = visible[i / length] ? dense : before;
      ASSERT_EQ(sparse.p[i], expected.p[i]) << i;
      ASSERT_EQ(sparse.m[i], expected.m[i]) << i;
      ASSERT_EQ(sparse.v[i], expected.v[i]) << i;
    }
  }
}

TEST(Adam, EveryTargetIsTheScalarOne) {
  const std::vector<AdamKernel> kernels = adamKernels();
  ASSERT_GE(kernels.size(), 2u);
  EXPECT_EQ(std::string(kernels.front().target), "scalar");
  for (size_t count = 1; count < 70; ++count) {
    Parameters start(count, 1, 1e-2);
    fill(start.p, 1.0f, 8);
    fill(start.g, 1.0f, 9);
    fill(start.m, 0.1f, 10);
    std::fill(start.v.begin(), start.v.end(), 0.2f);
    Parameters expected = start;
    const AdamGroup expected_group[] = {expected.group()};
    adamStepWith(kernels.front(), expected_group, 5);
    for (const AdamKernel& kernel : kernels) {
      SCOPED_TRACE(kernel.target);
      Parameters seen = start;
      const AdamGroup group[] = {seen.group()};
      adamStepWith(kernel, group, 5);
      for (size_t i = 0; i < count; ++i) {
        // A few roundings, fused or not, of numbers of about 1.
        ASSERT_NEAR(seen.p[i], expected.p[i], 4e-7);
        ASSERT_NEAR(seen.m[i], expected.m[i], 2e-7);
        ASSERT_NEAR(seen.v[i], expected.v[i], 2e-7);
      }
    }
  }
}

TEST(Adam, SameBitsForAnyNumberOfThreadsAndNoAllocation) {
  Parameters start(30000, 7, 1e-2);
  fill(start.p, 1.0f, 11);
  fill(start.g, 1.0f, 12);
  std::vector<std::vector<float>> results;
  for (const unsigned threads : {1u, 2u, 5u}) {
    Parameters copy = start;
    withThreads(threads, [&] {
      const AdamGroup groups[] = {copy.group()};
      adamStep(groups, 1);
      const size_t before = testing::allocationCount();
      adamStep(groups, 2);
      EXPECT_EQ(testing::allocationCount(), before);
    });
    results.push_back(copy.p);
  }
  EXPECT_EQ(results[0], results[1]);
  EXPECT_EQ(results[0], results[2]);
}

TEST(Adam, MomentsOfForgottenParametersReachZero) {
  // 0.9 x of the smallest denormal number rounds to itself: without a floor it would stay for ever.
  for (const AdamKernel& kernel : adamKernels()) {
    SCOPED_TRACE(kernel.target);
    Parameters group(3, 7, 1e-2);
    fill(group.g, 1e-3f, 13);
    const AdamGroup groups[] = {group.group()};
    adamStepWith(kernel, groups, 1);
    std::fill(group.g.begin(), group.g.end(), 0.0f);
    for (uint64_t t = 2; t <= 900; ++t) {
      adamStepWith(kernel, groups, t);
      for (const float m : group.m) ASSERT_TRUE(m == 0.0f || std::isnormal(m));
    }
    for (const float m : group.m) EXPECT_EQ(m, 0.0f);
  }
}

std::string messageOf(std::span<const AdamGroup> groups, uint64_t step, const AdamOptions& options,
                      const uint8_t* visible = nullptr) {
  try {
    adamStep(groups, step, options, visible);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    return error.what();
  }
  return "nothing thrown";
}

TEST(Adam, ABadGradientChangesNothingOfItsElement) {
  for (const AdamKernel& kernel : adamKernels()) {
    for (const float bad : {std::numeric_limits<float>::quiet_NaN(),
                            -std::numeric_limits<float>::infinity(), 2e18f}) {
      Parameters group(20, 5, 1e-2);
      fill(group.p, 1.0f, 14);
      fill(group.g, 1.0f, 15);
      group.g[63] = bad;
      group.g[98] = bad;
      const Parameters before = group;
      const AdamGroup groups[] = {group.group()};
      try {
        adamStepWith(kernel, groups, 1);
        ADD_FAILURE() << "nothing thrown";
      } catch (const Error& error) {
        EXPECT_NE(std::string(error.what()).find("gradient 3 of row 12 in group 0 is "),
                  std::string::npos)
            << error.what();
      }
      for (size_t i = 0; i < 100; ++i) {
        EXPECT_EQ(group.p[i] == before.p[i], i == 63 || i == 98) << i;
        EXPECT_TRUE(std::isfinite(group.m[i]) && std::isfinite(group.v[i]));
      }
    }
  }
}

TEST(Adam, RefusesBadOptionsAndChangesNothing) {
  Parameters group(4, 3, 1e-2), other(5, 3, 1e-2);
  fill(group.g, 1.0f, 16);
  const std::vector<uint8_t> visible(5, 1);
  const AdamGroup one[] = {group.group()};
  const AdamGroup two[] = {group.group(), other.group()};
  AdamGroup wrong[] = {group.group()};
  EXPECT_NE(messageOf(one, 0, {}).find("step is 0"), std::string::npos);
  EXPECT_NE(messageOf(one, 1, {.beta1 = 1.0}).find("beta1 is 1"), std::string::npos);
  EXPECT_NE(messageOf(one, 1, {.beta2 = -0.5}).find("beta2 is -0.5"), std::string::npos);
  EXPECT_NE(messageOf(one, 1, {.epsilon = 0}).find("epsilon is 0"), std::string::npos);
  EXPECT_NE(messageOf(two, 1, {}, visible.data()).find("group 1 has 5 rows"), std::string::npos);
  wrong[0].learning_rate = -1;
  EXPECT_NE(messageOf(wrong, 1, {}).find("group 0: learning_rate is -1"), std::string::npos);
  wrong[0] = group.group();
  wrong[0].gradients = nullptr;
  EXPECT_NE(messageOf(wrong, 1, {}).find("group 0: an array is null"), std::string::npos);
  for (const float p : group.p) EXPECT_EQ(p, 0.0f);
  for (const float m : group.m) EXPECT_EQ(m, 0.0f);
}

TEST(Adam, NoGroupsAndEmptyGroupsAreNoWork) {
  adamStep({}, 1);
  Parameters alone(5, 3, 0.1), between(5, 3, 0.1);
  for (Parameters* some : {&alone, &between}) fill(some->g, 1, 7);
  const AdamGroup one[] = {alone.group()};
  adamStep(one, 1);
  const AdamGroup with_empty[] = {
      AdamGroup{}, between.group(), {nullptr, nullptr, nullptr, nullptr, 0, 3, 0.1}};
  adamStep(with_empty, 1);
  EXPECT_NE(between.p, std::vector<float>(15));
  EXPECT_EQ(between.p, alone.p);
}

}  // namespace
}  // namespace stipple
