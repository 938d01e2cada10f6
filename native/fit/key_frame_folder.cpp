#include "fit/key_frame_folder.h"

#include <filesystem>
#include <system_error>

#include "base/error.h"
#include "io/assets/checkpoint.h"

namespace stipple {

namespace {

namespace fs = std::filesystem;

constexpr char kExtension[] = ".safetensors";

}  // namespace

KeyFrameFolder::KeyFrameFolder(const std::string& checkpoint_path)
    : folder_(checkpoint_path + ".frames") {}

std::string KeyFrameFolder::pathOf(const std::string& name) const {
  return (fs::path(folder_) / (name + kExtension)).string();
}

/// Removes the files that it writes alone: the folder may hold what is somebody else's.
void KeyFrameFolder::clear() {
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_, error)) {
    const std::string name = entry.path().filename().string();
    const bool is_own =
        name.ends_with(kExtension) &&
        (name.starts_with("global") || name.starts_with("key") || name.starts_with("pair"));
    std::error_code ignored;
    if (is_own) fs::remove(entry.path(), ignored);
  }
}

void KeyFrameFolder::put(const std::string& name, const TensorTable& table) {
  std::error_code error;
  fs::create_directories(folder_, error);
  if (error) {
    fail(ErrorCode::kIo, "the folder '" + folder_ + "' cannot be made: " + error.message());
  }
  writeCheckpoint("{}", table, pathOf(name));
}

std::optional<TensorTable> KeyFrameFolder::get(const std::string& name) const {
  std::error_code error;
  if (!fs::exists(pathOf(name), error)) return {};
  return std::move(readCheckpoint(pathOf(name)).tensors);
}

}  // namespace stipple
