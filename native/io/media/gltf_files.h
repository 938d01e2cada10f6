#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace tinygltf {
class TinyGLTF;
}  // namespace tinygltf

namespace stipple::media {

/// The files that a glTF file names, its own among them, read for the loader: regular files alone,
/// by the names that stand there, and a file that is named again and again only as often as
/// kInstanceAllowance lets it be.
class GltfFiles {
 public:
  /// In: path, of the glTF file, for messages.
  explicit GltfFiles(const std::string& path) : path_(path) {}
  GltfFiles(const GltfFiles&) = delete;
  GltfFiles& operator=(const GltfFiles&) = delete;

  /// Makes the loader read through this, which must outlive it.
  void serve(tinygltf::TinyGLTF& loader);
  /// Bytes of all files that were read, each counted once.
  uint64_t differentBytes() const { return different_bytes_; }
  /// Throws what kept a file from being read by its size.
  void requireAllowed() const;

 private:
  bool take(const std::string& file, uint64_t bytes);

  std::string path_;
  std::map<std::string, uint64_t> seen_;
  uint64_t different_bytes_ = 0;
  uint64_t all_bytes_ = 0;
};

}  // namespace stipple::media
