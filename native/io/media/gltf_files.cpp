#include "io/media/gltf_files.h"

#include <filesystem>
#include <system_error>
#include <vector>

#include "base/error.h"
#include "io/bytes/input_file.h"
#include "io/bytes/limits.h"
#include "io/media/gltf_model.h"

namespace stipple::media {

namespace {

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

void GltfFiles::serve(tinygltf::TinyGLTF& loader) {
  tinygltf::FsCallbacks callbacks{};
  callbacks.user_data = this;
  callbacks.FileExists = [](const std::string& file, void*) {
    std::error_code ignored;
    return std::filesystem::exists(file, ignored);  // of whatever kind: reading says what is wrong
  };
  // As they stand: the loader's own function may hand names to a shell.
  callbacks.ExpandFilePath = [](const std::string& file, void*) { return file; };
  callbacks.ReadWholeFile = [](std::vector<unsigned char>* bytes, std::string* error,
                               const std::string& name, void* user) {
    try {
      const InputFile file(name);
      if (!static_cast<GltfFiles*>(user)->take(name, file.size())) return false;
      bytes->resize(static_cast<size_t>(file.size()));
      file.readAt(0, bytes->data(), bytes->size());
      return true;
    } catch (const Error& reason) {
      *error += reason.what();
      return false;
    }
  };
  callbacks.WriteWholeFile = &tinygltf::WriteWholeFile;
  setSizes(callbacks);
  loader.SetFsCallbacks(callbacks);
}

bool GltfFiles::take(const std::string& file, uint64_t bytes) {
  if (seen_.emplace(file, bytes).second) different_bytes_ += bytes;
  all_bytes_ += bytes;
  return all_bytes_ <= kInstanceAllowance.of(different_bytes_);
}

void GltfFiles::requireAllowed() const {
  stipple::requireAllowed(all_bytes_, kInstanceAllowance, different_bytes_, path_,
                          "the files that it names");
}

}  // namespace stipple::media
