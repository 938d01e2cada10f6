#include "io/bytes/output_file.h"

#include <gtest/gtest.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <string>

#include "scratch_folder.h"

namespace stipple {
namespace {

namespace fs = std::filesystem;

class OutputFileTest : public ScratchFolder {};

TEST_F(OutputFileTest, AppearsUnderItsNameOnlyWhenCommitted) {
  {
    OutputFile file(path("a.ply"));
    file.write("whole", 5);
    EXPECT_FALSE(fs::exists(path("a.ply")));
    EXPECT_EQ(fs::path(file.temporaryPath()).parent_path(), folder_);
    EXPECT_EQ(fs::path(file.temporaryPath()).extension(), ".ply");
    file.commit();
  }
  EXPECT_EQ(load(path("a.ply")), "whole");
  EXPECT_EQ(fileCount(), 1u);
}

TEST_F(OutputFileTest, TakesItsPartsInAnyOrder) {
  OutputFile file(path("a.ply"));
  file.writeAt(6, "end", 3);
  file.writeAt(0, "start ", 6);
  file.commit();
  EXPECT_EQ(load(path("a.ply")), "start end");
}

TEST_F(OutputFileTest, LeavesTheOldFileAndNothingElseWithoutCommit) {
  store("a.ply", "old");
  {
    OutputFile file(path("a.ply"));
    file.write("new", 3);
  }
  EXPECT_EQ(load(path("a.ply")), "old");
  EXPECT_EQ(fileCount(), 1u);
}

TEST_F(OutputFileTest, CommitsWhatALibraryWroteUnderTheTemporaryName) {
  OutputFile file(path("a.png"));
  file.handOver();
  std::ofstream(file.temporaryPath(), std::ios::binary) << "by another";
  file.commit();
  EXPECT_EQ(load(path("a.png")), "by another");
}

TEST_F(OutputFileTest, KeepsTheModeOfTheFileThatItReplaces) {
  store("a.ply", "old");
  ASSERT_EQ(::chmod(path("a.ply").c_str(), 0640), 0);
  OutputFile file(path("a.ply"));
  file.commit();
  struct stat status {};
  ASSERT_EQ(::stat(path("a.ply").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0640u);
}

TEST_F(OutputFileTest, WritesThroughALinkAndKeepsIt) {
  store("real.ply", "old");
  fs::create_symlink(path("real.ply"), path("link.ply"));
  {
    OutputFile file(path("link.ply"));
    file.write("new", 3);
    file.commit();
  }
  EXPECT_TRUE(fs::is_symlink(path("link.ply")));
  EXPECT_EQ(load(path("real.ply")), "new");
}

TEST_F(OutputFileTest, RefusesAMissingFolderWithPathAndReason) {
  const std::string target = path("missing/a.ply");
  expectError(ErrorCode::kIo, {target.c_str(), "No such file or directory"},
              [&] { OutputFile file(target); });
}

TEST_F(OutputFileTest, RefusesAFolderAndADevice) {
  expectError(ErrorCode::kIo, {"folder"}, [&] { OutputFile file(folder_.string()); });
  expectError(ErrorCode::kIo, {"/dev/null", "regular"}, [] { OutputFile file("/dev/null"); });
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
  expectError(ErrorCode::kIo, {"empty"}, [] { OutputFile file(""); });
}

TEST_F(OutputFileTest, ReportsAFullDiskAndKeepsTheOldFile) {
  // A file system of 64 KiB; only the superuser may mount one.
  if (::mount("tmpfs", folder_.c_str(), "tmpfs", 0, "size=64k") != 0) {
    GTEST_SKIP() << "mounting a small file system is not allowed here";
  }
  store("a.ply", "old");
  const std::string much(1 << 20, 'x');
  expectError(ErrorCode::kIo, {"a.ply", "No space left on device"}, [&] {
    OutputFile file(path("a.ply"));
    file.write(much.data(), much.size());
    file.commit();
  });
  EXPECT_EQ(load(path("a.ply")), "old");
  EXPECT_EQ(fileCount(), 1u);
  ASSERT_EQ(::umount(folder_.c_str()), 0);
}

TEST_F(OutputFileTest, ReportsAFileSizeLimit) {
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto old_handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit limit = before;
  limit.rlim_cur = 4096;
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &limit), 0);
  const std::string much(1 << 20, 'x');
  expectError(ErrorCode::kIo, {"a.ply", "File too large"}, [&] {
    OutputFile file(path("a.ply"));
    file.write(much.data(), much.size());
    file.commit();
  });
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
  std::signal(SIGXFSZ, old_handler);
  EXPECT_EQ(fileCount(), 0u);
}

}  // namespace
}  // namespace stipple
