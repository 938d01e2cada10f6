// Based on: The Khronos 3D Formats Working Group, glTF 2.0 Specification, section 3.5 (scenes and
// node transforms).
#include "io/media/gltf_scene.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <string_view>

#include "base/error.h"
#include "base/parallel.h"
#include "io/bytes/input_file.h"
#include "io/bytes/json_text.h"
#include "io/bytes/limits.h"
#include "io/bytes/little_endian.h"
#include "io/media/gltf_accessor.h"
#include "io/media/gltf_files.h"
#include "io/media/gltf_model.h"

namespace stipple::media {

namespace {

constexpr int kMaxDepth = 1000;
constexpr size_t kGlbHeadBytes = 20;  // with the head of its first part
constexpr size_t kChunkHeadBytes = 8;
constexpr uint32_t kGlbMagic = 0x46546c67;
constexpr uint32_t kJsonChunk = 0x4e4f534a;
constexpr uint32_t kBinaryChunk = 0x004e4942;
constexpr uint64_t kMaxJsonBytes = uint64_t{1} << 26;
// A loaded object takes up to 3 KB (a material), any other value 160 bytes; the objects of real
// files take 30 characters or more.
constexpr uint64_t kValuesOfObject = 16;
constexpr uint64_t kAlwaysAllowedValues = uint64_t{1} << 20;
constexpr size_t kReadBytes = size_t{1} << 21;

/// In: error, lines of tinygltf; they become one.
[[noreturn]] void failLoading(const std::string& path, std::string error) {
  while (!error.empty() && error.back() == '\n') error.pop_back();
  std::replace(error.begin(), error.end(), '\n', ' ');
  fail(ErrorCode::kFormat,
       path + " is not a valid glTF file: " + (error.empty() ? "no reason is given" : error));
}

/// Refuses JSON of which the loader would make much more than its text takes.
void requireSmallScene(std::string_view text, const std::string& path) {
  requireSmallJson(text, path);
  const JsonSize size = sizeOfJson(text);
  const uint64_t cost = size.values + size.objects * (kValuesOfObject - 1);
  const uint64_t allowed = kAlwaysAllowedValues + text.size();
  if (cost > allowed) {
    fail(ErrorCode::kFormat, path + " describes " + std::to_string(size.objects) + " objects in " +
                                 std::to_string(text.size()) + " bytes of JSON; at most " +
                                 std::to_string(allowed / kValuesOfObject) + " are allowed");
  }
}

/// The JSON of a GLB file, its first part; as much as there is of it.
std::string jsonPart(const InputFile& file) {
  std::array<uint8_t, kGlbHeadBytes> head;
  if (file.size() < head.size()) return "";
  file.readAt(0, head.data(), head.size());
  std::string text(static_cast<size_t>(std::min<uint64_t>(loadLittleEndian<uint32_t>(&head[12]),
                                                          file.size() - head.size())),
                   '\0');
  file.readAt(head.size(), text.data(), text.size());
  return text;
}

/// Refuses a GLB whose binary part is longer than what is left of the file: tinygltf reads as much
/// as the part says that it has. What is wrong before that part tinygltf has words for.
void requireWholeBinaryPart(const InputFile& file, const std::string& path) {
  std::array<uint8_t, kGlbHeadBytes> head;
  if (file.size() < head.size()) return;
  file.readAt(0, head.data(), head.size());
  const uint64_t binary_head = head.size() + uint64_t{loadLittleEndian<uint32_t>(&head[12])};
  if (binary_head >= file.size()) return;
  const uint64_t left = file.size() - binary_head;
  std::array<uint8_t, kChunkHeadBytes> chunk = {};
  file.readAt(binary_head, chunk.data(), std::min<uint64_t>(chunk.size(), left));
  const uint64_t bytes = loadLittleEndian<uint32_t>(&chunk[0]);
  if (left >= chunk.size() && bytes <= left - chunk.size()) return;
  failLoading(path, "its binary part says that it has " + std::to_string(bytes) +
                        " bytes; the file has " +
                        std::to_string(left - std::min<uint64_t>(chunk.size(), left)) + " of them");
}

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

std::string gltfText(const std::string& path) {
  const InputFile file(path);
  std::array<uint8_t, sizeof(uint32_t)> magic = {};
  file.readAt(0, magic.data(), std::min<size_t>(magic.size(), file.size()));
  const bool is_binary = loadLittleEndian<uint32_t>(magic.data()) == kGlbMagic;
  return is_binary ? jsonPart(file) : readTextFile(path, std::numeric_limits<unsigned>::max());
}

struct GltfScene::Walk {
  const Visit& visit;
  size_t visited = 0;
};

GltfScene::GltfScene(const std::string& path, const std::set<std::string>& known, Content content)
    : path_(path), model_(std::make_unique<GltfModel>()) {
  load(content);
  const std::string kind = content == Content::kSplats ? "splats" : "mesh";
  for (const std::string& name : model_->extensionsRequired) {
    if (known.count(name) == 0) {
      fail(ErrorCode::kUnsupported, path_ + " requires the glTF extension '" + name.substr(0, 80) +
                                        "', which is not supported; export the " + kind +
                                        " without it");
    }
  }
}

GltfScene::~GltfScene() = default;

/// Reads the binary part of a GLB straight to where accessors look for it, and gives tinygltf the
/// rest. False, and nothing done, for files that are not plainly made of JSON and one binary part:
/// tinygltf has the words for what is wrong with them.
bool GltfScene::loadBinaryBeside() {
  const InputFile file(path_);
  std::array<uint8_t, kGlbHeadBytes> head;
  if (file.size() < head.size() + kChunkHeadBytes) return false;
  file.readAt(0, head.data(), head.size());
  const uint64_t json_bytes = loadLittleEndian<uint32_t>(&head[12]);
  const uint64_t binary_head = head.size() + json_bytes;
  if (loadLittleEndian<uint32_t>(&head[0]) != kGlbMagic ||
      loadLittleEndian<uint32_t>(&head[4]) != 2 ||
      loadLittleEndian<uint32_t>(&head[16]) != kJsonChunk || json_bytes > kMaxJsonBytes ||
      json_bytes % 4 != 0 || loadLittleEndian<uint32_t>(&head[8]) != file.size() ||
      binary_head + kChunkHeadBytes > file.size()) {
    return false;
  }
  std::array<uint8_t, kChunkHeadBytes> chunk;
  file.readAt(binary_head, chunk.data(), chunk.size());
  const uint64_t binary_at = binary_head + chunk.size();
  const uint64_t binary_bytes = loadLittleEndian<uint32_t>(&chunk[0]);
  if (loadLittleEndian<uint32_t>(&chunk[4]) != kBinaryChunk ||
      binary_bytes > file.size() - binary_at) {
    return false;
  }
  std::string text(static_cast<size_t>(json_bytes), '\0');
  file.readAt(head.size(), text.data(), text.size());
  requireSmallScene(text, path_);
  nlohmann::json root = parseJson(text, path_);
  if (!root.is_object() || !root.contains("buffers") || !root["buffers"].is_array() ||
      root["buffers"].empty()) {
    return false;
  }
  for (const nlohmann::json& buffer : root["buffers"]) {
    const bool first = &buffer == &root["buffers"].front();
    if (!buffer.is_object() || buffer.contains("uri") == first) return false;
  }
  nlohmann::json& buffer = root["buffers"].front();
  if (!buffer.contains("byteLength") || !buffer["byteLength"].is_number_unsigned()) return false;
  const uint64_t used = buffer["byteLength"].get<uint64_t>();
  if (used == 0 || used > binary_bytes) return false;
  buffer["byteLength"] = 4;
  for (const char* unused : {"images", "textures", "samplers", "materials"}) root.erase(unused);

  text = root.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  text.resize((text.size() + 3) / 4 * 4, ' ');
  std::vector<uint8_t> small(head.size() + text.size() + kChunkHeadBytes + 4, 0);
  std::copy(head.begin(), head.end(), small.begin());
  storeLittleEndian(static_cast<uint32_t>(small.size()), &small[8]);
  storeLittleEndian(static_cast<uint32_t>(text.size()), &small[12]);
  std::copy(text.begin(), text.end(), small.begin() + head.size());
  uint8_t* const small_chunk = &small[head.size() + text.size()];
  storeLittleEndian(uint32_t{4}, small_chunk);
  storeLittleEndian(kBinaryChunk, small_chunk + 4);
  std::string error;
  std::string warning;
  GltfFiles files(path_);
  tinygltf::TinyGLTF loader;
  files.serve(loader);
  const std::string folder = std::filesystem::path(path_).parent_path().string();
  if (!loader.LoadBinaryFromMemory(model_.get(), &error, &warning, small.data(),
                                   static_cast<unsigned>(small.size()), folder)) {
    files.requireAllowed();
    failLoading(path_, error);
  }
  file_bytes_ = file.size() + files.differentBytes();
  model_->has_binary = true;
  model_->binary.resize(static_cast<size_t>(used));
  parallelFor(model_->binary.size(), kReadBytes, [&](size_t begin, size_t end) {
    file.readAt(binary_at + begin, &model_->binary[begin], end - begin);
  });
  return true;
}

void GltfScene::load(Content content) {
  if (content == Content::kSplats && loadBinaryBeside()) return;
  GltfFiles files(path_);
  tinygltf::TinyGLTF loader;
  files.serve(loader);
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
  const InputFile file(path_);
  std::array<uint8_t, sizeof(uint32_t)> magic = {};
  file.readAt(0, magic.data(), std::min<size_t>(magic.size(), file.size()));
  const bool is_binary = loadLittleEndian<uint32_t>(magic.data()) == kGlbMagic;
  bool loaded = false;
  if (is_binary) {
    requireSmallScene(jsonPart(file), path_);
    requireWholeBinaryPart(file, path_);
    loaded = loader.LoadBinaryFromFile(model_.get(), &error, &warning, path_);
  } else {
    const std::string text = readTextFile(path_, std::numeric_limits<unsigned>::max());
    requireSmallScene(text, path_);
    loaded = loader.LoadASCIIFromString(model_.get(), &error, &warning, text.data(),
                                        static_cast<unsigned>(text.size()),
                                        std::filesystem::path(path_).parent_path().string());
  }
  files.requireAllowed();
  if (!loaded) failLoading(path_, error);
  // The loader reads a binary file through `files`, too.
  file_bytes_ = files.differentBytes() + (is_binary ? 0 : file.size());
  readImageViews();
}

/// Copies the encoded images that lie in the file's own buffers.
void GltfScene::readImageViews() {
  images_.resize(model_->images.size());
  const auto name = [this](size_t i) { return path_ + ": image " + std::to_string(i); };
  uint64_t bytes = 0;
  for (size_t i = 0; i < images_.size(); ++i) {
    const int view = model_->images[i].bufferView;
    if (view >= 0) bytes += viewBytes(*model_, view, name(i));
  }
  requireAllowed(bytes, kInstanceAllowance, file_bytes_, path_,
                 std::to_string(images_.size()) + " images");
  for (size_t i = 0; i < images_.size(); ++i) {
    const int view = model_->images[i].bufferView;
    if (view >= 0) images_[i] = readView(*model_, view, name(i));
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
