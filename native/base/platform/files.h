#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>

/// What the systems do each in their own way: platform/posix and platform/windows implement the
/// same headers, and one of the folders is built. Paths are UTF-8. A function that fails says so by
/// its result and leaves the reason in errno.
namespace stipple::platform {

enum class PathKind { kMissing, kFile, kFolder, kOther };

struct PathStatus {
  PathKind kind = PathKind::kMissing;
  uint64_t bytes = 0;
  int64_t modified = 0;      ///< nanoseconds since the year 1970
  unsigned permissions = 0;  ///< those of POSIX
};

/// Links are followed. Returns: whether there is something, or nothing for another reason than that
/// errno names; kMissing and false go together.
bool statusOf(const std::string& path, PathStatus& status);
bool statusOfOpen(int descriptor, PathStatus& status);
/// Whether the user may write a file, or make files in a folder.
bool isWritable(const std::string& path);

/// Opens what is there for reading, of whatever kind, and never waits. Returns: a descriptor, or
/// -1.
int openForReading(const std::string& path);
/// Makes a file that is not there yet, for writing; EEXIST where it is. Returns: a descriptor, or
/// -1.
int createFile(const std::string& path, unsigned permissions);
void closeFile(int descriptor);
/// The descriptor as a stream of bytes, which owns it from then on; null where that fails.
std::FILE* streamOf(int descriptor);
int descriptorOf(std::FILE* stream);
/// Some bytes at a place, from any thread. Returns: how many, 0 at the end of a file, or -1.
int64_t readSome(int descriptor, uint64_t offset, void* bytes, size_t count);
int64_t writeSome(int descriptor, uint64_t offset, const void* bytes, size_t count);
/// The file in memory, for reading, as long as the pointer lives; null where that fails.
std::shared_ptr<const uint8_t> mapFile(int descriptor, size_t length);

/// Waits until the bytes of a file that is closed are with the device.
bool syncFile(const std::string& path);
/// Gives a file another name in its folder, in the place of what has it: at any time there is one
/// or the other.
bool replaceFile(const std::string& from, const std::string& to);
bool removeFile(const std::string& path);

long processNumber();
/// Whether a process of this machine may have the number.
bool mayLive(long process);
/// A second descriptor of a file, which holds a lock on it until it is closed, at the latest with
/// the process. Returns: -1 where the system has no locks.
int lockFile(int descriptor);
/// Removes a regular file, if it is one and no process on whichever machine holds its lock.
void removeUnlocked(const std::string& path);

}  // namespace stipple::platform
