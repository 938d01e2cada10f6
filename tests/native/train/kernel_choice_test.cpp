#include "base/kernel_choice.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "train/optimiser/adam_kernel.h"
#include "train/optimiser/image_loss_kernel.h"

namespace stipple {
namespace {

/// Exit code 7: the variable has chosen this target. In a process of its own: it is read once.
template <class Kernel>
[[noreturn]] void exitWithChoice(const char* forced, const char* expected, Kernel (*chosen)()) {
  setenv("STIPPLE_FORCE_TARGET", forced, 1);
  try {
    std::exit(std::strcmp(chosen().target, expected) == 0 ? 7 : 1);
  } catch (const Error& error) {
    std::fputs(error.what(), stderr);
    std::exit(8);
  }
}

TEST(TrainingKernels, FollowTheEnvironmentVariable) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  for (const LossKernel& kernel : lossKernels()) {
    EXPECT_EXIT(exitWithChoice(kernel.target, kernel.target, chosenLossKernel),
                ::testing::ExitedWithCode(7), "");
  }
  for (const AdamKernel& kernel : adamKernels()) {
    EXPECT_EXIT(exitWithChoice(kernel.target, kernel.target, chosenAdamKernel),
                ::testing::ExitedWithCode(7), "");
  }
  EXPECT_EXIT(exitWithChoice("SCALAR", "scalar", chosenLossKernel), ::testing::ExitedWithCode(7),
              "");
  EXPECT_EXIT(exitWithChoice("abacus", "", chosenLossKernel), ::testing::ExitedWithCode(8),
              "abacus.*scalar");
}

TEST(TrainingKernels, AreTheBestOfTheProcessorWhereNothingIsForced) {
  if (std::getenv("STIPPLE_FORCE_TARGET")) GTEST_SKIP() << "STIPPLE_FORCE_TARGET is set";
  EXPECT_STRNE(chosenLossKernel().target, "scalar");
  EXPECT_STREQ(chosenLossKernel().target, chosenAdamKernel().target);
}

}  // namespace
}  // namespace stipple
