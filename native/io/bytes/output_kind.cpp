#include "io/bytes/output_kind.h"

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <system_error>

#include "base/error.h"
#include "base/platform/files.h"
#include "io/bytes/input_file.h"
#include "io/bytes/output_file.h"

namespace stipple {

namespace {

namespace fs = std::filesystem;

[[noreturn]] void failWriting(const std::string& path, const std::string& why) {
  fail(ErrorCode::kIo, path + " cannot be written: " + why);
}

void requireFolder(const std::string& path, const fs::path& target) {
  const fs::path parent = target.parent_path();
  const std::string folder = parent.empty() ? "." : parent.string();
  std::error_code ignored;
  if (!fs::is_directory(folder, ignored)) failWriting(path, "there is no folder '" + folder + "'");
  if (!platform::isWritable(folder)) {
    failWriting(path, "the folder '" + folder + "' is read-only");
  }
}

bool isOfKind(const std::string& path, const std::function<bool(const std::string&)>& judge) {
  try {
    return judge(path);
  } catch (const Error&) {
    return false;
  }
}

}  // namespace

void requireOutputKind(const std::string& path, const std::string& what,
                       const std::function<bool(const std::string&)>& is_of_kind) {
  const std::string target = outputTarget(path);
  requireFolder(path, target);
  platform::PathStatus status;
  if (!platform::statusOf(target, status)) {
    if (errno == ENOENT) return;
    failWriting(path, std::generic_category().message(errno));
  }
  if (status.kind == platform::PathKind::kFolder) failWriting(path, "it is a folder");
  if (status.kind != platform::PathKind::kFile) failWriting(path, "it is not a regular file");
  if (status.bytes == 0 || isOfKind(target, is_of_kind)) return;
  fail(ErrorCode::kInvalidArgument, path + " is a file of another kind, which " + what +
                                        " would replace; choose another name, or remove it");
}

std::string headOfFile(const std::string& path, size_t limit) {
  const InputFile file(path);
  std::string head(static_cast<size_t>(std::min<uint64_t>(limit, file.size())), '\0');
  file.readAt(0, head.data(), head.size());
  return head;
}

}  // namespace stipple
