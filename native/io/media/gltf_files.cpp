#include "io/media/gltf_files.h"

#include <filesystem>
#include <system_error>

#include "base/error.h"
#include "io/bytes/input_file.h"

namespace stipple::media {

namespace {

/// Of whatever kind: reading says what is wrong with it.
bool exists(const std::string& path, void*) {
  std::error_code ignored;
  return std::filesystem::exists(path, ignored);
}

bool readWhole(std::vector<unsigned char>* bytes, std::string* problem, const std::string& path,
               void*) {
  try {
    const InputFile file(path);
    bytes->resize(static_cast<size_t>(file.size()));
    file.readAt(0, bytes->data(), bytes->size());
    return true;
  } catch (const Error& error) {
    *problem = error.what();
    return false;
  }
}

[[maybe_unused]] bool sizeOf(size_t* size, std::string* problem, const std::string& path, void*) {
  try {
    *size = static_cast<size_t>(InputFile(path).size());
    return true;
  } catch (const Error& error) {
    *problem = error.what();
    return false;
  }
}

/// tinygltf asks for sizes from version 2.9 on.
template <typename Callbacks>
void setSizes(Callbacks& callbacks) {
  if constexpr (requires { callbacks.GetFileSizeInBytes; }) {
    callbacks.GetFileSizeInBytes = sizeOf;
  }
}

}  // namespace

void readRegularFilesOnly(tinygltf::TinyGLTF& loader) {
  tinygltf::FsCallbacks callbacks = {};
  callbacks.FileExists = exists;
  callbacks.ExpandFilePath = &tinygltf::ExpandFilePath;
  callbacks.ReadWholeFile = readWhole;
  callbacks.WriteWholeFile = &tinygltf::WriteWholeFile;
  setSizes(callbacks);
  loader.SetFsCallbacks(callbacks);
}

}  // namespace stipple::media
