#include "train/backend/backend_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "base/error.h"

namespace stipple {
namespace {

/// Sets the variable for one test, and gives it back.
class BackendTable : public ::testing::Test {
 protected:
  void SetUp() override {
    if (const char* before = std::getenv("STIPPLE_BACKEND")) before_ = before;
    unsetenv("STIPPLE_BACKEND");
  }
  void TearDown() override {
    unsetenv("STIPPLE_BACKEND");
    if (!before_.empty()) setenv("STIPPLE_BACKEND", before_.c_str(), 1);
  }

 private:
  std::string before_;
};

TEST_F(BackendTable, TheFirstRowIsUsedWhereNobodySaysOtherwise) {
  EXPECT_STREQ(backendKinds().front().name, "cpu");
  EXPECT_EQ(chosenBackends(), cpuBackends());
  setenv("STIPPLE_BACKEND", "", 1);
  EXPECT_EQ(chosenBackends(), cpuBackends());
}

TEST_F(BackendTable, ARowIsChosenByItsName) {
  for (const BackendKind& kind : backendKinds()) {
    setenv("STIPPLE_BACKEND", kind.name, 1);
    EXPECT_EQ(chosenBackends(), kind.backends()) << kind.name;
  }
}

TEST_F(BackendTable, AnUnknownNameIsRefusedWithThoseThatThereAre) {
  setenv("STIPPLE_BACKEND", "abacus", 1);
  try {
    chosenBackends();
    FAIL() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    EXPECT_THAT(error.what(),
                ::testing::HasSubstr("STIPPLE_BACKEND is \"abacus\"; this library has cpu"));
  }
}

}  // namespace
}  // namespace stipple
