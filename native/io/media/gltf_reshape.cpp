// Based on: The Khronos 3D Formats Working Group, glTF 2.0 Specification, sections 3.6 (buffers and
// accessors), 3.7 (meshes) and 4 (GLB).
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"
#include "io/bytes/json_text.h"
#include "io/bytes/little_endian.h"
#include "io/media/gltf_accessor.h"
#include "io/media/gltf_model.h"
#include "io/media/gltf_primitives.h"
#include "io/media/gltf_scene.h"
#include "io/media/media_calls.h"

namespace stipple::media {

namespace {

using nlohmann::ordered_json;

constexpr int kFloat = TINYGLTF_COMPONENT_TYPE_FLOAT;
constexpr uint32_t kGlbMagic = 0x46546c67;
constexpr uint32_t kJsonChunk = 0x4e4f534a;
constexpr uint32_t kBinaryChunk = 0x004e4942;

/// The JSON of a file beside all of its buffers and pictures as one: what stands in it stays as it
/// is, known here or not.
class WholeGlb {
 public:
  WholeGlb(const GltfScene& scene, std::string_view text, std::string path)
      : path_(std::move(path)), root_(parseOrderedJson(text, path_)) {
    takeBuffers(scene.model());
    takePictures(scene.images());
  }

  ordered_json& root() { return root_; }

  /// Adds an accessor of rows [N,3] and returns its index. In: with_bounds: it says how far it
  /// reaches, as positions must.
  size_t addRows(const std::vector<float>& rows, bool with_bounds) {
    ordered_json accessor = {{"bufferView", addView(rows.data(), rows.size() * sizeof(float))},
                             {"componentType", kFloat},
                             {"count", rows.size() / 3},
                             {"type", "VEC3"}};
    root_["bufferViews"].back()["target"] = TINYGLTF_TARGET_ARRAY_BUFFER;
    std::array<float, 3> low = {}, high = {};
    for (size_t i = 0; i < rows.size(); ++i) {
      low[i % 3] = i < 3 ? rows[i] : std::min(low[i % 3], rows[i]);
      high[i % 3] = i < 3 ? rows[i] : std::max(high[i % 3], rows[i]);
    }
    if (with_bounds) {
      accessor["min"] = low;
      accessor["max"] = high;
    }
    root_["accessors"].push_back(std::move(accessor));
    return root_["accessors"].size() - 1;
  }

  void write(const char* path) {
    root_["buffers"] = ordered_json::array({{{"byteLength", binary_.size()}}});
    std::string text = root_.dump(-1, ' ', false, ordered_json::error_handler_t::replace);
    text.resize((text.size() + 3) / 4 * 4, ' ');
    binary_.resize((binary_.size() + 3) / 4 * 4, 0);
    const uint64_t bytes = uint64_t{28} + text.size() + binary_.size();
    if (bytes > UINT32_MAX) {
      fail(ErrorCode::kUnsupported, path_ + " would have " + std::to_string(bytes) +
                                        " bytes with its new shape; a .glb holds less than 4 GiB");
    }
    std::array<uint8_t, 28> heads;
    const uint32_t numbers[5] = {kGlbMagic, 2, static_cast<uint32_t>(bytes),
                                 static_cast<uint32_t>(text.size()), kJsonChunk};
    for (size_t i = 0; i < 5; ++i) storeLittleEndian(numbers[i], &heads[i * 4]);
    storeLittleEndian(static_cast<uint32_t>(binary_.size()), &heads[20]);
    storeLittleEndian(kBinaryChunk, &heads[24]);
    std::ofstream file(std::filesystem::path(path), std::ios::binary | std::ios::trunc);
    file.write(reinterpret_cast<const char*>(heads.data()), 20);
    file.write(text.data(), static_cast<std::streamsize>(text.size()));
    file.write(reinterpret_cast<const char*>(heads.data() + 20), 8);
    file.write(reinterpret_cast<const char*>(binary_.data()),
               static_cast<std::streamsize>(binary_.size()));
    finishFile(file, path);
  }

 private:
  /// Puts bytes at the end of the one buffer and returns where.
  size_t append(const void* bytes, size_t count) {
    binary_.resize((binary_.size() + 3) / 4 * 4, 0);
    const size_t at = binary_.size();
    const auto* first = static_cast<const unsigned char*>(bytes);
    binary_.insert(binary_.end(), first, first + count);
    return at;
  }

  size_t addView(const void* bytes, size_t count) {
    const size_t at = append(bytes, count);
    root_["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", at}, {"byteLength", count}});
    return root_["bufferViews"].size() - 1;
  }

  void takeBuffers(const GltfModel& model) {
    std::vector<size_t> begins;
    for (size_t buffer = 0; buffer < model.buffers.size(); ++buffer) {
      const auto bytes = model.bytesOf(buffer);
      begins.push_back(append(bytes.data(), bytes.size()));
    }
    if (!root_.contains("bufferViews")) root_["bufferViews"] = ordered_json::array();
    for (ordered_json& view : root_["bufferViews"]) {
      if (view.contains("extensions")) {
        fail(ErrorCode::kUnsupported,
             path_ + " has a buffer view with the extension '" +
                 view["extensions"].items().begin().key().substr(0, 80) +
                 "', which cannot be kept with a new shape; write a .ply, or export it without");
      }
      const auto buffer = view.at("buffer").get<size_t>();
      view["byteOffset"] = view.value("byteOffset", size_t{0}) + begins.at(buffer);
      view["buffer"] = 0;
    }
  }

  /// Pictures of files of their own come into this one.
  void takePictures(const std::vector<std::vector<unsigned char>>& pictures) {
    if (!root_.contains("images")) return;
    for (size_t i = 0; i < root_["images"].size(); ++i) {
      ordered_json& image = root_["images"][i];
      if (!image.contains("uri") || i >= pictures.size() || pictures[i].empty()) continue;
      image.erase("uri");
      image["mimeType"] = mimeTypeOf(pictures[i]);
      image["bufferView"] = addView(pictures[i].data(), pictures[i].size());
    }
  }

  static std::string mimeTypeOf(const std::vector<unsigned char>& bytes) {
    const auto begins = [&](size_t at, std::string_view text) {
      return bytes.size() >= at + text.size() &&
             std::equal(text.begin(), text.end(), bytes.begin() + static_cast<ptrdiff_t>(at),
                        [](char a, unsigned char b) { return static_cast<unsigned char>(a) == b; });
    };
    if (begins(0, "\xff\xd8\xff")) return "image/jpeg";
    return begins(8, "WEBP") ? "image/webp" : "image/png";
  }

  std::string path_;
  ordered_json root_;
  std::vector<unsigned char> binary_;
};

/// Gives the meshes of a file's scene the places of a mesh that was read from it.
class Reshaping {
 public:
  Reshaping(const std::string& path, const StippleMediaShape& shape)
      : path_(path),
        shape_(shape),
        scene_(path, knownMeshExtensions(), GltfScene::Content::kMesh),
        model_(scene_.model()),
        glb_(scene_, gltfText(path), path) {}

  void write(const char* out) {
    scene_.visitMeshes(gltfToZUp(),
                       [this](size_t mesh, const Mat4d& matrix) { addMesh(mesh, matrix); });
    if (next_vertex_ != shape_.vertex_count || next_triangle_ != shape_.triangle_count) {
      fail(ErrorCode::kInvalidArgument, path_ + " has " + std::to_string(next_vertex_) +
                                            " vertices and " + std::to_string(next_triangle_) +
                                            " triangles; the mesh with the new shape has " +
                                            std::to_string(shape_.vertex_count) + " and " +
                                            std::to_string(shape_.triangle_count));
    }
    for (const auto& [key, rows] : positions_) indices_[&rows] = glb_.addRows(rows.values, true);
    for (const auto& [key, rows] : normals_) indices_[&rows] = glb_.addRows(rows.values, false);
    for (const Use& use : uses_) name(use);
    glb_.write(out);
  }

 private:
  /// New values of an accessor; primitives of a mesh may share it.
  struct Rows {
    std::vector<float> values;
    std::vector<uint8_t> is_used;  ///< by a triangle, which goes before vertices without one
  };
  using Key = std::pair<size_t, int>;  ///< mesh and accessor
  struct Use {
    size_t mesh, primitive;
    const Rows* positions;
    const Rows* normals;
  };

  void addMesh(size_t index, const Mat4d& matrix) {
    if (!seen_.insert(index).second) {
      fail(ErrorCode::kUnsupported, path_ + " shows mesh " + std::to_string(index) +
                                        " several times; each would need a shape of its own. "
                                        "Write a .ply, or export it with a mesh for each");
    }
    const tinygltf::Mesh& mesh = model_.meshes[index];
    for (size_t p = 0; p < mesh.primitives.size(); ++p) {
      if (hasSurface(mesh.primitives[p])) addPrimitive(index, p, matrix);
    }
  }

  void addPrimitive(size_t mesh, size_t index, const Mat4d& matrix) {
    const tinygltf::Primitive& primitive = model_.meshes[mesh].primitives[index];
    const std::string what =
        path_ + ": mesh " + std::to_string(mesh) + ", primitive " + std::to_string(index);
    const int position = attributeOf(primitive, "POSITION");
    const int normal = attributeOf(primitive, "NORMAL");
    const size_t count = accessorCount(model_, position, what);
    const std::vector<uint32_t> corners = surfaceCorners(model_, primitive, count, matrix, what);
    if (corners.empty()) return;
    const size_t first_vertex = next_vertex_, first_triangle = next_triangle_;
    next_vertex_ += count;
    next_triangle_ += corners.size() / 3;
    // write() has the words for it.
    if (next_vertex_ > shape_.vertex_count || next_triangle_ > shape_.triangle_count) return;
    std::vector<uint8_t> is_used(count, 0);
    for (const uint32_t corner : corners) is_used[corner] = 1;
    Rows& places = positions_[{mesh, position}];
    setPlaces(places, is_used, first_vertex, matrix, what);
    const bool with_normals = normal >= 0 && shape_.corner_normals;
    if (with_normals) setNormals(normals_[{mesh, normal}], corners, first_triangle, count, matrix);
    uses_.push_back({mesh, index, &places, with_normals ? &normals_[{mesh, normal}] : nullptr});
  }

  void setPlaces(Rows& rows, const std::vector<uint8_t>& is_used, size_t first, const Mat4d& matrix,
                 const std::string& what) const {
    const Mat4d back = matrix.inverse();
    if (!back.allFinite()) {
      fail(ErrorCode::kUnsupported,
           what + " is scaled to zero; its new shape cannot be brought back. Write a .ply");
    }
    rows.values.resize(is_used.size() * 3, 0.0f);
    rows.is_used.resize(is_used.size(), 0);
    for (size_t v = 0; v < is_used.size(); ++v) {
      if (rows.is_used[v] && !is_used[v]) continue;
      rows.is_used[v] = is_used[v];
      const float* p = &shape_.positions[(first + v) * 3];
      const Eigen::Vector4d place =
          back * Eigen::Vector4d(double(p[0]), double(p[1]), double(p[2]), 1.0);
      for (size_t axis = 0; axis < 3; ++axis) {
        rows.values[v * 3 + axis] = static_cast<float>(place[static_cast<Eigen::Index>(axis)]);
      }
    }
  }

  /// The corners of a vertex have one normal, which is its own. Vertices without a triangle keep
  /// one of length 1.
  void setNormals(Rows& rows, const std::vector<uint32_t>& corners, size_t first_triangle,
                  size_t count, const Mat4d& matrix) const {
    const Mat3d back = matrix.topLeftCorner<3, 3>().transpose();
    if (rows.values.empty()) {
      rows.values.resize(count * 3, 0.0f);
      for (size_t v = 0; v < count; ++v) rows.values[v * 3 + 1] = 1.0f;
    }
    for (size_t corner = 0; corner < corners.size(); ++corner) {
      const float* n = &shape_.corner_normals[(first_triangle * 3 + corner) * 3];
      const Vec3d normal = back * Vec3d(double(n[0]), double(n[1]), double(n[2]));
      if (!(normal.norm() > 0)) continue;
      for (size_t axis = 0; axis < 3; ++axis) {
        rows.values[corners[corner] * size_t{3} + axis] =
            static_cast<float>(normal[static_cast<Eigen::Index>(axis)] / normal.norm());
      }
    }
  }

  /// Names the new values in the place of the old. Tangents of the old shape go: without them, who
  /// draws makes them of positions, normals and UVs.
  void name(const Use& use) {
    ordered_json& primitive = glb_.root()["meshes"].at(use.mesh)["primitives"].at(use.primitive);
    ordered_json& attributes = primitive["attributes"];
    attributes["POSITION"] = indices_.at(use.positions);
    if (use.normals) attributes["NORMAL"] = indices_.at(use.normals);
    attributes.erase("TANGENT");
    if (!primitive.contains("targets")) return;
    for (ordered_json& target : primitive["targets"]) target.erase("TANGENT");
  }

  std::string path_;
  const StippleMediaShape& shape_;
  GltfScene scene_;
  const GltfModel& model_;
  WholeGlb glb_;
  std::set<size_t> seen_;
  std::map<Key, Rows> positions_, normals_;
  std::map<const Rows*, size_t> indices_;
  std::vector<Use> uses_;
  size_t next_vertex_ = 0, next_triangle_ = 0;
};

}  // namespace

void stipple_media_mesh_reshape(const char* source, const char* path,
                                const StippleMediaShape* shape, StippleMediaStatus* status) {
  guard(source, status, [&] { Reshaping(source, *shape).write(path); });
}

}  // namespace stipple::media
