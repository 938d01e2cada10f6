#include <algorithm>
#include <cctype>
#include <filesystem>
#include <system_error>

#include "cli/commands.h"
#include "cli/formats.h"

namespace stipple::cli {

namespace {

std::string extensionOf(const std::string& path) {
  const size_t dot = path.find_last_of("./");
  std::string extension = dot == std::string::npos || path[dot] == '/' ? "" : path.substr(dot);
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

bool isColmapFile(const std::string& path) {
  const std::string name = std::filesystem::path(path).filename().string();
  return name == "cameras.bin" || name == "cameras.txt" || name == "images.bin" ||
         name == "images.txt";
}

}  // namespace

bool hasModelExtension(const std::string& path) {
  return extensionOf(path) == ".safetensors";
}

FileKind fileKind(const std::string& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) return FileKind::kViews;
  const std::string extension = extensionOf(path);
  // A glTF file holds meshes, splats or both; splats go first, because fewer programs show them.
  if (extension == ".glb" || extension == ".gltf") {
    uint64_t index = 0;
    uint64_t count = 0;
    check(stipple_format_count(&count));
    const bool splats = stipple_format_of_file(path.c_str(), &index) == STIPPLE_OK && index < count;
    return splats ? FileKind::kSplats : FileKind::kMesh;
  }
  if (hasSplatExtension(path)) return FileKind::kSplats;
  if (hasModelExtension(path)) return FileKind::kModel;
  if (extension == ".json" || extension == ".npy" || isColmapFile(path)) return FileKind::kViews;
  if (extension == ".vdb") return FileKind::kVolume;
  for (const char* image : {".png", ".exr", ".jpg", ".jpeg", ".tif", ".tiff", ".hdr"}) {
    if (extension == image) return FileKind::kImage;
  }
  throw Failure("'" + path + "' ends with '" + extension + "'; " + splatExtensions(false) +
                ", .glb, .gltf, .stipple.safetensors, .json, .vdb, .png, .exr, .jpg, .tif "
                "or .hdr is expected");
}

}  // namespace stipple::cli
