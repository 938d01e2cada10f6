#include "io/bytes/output_kind.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>

#include "scratch_folder.h"

namespace stipple {
namespace {

class OutputKind : public ScratchFolder {
 protected:
  static bool isList(const std::string& path) { return headOfFile(path, 5) == "list:"; }
};

TEST_F(OutputKind, TakesNewEmptyAndSameFiles) {
  for (const std::string& name :
       {path("new"), store("empty", ""), store("old", "list: 1, 2"), store("short", "list:")}) {
    EXPECT_NO_THROW(requireOutputKind(name, "a list", isList)) << name;
  }
}

TEST_F(OutputKind, RefusesFilesOfAnotherKindByName) {
  for (const std::string& name : {store("model.ply", "ply"), store("long", "a longer text")}) {
    expectError(ErrorCode::kInvalidArgument, {name.c_str(), "another kind", "a list would replace"},
                [&] { requireOutputKind(name, "a list", isList); });
  }
  // What a link names would be replaced.
  std::filesystem::create_symlink("model.ply", path("link"));
  expectError(ErrorCode::kInvalidArgument, {"link is a file of another kind"},
              [&] { requireOutputKind(path("link"), "a list", isList); });
}

TEST_F(OutputKind, WhatCannotBeReadIsOfAnotherKind) {
  expectError(ErrorCode::kInvalidArgument, {"another kind"}, [&] {
    requireOutputKind(store("old", "list:"), "a list",
                      [](const std::string&) -> bool { fail(ErrorCode::kFormat, "not readable"); });
  });
}

TEST_F(OutputKind, RefusesPlacesThatCannotBeWritten) {
  expectError(ErrorCode::kIo, {"missing/a", "no folder"},
              [&] { requireOutputKind(path("missing/a"), "a list", isList); });
  expectError(ErrorCode::kIo, {"it is a folder"},
              [&] { requireOutputKind(folder_.string(), "a list", isList); });
  ASSERT_EQ(::mkfifo(path("pipe").c_str(), 0600), 0);
  expectError(ErrorCode::kIo, {"pipe", "not a regular file"},
              [&] { requireOutputKind(path("pipe"), "a list", isList); });
}

}  // namespace
}  // namespace stipple
