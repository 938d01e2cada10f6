#include "base/parallel.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <stdexcept>
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
  EXPECT_THROW(
      parallelFor(1000, 10, [](size_t begin, size_t) {
        if (begin == 500) throw std::runtime_error("five hundred");
      }),
      std::runtime_error);
}

}  // namespace
}  // namespace stipple
