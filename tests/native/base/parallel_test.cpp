#include "base/parallel.h"

#include <gtest/gtest.h>
#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cfenv>
#include <chrono>
#include <fstream>
#include <numeric>
#include <stdexcept>
#include <thread>
#include <vector>

namespace stipple {
namespace {

TEST(ParallelFor, VisitsEveryIndexOnceForAnyThreadCount) {
  for (const unsigned threads : {1u, 2u, 0u}) {
    std::vector<int> visits(10007, 0);
    withThreads(threads, [&] {
      parallelFor(visits.size(), 64, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) ++visits[i];
      });
    });
    EXPECT_EQ(std::accumulate(visits.begin(), visits.end(), 0), 10007);
    EXPECT_EQ(*std::max_element(visits.begin(), visits.end()), 1);
  }
}

TEST(ParallelFor, DoesNothingForAnEmptyRange) {
  parallelFor(0, 64, [](size_t, size_t) { FAIL() << "called"; });
}

TEST(ParallelFor, PassesAnExceptionOn) {
  EXPECT_THROW(parallelFor(1000, 10,
                           [](size_t begin, size_t) {
                             if (begin == 500) throw std::runtime_error("five hundred");
                           }),
               std::runtime_error);
}

void work() {
  parallelFor(64, 1, [](size_t, size_t) {});
}

/// Resident memory of this process, without what malloc only keeps for later.
double residentKib() {
  malloc_trim(0);
  double pages = 0;
  std::ifstream("/proc/self/statm") >> pages >> pages;
  return pages * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1024;
}

TEST(WithThreads, LeavesNoMemoryBehind) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "Sanitizers keep what is freed, so that resident memory says nothing.";
#endif
  constexpr int kCalls = 2000;
  const auto calls = [] {
    for (int i = 0; i < kCalls; ++i) withThreads(1 + i % 2, work);
  };
  calls();
  const double before = residentKib();
  calls();
  // An arena for each call left 7 KiB a call. Half a KiB is far from that, and leaves a MiB for the
  // pages that a process takes and returns at its own time.
  EXPECT_LT(residentKib() - before, 0.5 * kCalls);
}

TEST(WithThreads, LetsCallsOfOneThreadCountWorkAtTheSameTime) {
  // Each waits for the other: were they to share the single slot of an arena, neither would end.
  std::atomic<int> inside{0};
  const auto meet = [&] {
    withThreads(1, [&] {
      ++inside;
      const auto start = std::chrono::steady_clock::now();
      while (inside < 2 && std::chrono::steady_clock::now() - start < std::chrono::seconds(20)) {
        std::this_thread::yield();
      }
    });
  };
  std::thread other(meet);
  meet();
  other.join();
  EXPECT_EQ(inside, 2);
}

TEST(WithThreads, LimitsTheInnermostOfNestedCalls) {
  withThreads(2, [] {
    EXPECT_EQ(threadLimit(), 2u);
    withThreads(1, [] {
      EXPECT_EQ(threadLimit(), 1u);
      withThreads(2, [] { EXPECT_EQ(threadLimit(), 2u); });
      EXPECT_EQ(threadLimit(), 1u);
    });
    EXPECT_EQ(threadLimit(), 2u);
  });
}

TEST(WithThreads, IsUsableAfterABodyThatThrows) {
  for (int i = 0; i < 3; ++i) {
    EXPECT_THROW(withThreads(2, [] { throw std::runtime_error("no"); }), std::runtime_error);
    std::atomic<int> visits{0};
    withThreads(2, [&] { parallelFor(100, 1, [&](size_t, size_t) { ++visits; }); });
    EXPECT_EQ(visits, 100);
  }
}

TEST(WithThreads, CalculatesWithTheSettingsOfItsCaller) {
  // The thread count is that of no other test, so that the arena is made by this thread, whose
  // rounding is another.
  constexpr unsigned kThreads = 3;
  const int usual = std::fegetround();
  std::thread([] {
    std::fesetround(FE_UPWARD);
    withThreads(kThreads, work);
  }).join();
  std::atomic<int> others{0};
  withThreads(kThreads, [&] {
    parallelFor(256, 1, [&](size_t, size_t) {
      if (std::fegetround() != usual) ++others;
    });
  });
  EXPECT_EQ(others, 0);
}

}  // namespace
}  // namespace stipple
