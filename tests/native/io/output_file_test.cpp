#include "io/bytes/output_file.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

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

TEST_F(OutputFileTest, WritesTheFileThatADanglingLinkNames) {
  fs::create_directory(path("there"));
  fs::create_symlink("there/real.ply", path("link.ply"));
  fs::create_symlink("link.ply", path("second.ply"));
  {
    OutputFile file(path("second.ply"));
    file.write("new", 3);
    file.commit();
  }
  EXPECT_TRUE(fs::is_symlink(path("link.ply")));
  EXPECT_TRUE(fs::is_symlink(path("second.ply")));
  EXPECT_EQ(load(path("there/real.ply")), "new");
  fs::create_symlink("nowhere/real.ply", path("lost.ply"));
  expectError(ErrorCode::kIo, {path("lost.ply").c_str(), "No such file or directory"},
              [&] { OutputFile file(path("lost.ply")); });
}

TEST_F(OutputFileTest, RefusesLinksThatGoInACircle) {
  fs::create_symlink("b.ply", path("a.ply"));
  fs::create_symlink("a.ply", path("b.ply"));
  expectError(ErrorCode::kIo, {path("a.ply").c_str(), "Too many levels of symbolic links"},
              [&] { OutputFile file(path("a.ply")); });
}

/// Runs `work` in a process that is then killed. Returns its number.
template <typename Work>
pid_t killed(const Work& work) {
  const pid_t process = ::fork();
  if (process == 0) {
    work();
    ::raise(SIGKILL);
  }
  int status = 0;
  EXPECT_EQ(::waitpid(process, &status, 0), process);
  EXPECT_TRUE(WIFSIGNALED(status));
  return process;
}

TEST_F(OutputFileTest, TheNextStartRemovesWhatAKilledProcessLeft) {
  killed([&] {
    OutputFile file(path("a.ply"));
    file.write("half", 4);
    OutputFile given(path("b.ply"));
    given.handOver();
    ::raise(SIGKILL);
  });
  EXPECT_EQ(fileCount(), 2u);
  OutputFile(path("a.ply")).commit();
  EXPECT_EQ(fileCount(), 1u);
  EXPECT_TRUE(fs::exists(path("a.ply")));
}

TEST_F(OutputFileTest, WhatALivingProcessWritesStays) {
  fs::create_directory(path("folder"));
  // By its number; by its lock, where the number is that of a process that has ended, as one of
  // another machine may seem; and what is not called so is nobody's.
  const pid_t ended = killed([] {});
  const std::string by_number = path("folder/.stipple-" + std::to_string(::getppid()) + "-0.ply");
  const std::string by_lock = path("folder/.stipple-" + std::to_string(ended) + "-0.ply");
  const std::string left = path("folder/.stipple-" + std::to_string(ended) + "-1.ply");
  const std::string other = path("folder/.stipple-" + std::to_string(ended) + "-x.ply");
  for (const std::string& name : {by_number, by_lock, left, other}) std::ofstream(name) << "half";
  const int lock = ::open(by_lock.c_str(), O_RDONLY);
  ASSERT_EQ(::flock(lock, LOCK_EX), 0);
  OutputFile(path("folder/a.ply")).commit();
  EXPECT_TRUE(fs::exists(by_number));
  EXPECT_TRUE(fs::exists(by_lock));
  EXPECT_TRUE(fs::exists(other));
  EXPECT_FALSE(fs::exists(left));
  ::close(lock);
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
