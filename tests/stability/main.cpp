#include <gtest/gtest.h>

#include "page.h"
#include "traps.h"

// Floating-point traps are switched on before oneTBB starts a thread: threads inherit them. A
// division by zero, an invalid operation or an overflow anywhere then ends the program.

int main(int argc, char** argv) {
  stipple::testing::enableTraps();
  ::testing::InitGoogleTest(&argc, argv);
  stipple::testing::writePageAfterTests();
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  return RUN_ALL_TESTS();
}
