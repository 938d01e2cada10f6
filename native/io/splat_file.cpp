#include "io/splat_file.h"

#include <algorithm>

#include "base/error.h"
#include "io/input_file.h"
#include "io/ply_file.h"

namespace stipple {

namespace {

constexpr char kPlyEnding[] = ".ply";

std::string firstBytes(const std::string& path) {
  const InputFile file(path);
  std::string bytes(static_cast<size_t>(std::min<uint64_t>(file.size(), 4)), '\0');
  file.readAt(0, bytes.data(), bytes.size());
  return bytes;
}

}  // namespace

SplatCloud readSplatFile(const std::string& path, Progress* progress) {
  const std::string start = firstBytes(path);
  const std::string ending = lowerEnding(path);
  // A file that is named PLY and is not one gets the PLY reader's words.
  if (start.rfind("ply", 0) == 0 || ending == kPlyEnding) return readPlySplats(path, progress);
  fail(ErrorCode::kFormat, path + " is not a splat file that can be read: its ending is '" +
                               ending +
                               "' and it does not start with 'ply'; 3DGS PLY is supported");
}

void writeSplatFile(const SplatCloud& cloud, const std::string& path,
                    const SplatWriteOptions& options, Progress* progress) {
  const std::string ending = lowerEnding(path);
  if (ending != kPlyEnding) {
    fail(ErrorCode::kUnsupported,
         path + " cannot be written as splats: its ending is '" + ending + "'; .ply is supported");
  }
  writePlySplats(cloud, path, options.ascii, progress);
}

}  // namespace stipple
