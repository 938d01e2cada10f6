#include "base/stopwatch.h"

#include <gtest/gtest.h>

#include <chrono>
#include <thread>

namespace stipple {
namespace {

constexpr std::chrono::milliseconds kShort(5);
constexpr double kShortSeconds = 5e-3;

TEST(Stopwatch, CountsFromItsStartAndFromTheLastLap) {
  Stopwatch watch;
  std::this_thread::sleep_for(kShort);
  const double first = watch.lap();
  std::this_thread::sleep_for(kShort);
  const double second = watch.lap();
  const double whole = watch.seconds();
  // A sleep is never shorter than it says; laps leave nothing out and count nothing twice.
  EXPECT_GE(first, kShortSeconds);
  EXPECT_GE(second, kShortSeconds);
  EXPECT_GE(whole, first + second);
  EXPECT_LT(watch.lap(), whole);
}

TEST(TimedBlock, AddsToItsSum) {
  double sum = 1;
  {
    const TimedBlock block(sum);
    std::this_thread::sleep_for(kShort);
    EXPECT_EQ(sum, 1);
  }
  EXPECT_GE(sum, 1 + kShortSeconds);
}

}  // namespace
}  // namespace stipple
