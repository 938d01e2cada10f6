// The name sorts first: the tests after it rely on what it shows.
#include "traps.h"

#include <gtest/gtest.h>

#include <cfenv>
#include <chrono>
#include <csignal>
#include <thread>

#include "base/parallel.h"

namespace stipple {

namespace testing {

namespace {

const char* missing = "traps were never asked for";

}  // namespace

void enableTraps() {
#ifdef STIPPLE_SANITIZED
  missing = "the sanitizers handle SIGFPE themselves";
#else
  missing = feenableexcept(FE_INVALID | FE_DIVBYZERO | FE_OVERFLOW) == -1
                ? "this processor has no floating-point traps"
                : nullptr;
#endif
}

const char* whyNoTraps() {
  return missing;
}

}  // namespace testing

namespace {

volatile double zero = 0.0;
volatile double sink = 0.0;

/// Divides by zero in a thread that is not the caller's; returns if no such thread turns up in 5 s.
void divideByZeroInAWorker() {
  const std::thread::id caller = std::this_thread::get_id();
  withThreads(2, [&] {
    parallelFor(5000, 1, [&](size_t, size_t) {
      if (std::this_thread::get_id() != caller) sink = 1.0 / zero;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    });
  });
}

TEST(Traps, ADivisionByZeroInAWorkerDies) {
  if (testing::whyNoTraps()) GTEST_SKIP() << testing::whyNoTraps();
  if (std::thread::hardware_concurrency() < 2) GTEST_SKIP() << "one core: there is no worker";
  EXPECT_EXIT(divideByZeroInAWorker(), ::testing::KilledBySignal(SIGFPE), "");
}

}  // namespace
}  // namespace stipple
