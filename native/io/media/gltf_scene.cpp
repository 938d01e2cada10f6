// Based on: The Khronos 3D Formats Working Group, glTF 2.0 Specification, section 3.5 (scenes and
// node transforms).
#include "io/media/gltf_scene.h"

#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#include <tiny_gltf.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <fstream>

#include "base/error.h"
#include "io/media/gltf_accessor.h"

namespace stipple::media {

namespace {

constexpr int kMaxDepth = 1000;

Mat4d localMatrix(const tinygltf::Node& node) {
  Mat4d matrix = Mat4d::Identity();
  if (node.matrix.size() == 16) {
    // Column by column in the file.
    for (int row = 0; row < 4; ++row) {
      for (int column = 0; column < 4; ++column) {
        matrix(row, column) = node.matrix[static_cast<size_t>(column * 4 + row)];
      }
    }
    return matrix;
  }
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  if (node.rotation.size() == 4) {
    // x, y, z, w in the file.
    rotation =
        Eigen::Quaterniond(node.rotation[3], node.rotation[0], node.rotation[1], node.rotation[2]);
    if (rotation.norm() > 0) rotation.normalize();
  }
  Vec3d scale(1, 1, 1);
  if (node.scale.size() == 3) scale = Vec3d(node.scale[0], node.scale[1], node.scale[2]);
  matrix.topLeftCorner<3, 3>() = rotation.toRotationMatrix() * scale.asDiagonal();
  if (node.translation.size() == 3) {
    matrix.topRightCorner<3, 1>() =
        Vec3d(node.translation[0], node.translation[1], node.translation[2]);
  }
  return matrix;
}

}  // namespace

struct GltfScene::Walk {
  const Visit& visit;
  size_t visited = 0;
};

GltfScene::GltfScene(const std::string& path, const std::set<std::string>& known,
                     const std::string& kind)
    : path_(path), model_(std::make_unique<tinygltf::Model>()) {
  load();
  for (const std::string& name : model_->extensionsRequired) {
    if (known.count(name) == 0) {
      fail(ErrorCode::kUnsupported, path_ + " requires the glTF extension '" + name.substr(0, 80) +
                                        "', which is not supported; export the " + kind +
                                        " without it");
    }
  }
}

GltfScene::~GltfScene() = default;

void GltfScene::load() {
  tinygltf::TinyGLTF loader;
  // Images are only kept here; those that a base colour needs are decoded later. The ranges of
  // images inside the file's own buffers are not checked by tinygltf, so they are not touched
  // yet.
  loader.SetImageLoader(
      [](tinygltf::Image* image, const int index, std::string*, std::string*, int, int,
         const unsigned char* bytes, int size, void* user) {
        auto& images = *static_cast<std::vector<std::vector<unsigned char>>*>(user);
        if (image->bufferView >= 0) return true;
        if (index < 0 || size < 0) return false;
        images.resize(std::max(images.size(), static_cast<size_t>(index) + 1));
        images[static_cast<size_t>(index)].assign(bytes, bytes + size);
        return true;
      },
      &images_);
  std::string error;
  std::string warning;
  char magic[4] = {};
  std::ifstream(path_, std::ios::binary).read(magic, sizeof(magic));
  const bool loaded = std::string(magic, sizeof(magic)) == "glTF"
                          ? loader.LoadBinaryFromFile(model_.get(), &error, &warning, path_)
                          : loader.LoadASCIIFromFile(model_.get(), &error, &warning, path_);
  if (!loaded) {
    fail(ErrorCode::kFormat,
         path_ + " is not a valid glTF file: " + (error.empty() ? "no reason is given" : error));
  }
  images_.resize(model_->images.size());
  for (size_t i = 0; i < images_.size(); ++i) {
    if (model_->images[i].bufferView < 0) continue;
    images_[i] =
        readView(*model_, model_->images[i].bufferView, path_ + ": image " + std::to_string(i));
  }
}

std::vector<int> GltfScene::rootNodes() const {
  const size_t scene = model_->defaultScene < 0 ? 0 : static_cast<size_t>(model_->defaultScene);
  if (scene < model_->scenes.size()) return model_->scenes[scene].nodes;
  std::set<int> children;
  for (const tinygltf::Node& node : model_->nodes) {
    children.insert(node.children.begin(), node.children.end());
  }
  std::vector<int> roots;
  for (size_t i = 0; i < model_->nodes.size(); ++i) {
    if (children.count(static_cast<int>(i)) == 0) roots.push_back(static_cast<int>(i));
  }
  return roots;
}

void GltfScene::visitNode(int index, const Mat4d& parent, int depth, Walk& walk) const {
  if (index < 0 || static_cast<size_t>(index) >= model_->nodes.size()) {
    fail(ErrorCode::kFormat, path_ + " names node " + std::to_string(index) + "; the file has " +
                                 std::to_string(model_->nodes.size()));
  }
  // In a valid file every node has one parent; this also ends circles.
  if (depth > kMaxDepth || ++walk.visited > model_->nodes.size()) {
    fail(ErrorCode::kFormat,
         path_ + ": node " + std::to_string(index) + " has several parents or is its own ancestor");
  }
  const tinygltf::Node& node = model_->nodes[static_cast<size_t>(index)];
  const Mat4d matrix = parent * localMatrix(node);
  if (node.mesh >= 0) {
    if (static_cast<size_t>(node.mesh) >= model_->meshes.size()) {
      fail(ErrorCode::kFormat, path_ + " names mesh " + std::to_string(node.mesh) +
                                   "; the file has " + std::to_string(model_->meshes.size()));
    }
    walk.visit(static_cast<size_t>(node.mesh), matrix);
  }
  for (const int child : node.children) visitNode(child, matrix, depth + 1, walk);
}

void GltfScene::visitMeshes(const Mat4d& root, const Visit& visit) const {
  Walk walk{visit};
  for (const int node : rootNodes()) visitNode(node, root, 0, walk);
}

}  // namespace stipple::media
