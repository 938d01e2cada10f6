#include "base/memory_limit.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include "base/error.h"

namespace stipple {
namespace {

std::string refusal(uint64_t limit, uint64_t budget) {
  MemoryLimit memory;
  memory.memory_limit_bytes = limit;
  try {
    memory.requireBudget(budget, "anchors", [](uint64_t count) { return 50 + 7 * count; });
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kMemoryLimit);
    return error.what();
  }
  return "";
}

TEST(MemoryLimit, NamesTheBudgetThatFits) {
  EXPECT_EQ(refusal(750, 100), "");
  EXPECT_EQ(refusal(749, 100),
            "this budget of 100 anchors would need up to 750 bytes; the memory limit is 749 bytes, "
            "and at most 99 anchors fit");
  EXPECT_NE(refusal(57, 1000000).find("at most 1 anchors fit"), std::string::npos);
  EXPECT_NE(refusal(40, 5).find("at most 0 anchors fit"), std::string::npos);
}

TEST(MemoryLimit, OfAMachineLeavesRoomForOthers) {
  const auto machine =
      static_cast<uint64_t>(sysconf(_SC_PHYS_PAGES)) * static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
  EXPECT_GT(MemoryLimit::ofThisMachine(), machine / 10 * 5);
  EXPECT_LE(MemoryLimit::ofThisMachine(), machine / 10 * 6 + 6);
}

}  // namespace
}  // namespace stipple
