#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "math/vec.h"

namespace stipple::media {

struct GltfModel;

/// The JSON of a glTF or GLB file that GltfScene accepts.
std::string gltfText(const std::string& path);

/// A glTF or GLB file in memory, and walks through its default scene.
/// Errors: kFormat with what tinygltf says, kUnsupported (a required extension that is not known).
class GltfScene {
 public:
  /// What is read; messages call it so.
  enum class Content { kMesh, kSplats };
  /// In: known, extensions that a file may require. Splats come without pictures and materials.
  GltfScene(const std::string& path, const std::set<std::string>& known, Content content);
  ~GltfScene();
  GltfScene(const GltfScene&) = delete;
  GltfScene& operator=(const GltfScene&) = delete;

  const GltfModel& model() const { return *model_; }
  /// Bytes of the file and of those that it names: what limits are compared with.
  uint64_t fileBytes() const { return file_bytes_; }
  /// The files of the pictures, still encoded.
  const std::vector<std::vector<unsigned char>>& images() const { return images_; }

  /// Each use of a mesh: its index, and the matrix that leads to the frame of `root`.
  using Visit = std::function<void(size_t mesh, const Mat4d& matrix)>;
  void visitMeshes(const Mat4d& root, const Visit& visit) const;

 private:
  struct Walk;

  void load(Content content);
  bool loadBinaryBeside();
  void readImageViews();
  std::vector<int> rootNodes() const;
  void visitNode(int index, const Mat4d& parent, int depth, Walk& walk) const;

  std::string path_;
  std::unique_ptr<GltfModel> model_;
  std::vector<std::vector<unsigned char>> images_;
  uint64_t file_bytes_ = 0;
};

}  // namespace stipple::media
